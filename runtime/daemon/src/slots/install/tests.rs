use std::collections::BTreeSet;
use std::fs;

use muster_runtime::identity::{Fleet, ReleaseFile};
use tempfile::TempDir;

use super::super::disk::Disk;
use super::super::gate::GateLimits;
use super::*;

/// A host's disk and an operator's fleet.
struct Bench {
    folder: TempDir,
    disk: Disk,
    fleet: Fleet,
}

/// A musterd that takes any file.
const PROGRAM: &str = "#!/bin/sh\nexit 0\n";

impl Bench {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let disk = Disk::at(&folder.path().join("host"));
        let fleet = Fleet::create(&folder.path().join("fleet")).unwrap();
        Self {
            folder,
            disk,
            fleet,
        }
    }

    /// A slot as an operator sends it, and the contents of its files.
    fn slot(&self, fleet: &Fleet, program: &str) -> (Incoming, Vec<u8>) {
        let key = self.folder.path().join("fleet/fleet.pub");
        let files = [
            ("musterd", Some("x86_64/musterd"), program.to_owned()),
            (DRONES, Some("units/musterd@.service"), "drones".to_owned()),
            (BOOT, Some("units/muster-slots.service"), "boot".to_owned()),
            ("config/fleet.pub", None, fs::read_to_string(key).unwrap()),
            ("config/drone-0.toml", None, "id = 0".to_owned()),
            ("config/drone-0.key", None, "secret".to_owned()),
        ];
        let of = |(name, content): (&str, &String)| {
            (name.to_owned(), ReleaseFile::of(content.as_bytes()))
        };
        let released = files.iter().filter_map(|it| Some((it.1?, &it.2)));
        let manifest = Manifest {
            version: "0.2.0".to_owned(),
            wire: vec![1],
            journal: vec![1],
            files: released.map(of).collect(),
        };
        let all = files.iter().map(|it| (it.0, &it.2)).map(of);
        let hashes = all.map(|(path, file)| (path, file.sha256)).collect();
        let incoming = Incoming {
            facts: SlotFacts {
                version: manifest.version.clone(),
                release: hex(&manifest.digest()),
                configuration: configuration_digest(&hashes),
                wire: manifest.wire.clone(),
                journal: manifest.journal.clone(),
                drones: BTreeMap::from([(0, "127.0.0.1:9100".parse().unwrap())]),
                peers: BTreeSet::new(),
                gate: GateLimits {
                    within_s: 60,
                    hold_s: 10,
                },
                network: None,
            },
            manifest: fleet.sign_release(&manifest),
            files: files
                .iter()
                .map(|(path, in_release, content)| IncomingFile {
                    path: (*path).to_owned(),
                    in_release: in_release.map(str::to_owned),
                    bytes: content.len() as u64,
                    is_secret: path.ends_with(".key"),
                })
                .collect(),
        };
        let contents = files.iter().flat_map(|it| it.2.bytes()).collect();
        (incoming, contents)
    }

    fn receive(&self, (incoming, contents): &(Incoming, Vec<u8>)) -> Result<SlotId, String> {
        let received = receive(&self.disk, incoming, &mut &contents[..]);
        received.map_err(|refusal| refusal.to_string())
    }

    #[track_caller]
    fn assert_refused(&self, slot: &(Incoming, Vec<u8>), why: &str) {
        let refused = self.receive(slot).unwrap_err();
        assert!(refused.contains(why), "{refused}");
        let left = self.disk.slots().unwrap();
        assert!(left.complete.is_empty(), "{left:?}");
        assert!(!self.disk.slot(".incoming").exists());
    }
}

#[test]
fn slot_has_all_files_and_secrets_are_their_owners_only() {
    let bench = Bench::new();
    let id = bench.receive(&bench.slot(&bench.fleet, PROGRAM)).unwrap();
    let folder = bench.disk.slot(&id);
    let mode = |name: &str| {
        fs::metadata(folder.join(name))
            .unwrap()
            .permissions()
            .mode()
            & 0o777
    };
    assert_eq!(mode("config/drone-0.key"), 0o600);
    assert_eq!(mode("musterd"), 0o755);
    assert_eq!(mode("config/drone-0.toml"), 0o644);
    assert_eq!(bench.disk.facts(&id).unwrap().version, "0.2.0");
}

#[test]
fn altered_byte_of_any_file_is_refused() {
    let bench = Bench::new();
    let slot = bench.slot(&bench.fleet, PROGRAM);
    for at in 0..slot.1.len() {
        let mut altered = slot.clone();
        altered.1[at] ^= 1;
        bench.receive(&altered).unwrap_err();
        assert!(bench.disk.slots().unwrap().complete.is_empty());
    }
}

#[test]
fn altered_manifest_is_refused() {
    let bench = Bench::new();
    let mut slot = bench.slot(&bench.fleet, PROGRAM);
    slot.0.manifest = slot.0.manifest.replace("0.2.0", "0.3.0");
    bench.assert_refused(&slot, "the signature does not match");
}

#[test]
fn release_of_another_fleet_is_refused_from_the_first_slot_on() {
    let bench = Bench::new();
    let id = bench.receive(&bench.slot(&bench.fleet, PROGRAM)).unwrap();
    for goal in [Goal::Try(id), Goal::Keep] {
        bench.disk.reach(&goal).unwrap();
    }
    let other = Bench::new();
    let theirs = other.slot(&other.fleet, PROGRAM);
    let refused = bench.receive(&theirs).unwrap_err();
    assert!(
        refused.contains("the signature does not match"),
        "{refused}"
    );
    // This fleet's signature, with their key beside it.
    let mut foreign = bench.slot(&bench.fleet, PROGRAM);
    let ours = fs::read(bench.folder.path().join("fleet/fleet.pub")).unwrap();
    let key = fs::read(other.folder.path().join("fleet/fleet.pub")).unwrap();
    let at = foreign.1.windows(ours.len()).position(|it| it == ours);
    let at = at.unwrap();
    foreign.1.splice(at..at + ours.len(), key);
    let refused = bench.receive(&foreign).unwrap_err();
    assert_eq!(refused, "the host belongs to another fleet");
    // Their signature, with this fleet's key beside it.
    let disguised = bench.slot(&other.fleet, PROGRAM);
    let refused = bench.receive(&disguised).unwrap_err();
    assert!(
        refused.contains("the signature does not match"),
        "{refused}"
    );
}

#[test]
fn path_out_of_the_slot_is_refused() {
    for path in ["../musterd", "/etc/passwd", "config/../../x", "config/.x"] {
        let bench = Bench::new();
        let mut slot = bench.slot(&bench.fleet, PROGRAM);
        slot.0.files[4].path = path.to_owned();
        bench.assert_refused(&slot, "a file that it can't have");
    }
}

#[test]
fn configuration_that_the_new_program_refuses_is_refused() {
    let bench = Bench::new();
    let program = "#!/bin/sh\necho no such field >&2\nexit 2\n";
    let slot = bench.slot(&bench.fleet, program);
    bench.assert_refused(&slot, "the new musterd refuses drone-0.toml: no such field");
}

#[test]
fn slot_that_ends_in_the_middle_leaves_nothing() {
    let bench = Bench::new();
    let mut slot = bench.slot(&bench.fleet, PROGRAM);
    slot.1.truncate(slot.1.len() - 1);
    bench.assert_refused(&slot, "can't write the slot");
}

#[test]
fn unsigned_slot_leaves_the_rollback_slot() {
    let bench = Bench::new();
    let id = bench.receive(&bench.slot(&bench.fleet, PROGRAM)).unwrap();
    for goal in [Goal::Try(id.clone()), Goal::Keep] {
        bench.disk.reach(&goal).unwrap();
    }
    let next = bench.slot(&bench.fleet, "#!/bin/sh\nexit 0 # 2\n");
    let second = bench.receive(&next).unwrap();
    for goal in [Goal::Try(second), Goal::Keep] {
        bench.disk.reach(&goal).unwrap();
    }
    let mut altered = bench.slot(&bench.fleet, PROGRAM);
    altered.0.manifest = altered.0.manifest.replace("0.2.0", "0.3.0");
    bench.receive(&altered).unwrap_err();
    assert_eq!(bench.disk.slots().unwrap().rollback_slot(), Some(&id));
}

/// Why this program is refused as a new musterd, and after which time.
fn check_with(program: &str) -> (String, Duration) {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("config")).unwrap();
    fs::write(folder.path().join("config/drone-0.toml"), "").unwrap();
    let path = folder.path().join("musterd");
    fs::write(&path, program).unwrap();
    fs::set_permissions(&path, Permissions::from_mode(0o755)).unwrap();
    let start = Instant::now();
    let refused = try_out(folder.path(), None, Duration::from_secs(1)).unwrap_err();
    (refused.to_string(), start.elapsed())
}

#[test]
fn release_that_hangs_when_it_is_checked_is_ended() {
    for program in ["#!/bin/sh\nsleep 600\n", "#!/bin/sh\nsleep 600 &\nwait\n"] {
        let (refused, took) = check_with(program);
        assert!(
            refused.contains("has not checked drone-0.toml within 1 s"),
            "{refused}"
        );
        assert!(took < Duration::from_secs(10), "{took:?}");
    }
}

#[test]
fn errors_of_a_check_are_limited() {
    let (refused, took) = check_with("#!/bin/sh\nyes >&2\n");
    assert!(refused.len() < 2 * 16_384, "{}", refused.len());
    assert!(took < Duration::from_secs(10), "{took:?}");
}

#[test]
fn drones_user_can_enter_every_folder_whatever_the_mask_of_the_operator() {
    // The mask is the whole process's, so this test runs again in another.
    const AGAIN: &str = "MUSTER_TEST_WITH_MASK";
    if std::env::var_os(AGAIN).is_none() {
        let name = std::thread::current().name().unwrap().to_owned();
        let mut again = Command::new("sh");
        again.args(["-c", "umask 077; exec \"$0\" --exact \"$1\""]);
        again.arg(std::env::current_exe().unwrap()).arg(name);
        let output = again.env(AGAIN, "").output().unwrap();
        assert!(output.status.success(), "{output:?}");
        return;
    }
    let bench = Bench::new();
    // A host has these folders.
    for folder in ["", "host", "host/opt"] {
        let folder = bench.folder.path().join(folder);
        fs::create_dir_all(&folder).unwrap();
        fs::set_permissions(&folder, Permissions::from_mode(0o755)).unwrap();
    }
    let id = bench.receive(&bench.slot(&bench.fleet, PROGRAM)).unwrap();
    let slot = bench.disk.slot(&id);
    let home = bench.disk.home();
    for path in [
        home.clone(),
        home.join("slots"),
        slot.clone(),
        slot.join("config"),
    ] {
        let mode = fs::metadata(&path).unwrap().permissions().mode() & 0o777;
        assert_eq!(mode, 0o755, "{}", path.display());
    }
}
