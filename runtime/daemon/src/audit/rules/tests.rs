use std::collections::BTreeSet;

use super::super::facts::{Updates, exposure, open_keys, settings, updates, with_password};
use super::super::fix::{Undo, undo_order};
use super::*;

/// What a stock Debian prints, shortened.
const STOCK: &str = "port 22\npermitrootlogin without-password\npasswordauthentication yes\n\
                     kbdinteractiveauthentication no\nbanner none\nloglevel INFO\n";
const HARDENED: &str = "port 22\npermitrootlogin no\npasswordauthentication no\n\
                        kbdinteractiveauthentication no\nbanner /etc/muster-banner\nloglevel VERBOSE\n";

fn facts(sshd: &str) -> Facts {
    Facts {
        sshd: settings(sshd),
        operator: "pi".to_owned(),
        ssh_ports: BTreeSet::from([22]),
        ..Facts::default()
    }
}

fn hardened() -> Facts {
    Facts {
        has_firewall: true,
        firewall_starts: true,
        ..facts(HARDENED)
    }
}

fn broken(facts: &Facts) -> Vec<String> {
    judge(facts).into_iter().map(|it| it.rule).collect()
}

#[test]
fn stock_host_breaks_rules_and_a_hardened_one_none() {
    let found = broken(&facts(STOCK));
    let expected = [
        "ssh-keys-only",
        "ssh-no-root",
        "ssh-banner",
        "ssh-log",
        "firewall",
    ];
    assert_eq!(found, expected);
    assert_eq!(broken(&hardened()), [""; 0]);
    assert_eq!(changes(&hardened(), &[]), []);
}

#[test]
fn each_planted_weakness_is_found() {
    type Plant = fn(&mut Facts);
    let table: [(&str, Plant); 8] = [
        ("no-passwords", |it| {
            it.with_password.insert("pi".to_owned());
        }),
        ("firewall", |it| it.firewall_starts = false),
        ("key-permissions", |it| {
            it.open_keys.push("/etc/muster/drone-0.key".into());
        }),
        ("serial-permissions", |it| {
            it.open_ports.push("/dev/ttyACM0".into());
        }),
        ("unit-sandbox", |it| {
            it.exposures.insert("musterd@0.service".to_owned(), 21);
        }),
        ("security-updates", |it| it.updates = Some(Updates::Off)),
        ("security-updates", |it| it.updates = Some(Updates::Missing)),
        ("ssh-no-root", |it| {
            it.sshd
                .insert("permitrootlogin".to_owned(), "yes".to_owned());
        }),
    ];
    for (rule, plant) in table {
        let mut facts = hardened();
        plant(&mut facts);
        assert_eq!(broken(&facts), [rule]);
    }
}

#[test]
fn operator_who_is_root_is_not_locked_out() {
    let root = Facts {
        operator: "root".to_owned(),
        ..facts(STOCK)
    };
    let findings = judge(&root);
    let about_root = findings.iter().find(|it| it.rule == "ssh-no-root").unwrap();
    assert!(!about_root.can_be_fixed && about_root.what.contains("with sudo first"));
    let settings = changes(&root, &findings)
        .into_iter()
        .find_map(|it| match it {
            Change::Write { path, text } if path == Path::new(SSHD) => Some(text),
            _ => None,
        });
    assert!(
        settings
            .unwrap()
            .contains("PermitRootLogin prohibit-password")
    );
}

#[test]
fn firewall_lets_in_every_port_of_sshd() {
    let mut facts = facts(STOCK);
    facts.ssh_ports = BTreeSet::from([22, 2222]);
    assert!(firewall_rules(&facts.ssh_ports).contains("tcp dport { 22, 2222 } accept"));
}

#[test]
fn users_who_can_log_in_with_a_password_are_found() {
    let passwd = "root:x:0:0::/root:/bin/bash\npi:x:1000:1000::/home/pi:/bin/bash\n\
                  guest:x:1001:1001::/home/guest:/bin/sh\nsync:x:4:1::/bin:/bin/sync\n\
                  muster:x:999:999::/var/lib/muster:/usr/sbin/nologin\n";
    let shadow = "root:!:1::::::\npi:$y$hash:1::::::\nguest::1::::::\nsync:*:1::::::\nmuster:$y$hash:1::::::\n";
    let expected = ["guest", "pi"].map(str::to_owned);
    assert_eq!(with_password(passwd, shadow), BTreeSet::from(expected));
}

#[test]
fn updates_count_as_on_once_apt_looks_for_them_and_installs_them() {
    // As Debian's apt prints them.
    let stock = "APT::Periodic \nAPT::Periodic::Update-Package-Lists 1\nAPT::Periodic::Unattended-Upgrade 1\n";
    assert_eq!(updates(stock), Updates::On);
    assert_eq!(updates(""), Updates::Off);
    assert_eq!(
        updates("APT::Periodic::Unattended-Upgrade 1\n"),
        Updates::Off
    );
    let never = stock.replace("Unattended-Upgrade 1", "Unattended-Upgrade 0");
    assert_eq!(updates(&never), Updates::Off);
    let disabled = format!("{stock}APT::Periodic::Enable 0\n");
    assert_eq!(updates(&disabled), Updates::Off);
}

#[test]
fn updates_that_are_not_installed_are_reported_and_not_set() {
    let missing = Facts {
        updates: Some(Updates::Missing),
        ..hardened()
    };
    assert_eq!(changes(&missing, &judge(&missing)), []);
    let off = Facts {
        updates: Some(Updates::Off),
        ..hardened()
    };
    let set = changes(&off, &judge(&off));
    assert!(matches!(&set[..], [Change::Write { path, .. }] if path == Path::new(UPDATES)));
    assert_eq!(broken(&hardened()), [""; 0], "nobody asks for them");
}

#[test]
fn exposure_is_read_as_systemd_prints_it() {
    let text = "  NAME  DESCRIPTION\n\n→ Overall exposure level for musterd@0.service: 1.7 OK 🙂\n";
    assert_eq!(exposure(text), Some(17));
    assert_eq!(exposure("no such unit"), None);
}

#[test]
fn change_and_undo_leave_a_file_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    for before in [None, Some("before")] {
        let path = folder.path().join("settings.d/file");
        let _ = std::fs::remove_file(&path);
        if let Some(text) = before {
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(&path, text).unwrap();
        }
        let change = write(path.to_str().unwrap(), "after".to_owned());
        let undo = change.undo().unwrap();
        change.carry_out().unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "after");
        undo.carry_out().unwrap();
        assert_eq!(std::fs::read_to_string(&path).ok().as_deref(), before);
    }
}

#[test]
fn files_are_restored_before_commands_read_them() {
    let run = || Undo::Run { words: Vec::new() };
    let file = || Undo::Write {
        path: PathBuf::new(),
        text: None,
    };
    assert_eq!(
        undo_order(vec![run(), file(), run()]),
        [file(), run(), run()]
    );
}

#[test]
fn only_files_of_a_homes_own_user_are_closed() {
    use std::os::unix::fs::{MetadataExt, PermissionsExt, symlink};

    let root = tempfile::tempdir().unwrap();
    let me = std::fs::metadata(root.path()).unwrap().uid();
    let keys = |home: &str| {
        root.path()
            .join("home")
            .join(home)
            .join(".ssh/authorized_keys")
    };
    for home in ["own", "link", "of-another"] {
        std::fs::create_dir_all(keys(home).parent().unwrap()).unwrap();
    }
    for home in ["own", "of-another"] {
        std::fs::write(keys(home), "").unwrap();
        let open = std::fs::Permissions::from_mode(0o666);
        std::fs::set_permissions(keys(home), open).unwrap();
    }
    symlink("/dev/null", keys("link")).unwrap();
    let other = me + 1;
    let passwd = format!(
        "own:x:{me}:0::/home/own:/bin/sh\nlink:x:{me}:0::/home/link:/bin/sh\n\
         another:x:{other}:0::/home/of-another:/bin/sh\n"
    );
    assert_eq!(open_keys(root.path(), &passwd), [keys("own")]);
}

/// What `nft -n list table inet muster` of nftables 1.0.6 prints.
const LISTED: &str = "table inet muster {
	chain input {
		type filter hook input priority 0; policy drop;
		ct state 0x2,0x4 accept
		iif \"lo\" accept
		meta l4proto { 1, 2, 58 } accept
		tcp dport 22 accept
		udp dport { 68, 546, 1024-65535 } accept
	}
}
";

#[test]
fn firewall_counts_only_with_the_rules_that_are_set() {
    let ports = BTreeSet::from([22]);
    assert!(is_firewall(LISTED, &ports));
    assert!(is_firewall(&firewall_rules(&ports), &ports));
    for (rule, other) in [
        ("policy drop", "policy accept"),
        ("tcp dport 22 accept", "tcp dport { 22, 23 } accept"),
        ("iif \"lo\" accept", "accept"),
        ("\t}\n}", "\t\taccept\n\t}\n}"),
        ("\t}\n}", "\t\tip saddr 10.0.0.1 jump more\n\t}\n}"),
    ] {
        let altered = LISTED.replace(rule, other);
        assert_ne!(altered, LISTED);
        assert!(!is_firewall(&altered, &ports), "{altered}");
    }
    assert!(!is_firewall("", &ports), "flushed");
    assert!(
        !is_firewall(LISTED, &BTreeSet::from([22, 2222])),
        "sshd has another port"
    );
}

#[test]
fn flushed_firewall_is_loaded_again() {
    let flushed = Facts {
        has_firewall: false,
        ..hardened()
    };
    let restart = Change::Run {
        words: words(&["systemctl", "restart", FIREWALL_UNIT]),
        undo: words(&["systemctl", "daemon-reload"]),
    };
    assert!(changes(&flushed, &judge(&flushed)).contains(&restart));
    assert!(FIREWALL_TEXT.contains("After=nftables.service\n"));
}
