use std::collections::BTreeMap;
use std::os::unix::fs::{MetadataExt, PermissionsExt};

use tempfile::TempDir;

use super::*;

/// A card as it is sold, as far as it matters: two mounted partitions.
struct Stock(TempDir);

impl Stock {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let metadata = fs::metadata(folder.path()).unwrap();
        let (user, group) = (metadata.uid(), metadata.gid());
        let files = [
            (
                "root/usr/lib/os-release",
                "PRETTY_NAME=\"Debian GNU/Linux 12\"\nID=debian\n".to_owned(),
            ),
            (
                "root/etc/passwd",
                format!(
                    "root:x:0:0::/root:/bin/bash\npi:x:{user}:{group}:,,,:/home/pi:/bin/bash\n"
                ),
            ),
            (
                "root/etc/shadow",
                "root:*:1::::::\npi:$y$hash:1::::::\n".to_owned(),
            ),
            (
                "root/etc/group",
                "sudo:x:27:pi\ndialout:x:20:pi,pip\npi:x:1000:\n".to_owned(),
            ),
            ("root/etc/subuid", "pi:100000:65536\n".to_owned()),
            (
                "root/etc/hosts",
                "127.0.0.1\tlocalhost\n127.0.1.1\traspberrypi\n".to_owned(),
            ),
            ("root/etc/hostname", "raspberrypi\n".to_owned()),
            (
                "root/etc/sudoers.d/010_pi-nopasswd",
                "pi ALL=(ALL) NOPASSWD: ALL\n".to_owned(),
            ),
            (
                "root/etc/systemd/system/multi-user.target.wants/userconfig.service",
                String::new(),
            ),
            ("root/home/pi/.bashrc", "# bash\n".to_owned()),
            (
                "boot/cmdline.txt",
                "console=serial0,115200 console=tty1 root=PARTUUID=1-02 rootwait\n".to_owned(),
            ),
            (
                "boot/config.txt",
                "dtparam=audio=on\n[cm4]\notg_mode=1\n".to_owned(),
            ),
            (
                "key.pub",
                format!("ssh-ed25519 {} me@laptop\n", "A".repeat(68)),
            ),
        ];
        for (path, text) in files {
            let path = folder.path().join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }
        let root = folder.path().join("root");
        std::os::unix::fs::symlink("../usr/lib/os-release", root.join("etc/os-release")).unwrap();
        fs::set_permissions(root.join("etc/shadow"), fs::Permissions::from_mode(0o640)).unwrap();
        Self(folder)
    }

    fn card(&self) -> Card {
        Card {
            name: "pi0".to_owned(),
            user: "fly".to_owned(),
            authorized_keys: self.0.path().join("key.pub"),
            address: (Ipv4Addr::new(10, 0, 0, 10), 24),
            ssid: "muster".to_owned(),
            channel: 6,
            rate_mbps: 12,
            country: "DE".to_owned(),
            time_server: Some(Ipv4Addr::new(10, 0, 0, 100)),
        }
    }

    fn prepare(&self, card: &Card) -> Result<Vec<PathBuf>, ImageError> {
        prepare(
            &self.0.path().join("boot"),
            &self.0.path().join("root"),
            card,
        )
    }

    fn read(&self, path: &str) -> String {
        fs::read_to_string(self.0.path().join(path)).unwrap()
    }

    fn mode(&self, path: &str) -> u32 {
        fs::metadata(self.0.path().join(path)).unwrap().mode() & 0o777
    }

    /// Each path with its content, permissions and what it leads to.
    fn all(&self) -> BTreeMap<PathBuf, (Vec<u8>, u32)> {
        fn collect(folder: &Path, all: &mut BTreeMap<PathBuf, (Vec<u8>, u32)>) {
            for entry in fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                let metadata = fs::symlink_metadata(&path).unwrap();
                let content = if metadata.is_symlink() {
                    fs::read_link(&path)
                        .unwrap()
                        .into_os_string()
                        .into_encoded_bytes()
                } else if metadata.is_dir() {
                    collect(&path, all);
                    Vec::new()
                } else {
                    fs::read(&path).unwrap()
                };
                all.insert(path, (content, metadata.mode()));
            }
        }
        let mut all = BTreeMap::new();
        collect(self.0.path(), &mut all);
        all
    }
}

#[test]
fn default_user_is_gone_and_no_user_has_a_password() {
    let stock = Stock::new();
    stock.prepare(&stock.card()).unwrap();
    assert!(stock.read("root/etc/passwd").contains("\nfly:x:"));
    assert!(stock.read("root/etc/passwd").contains(":/home/fly:"));
    assert_eq!(
        stock.read("root/etc/shadow"),
        "root:*:1::::::\nfly:*:1::::::\n"
    );
    assert_eq!(stock.mode("root/etc/shadow"), 0o640);
    assert_eq!(
        stock.read("root/etc/group"),
        "sudo:x:27:fly\ndialout:x:20:fly,pip\nfly:x:1000:\n"
    );
    assert_eq!(stock.read("root/etc/subuid"), "fly:100000:65536\n");
    assert_eq!(
        stock.read("root/etc/sudoers.d/010_muster"),
        "fly ALL=(ALL) NOPASSWD: ALL\n"
    );
    assert_eq!(
        stock.read("root/home/fly/.ssh/authorized_keys"),
        stock.read("key.pub")
    );
    assert_eq!(stock.mode("root/home/fly/.ssh"), 0o700);
    assert_eq!(stock.mode("root/home/fly/.ssh/authorized_keys"), 0o600);
    assert_eq!(stock.read("root/home/fly/.bashrc"), "# bash\n");
    let gone = [
        "home/pi",
        "etc/sudoers.d/010_pi-nopasswd",
        "etc/systemd/system/multi-user.target.wants/userconfig.service",
    ];
    for path in gone {
        assert!(!stock.0.path().join("root").join(path).exists(), "{path}");
    }
}

#[test]
fn radio_serial_port_and_time_are_as_asked_for() {
    let stock = Stock::new();
    stock.prepare(&stock.card()).unwrap();
    let network = "root/etc/NetworkManager/system-connections/muster.nmconnection";
    for line in [
        "mode=adhoc",
        "channel=6",
        "ssid=muster",
        "powersave=2",
        "address1=10.0.0.10/24",
    ] {
        assert!(stock.read(network).lines().any(|it| it == line), "{line}");
    }
    assert_eq!(
        stock.mode(network),
        0o600,
        "NetworkManager ignores it otherwise"
    );
    let radio = "root/etc/NetworkManager/dispatcher.d/50-muster";
    assert!(
        stock.read(radio).contains("power_save off")
            && stock.read(radio).contains("bitrates legacy-2.4 12")
    );
    assert_eq!(stock.mode(radio), 0o755);
    let arguments = "console=tty1 root=PARTUUID=1-02 rootwait cfg80211.ieee80211_regdom=DE\n";
    assert_eq!(stock.read("boot/cmdline.txt"), arguments);
    let config = stock.read("boot/config.txt");
    assert!(config.starts_with("dtparam=audio=on\n[cm4]\notg_mode=1\n"));
    assert!(config.contains("\n[all]\nenable_uart=1\ndtoverlay=disable-bt\n"));
    assert_eq!(
        stock.read("root/etc/systemd/timesyncd.conf.d/muster.conf"),
        "[Time]\nNTP=10.0.0.100\n"
    );
    assert_eq!(
        stock.read("root/etc/hosts"),
        "127.0.0.1\tlocalhost\n127.0.1.1\tpi0\n"
    );
    assert!(stock.0.path().join("boot/ssh").exists());
}

#[test]
fn a_card_that_is_prepared_again_is_the_same_or_as_asked_for_now() {
    let stock = Stock::new();
    stock.prepare(&stock.card()).unwrap();
    let once = stock.all();
    stock.prepare(&stock.card()).unwrap();
    assert_eq!(stock.all(), once);
    let other = Card {
        channel: 11,
        country: "FR".to_owned(),
        ..stock.card()
    };
    stock.prepare(&other).unwrap();
    assert!(
        stock
            .read("boot/cmdline.txt")
            .ends_with("rootwait cfg80211.ieee80211_regdom=FR\n")
    );
    assert_eq!(
        stock.read("boot/config.txt").matches("enable_uart").count(),
        1
    );
}

#[test]
fn a_card_stays_as_it_was_if_any_change_fails() {
    let stock = Stock::new();
    let before = stock.all();
    let edits = plan(
        &stock.0.path().join("boot"),
        &stock.0.path().join("root"),
        &stock.card(),
    )
    .unwrap();
    for failing in 0..=edits.len() {
        let mut edits = edits.clone();
        // Its parent is a file, so it can't be written, as on a full or worn card.
        let nowhere = stock.0.path().join("boot/cmdline.txt/file");
        edits.insert(failing, Edit::write(&nowhere, String::new(), None));
        let error = edit::carry_out(&edits).unwrap_err();
        assert!(matches!(error, ImageError::Write { path, .. } if path == nowhere));
        assert_eq!(stock.all(), before, "change {failing}");
    }
}

#[test]
fn what_is_no_card_or_no_public_key_is_refused_before_anything_is_written() {
    let stock = Stock::new();
    let refused = |card: &Card| {
        let before = stock.all();
        let error = stock.prepare(card).unwrap_err();
        assert_eq!(stock.all(), before);
        error.to_string()
    };
    for secret in [
        "-----BEGIN OPENSSH PRIVATE KEY-----\nAAAA\n",
        "ssh-ed25519\n",
        "password\n",
    ] {
        fs::write(stock.0.path().join("key.pub"), secret).unwrap();
        let words = refused(&stock.card());
        assert!(
            words.contains("secret key") || words.contains("no public keys"),
            "{words}"
        );
        assert!(!words.contains("AAAA"), "{words}");
    }
    let other = Stock::new();
    fs::write(
        other.0.path().join("root/usr/lib/os-release"),
        "ID=fedora\n",
    )
    .unwrap();
    assert!(
        other
            .prepare(&other.card())
            .unwrap_err()
            .to_string()
            .contains("no Raspberry Pi OS")
    );
    let without = Stock::new();
    fs::write(
        without.0.path().join("root/etc/passwd"),
        "root:x:0:0::/root:/bin/bash\n",
    )
    .unwrap();
    assert!(
        without
            .prepare(&without.card())
            .unwrap_err()
            .to_string()
            .contains("default user")
    );
    for name in ["", "pi", "root", "Fly", "1fly", "fly:x", "fly\nroot"] {
        assert!(user_name(name).is_err(), "{name}");
    }
    for name in ["", "-pi", "pi_0", "pi.0", "pi 0"] {
        assert!(host_name(name).is_err(), "{name}");
    }
    assert!(ssid("a b").is_err() && ssid("a\n[wifi]").is_err() && country("de").is_err());
}

#[test]
fn a_link_of_the_card_leads_to_no_file_of_this_machine() {
    let machine = tempfile::tempdir().unwrap();
    let link = |stock: &Stock, path: &str, name: &str| {
        let path = stock.0.path().join(path);
        let moved = machine.path().join(name);
        fs::rename(&path, &moved).unwrap();
        std::os::unix::fs::symlink(&moved, &path).unwrap();
        moved
    };
    for (nth, path) in [
        "root/etc/sudoers.d",
        "root/home",
        "root/etc/hosts",
        "boot/config.txt",
    ]
    .iter()
    .enumerate()
    {
        let stock = Stock::new();
        let moved = link(&stock, path, &nth.to_string());
        let before = stock.all();
        let refused = stock.prepare(&stock.card()).unwrap_err().to_string();
        assert!(refused.contains("is a symbolic link"), "{path}: {refused}");
        assert_eq!(stock.all(), before, "{path}");
        assert!(!moved.join("010_muster").exists());
    }
    // The folders of the partitions themselves may be reached by a link.
    let stock = Stock::new();
    let root = machine.path().join("root");
    std::os::unix::fs::symlink(stock.0.path().join("root"), &root).unwrap();
    prepare(&stock.0.path().join("boot"), &root, &stock.card()).unwrap();
}

#[test]
fn a_user_of_the_name_of_a_group_is_refused() {
    let stock = Stock::new();
    let card = Card {
        user: "sudo".to_owned(),
        ..stock.card()
    };
    let before = stock.all();
    let refused = stock.prepare(&card).unwrap_err().to_string();
    assert!(
        refused.contains("sudo is a group of this card"),
        "{refused}"
    );
    assert_eq!(stock.all(), before);
}

#[test]
fn a_mark_without_its_other_one_loses_no_lines() {
    let stock = Stock::new();
    stock.prepare(&stock.card()).unwrap();
    let good = stock.read("boot/config.txt");
    for mark in [
        "# muster deploy image: begin\n",
        "# muster deploy image: end\n",
    ] {
        let damaged = good.replace(mark, "") + "dtparam=spi=on\n";
        fs::write(stock.0.path().join("boot/config.txt"), &damaged).unwrap();
        let refused = stock.prepare(&stock.card()).unwrap_err().to_string();
        assert!(refused.contains("without the other one"), "{refused}");
        assert_eq!(stock.read("boot/config.txt"), damaged);
    }
}

#[test]
fn an_address_is_that_of_a_host() {
    let (host, prefix) = (Ipv4Addr::new(10, 0, 0, 10), 24);
    assert_eq!(address("10.0.0.10/24"), Ok((host, prefix)));
    assert!(address("192.168.1.254/30").is_ok_and(|it| it.1 == 30));
    for (text, why) in [
        ("10.0.0.0/24", "network itself"),
        ("10.0.0.255/24", "broadcast"),
        ("10.255.255.255/8", "broadcast"),
        ("239.1.1.1/24", "multicast"),
        ("127.0.0.2/8", "loopback"),
        ("0.0.0.1/8", "of no host"),
        ("255.255.255.254/24", "of no host"),
        ("10.0.0.10", "are accepted"),
        ("10.0.0.10/31", "are accepted"),
    ] {
        let refused = address(text).unwrap_err();
        assert!(refused.contains(why), "{text}: {refused}");
    }
}
