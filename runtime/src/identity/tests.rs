use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

use miette::Diagnostic;
use muster_machines::identity::NodeId;
use muster_machines::radio::Authenticator;
use tempfile::TempDir;

use super::*;

const FRAME: &[u8] = b"\x01a frame from its version on";

/// A fleet of three drones.
fn fleet() -> (TempDir, Fleet) {
    let folder = tempfile::tempdir().unwrap();
    let fleet = Fleet::create(&folder.path().join("fleet")).unwrap();
    for id in 0..3 {
        fleet.add_drone(NodeId(id)).unwrap();
    }
    (folder, fleet)
}

fn path(folder: &TempDir, name: &str) -> std::path::PathBuf {
    folder.path().join("fleet").join(name)
}

fn public(folder: &TempDir) -> FleetKey {
    FleetKey::load(&path(folder, "fleet.pub")).unwrap()
}

fn roster(folder: &TempDir) -> Roster {
    Roster::load(&path(folder, "roster.toml"), &public(folder)).unwrap()
}

fn key(folder: &TempDir, id: u32) -> DroneKey {
    DroneKey::load(&path(folder, &format!("drone-{id}.key"))).unwrap()
}

fn authenticator(folder: &TempDir, id: u32) -> Ed25519Authenticator {
    let key = key(folder, id);
    Ed25519Authenticator::new(NodeId(id), key, roster(folder), Expelled::default()).unwrap()
}

#[test]
fn a_drone_is_believed_by_the_others_and_speaks_for_no_other() {
    let (folder, _) = fleet();
    let signature = authenticator(&folder, 0).sign(FRAME);
    let other = authenticator(&folder, 1);
    assert!(other.verify(NodeId(0), FRAME, &signature));
    assert!(!other.verify(NodeId(2), FRAME, &signature), "as another");
    assert!(!other.verify(NodeId(7), FRAME, &signature), "as a stranger");
    let mut altered = FRAME.to_vec();
    altered[3] ^= 1;
    assert!(!other.verify(NodeId(0), &altered, &signature), "altered");
}

#[test]
fn a_drone_of_another_fleet_is_not_believed() {
    let ((ours, _), (theirs, _)) = (fleet(), fleet());
    let signature = authenticator(&theirs, 0).sign(FRAME);
    assert!(!authenticator(&ours, 1).verify(NodeId(0), FRAME, &signature));
    let refusal = Roster::load(&path(&theirs, "roster.toml"), &public(&ours)).unwrap_err();
    assert!(refusal.to_string().contains("signature"), "{refusal}");
}

#[test]
fn a_drone_that_is_not_who_the_roster_says_does_not_start() {
    let (folder, _) = fleet();
    let refused = |id, key, expelled| {
        Ed25519Authenticator::new(NodeId(id), key, roster(&folder), expelled).unwrap_err()
    };
    let nobody = Expelled::default;
    let refusal = refused(7, key(&folder, 0), nobody());
    assert_eq!(refusal, Untrusted::NotListed(NodeId(7)));
    let refusal = refused(1, key(&folder, 0), nobody());
    assert_eq!(refusal, Untrusted::OtherKey(NodeId(1)));
    let mut expelled = nobody();
    expelled.add([NodeId(0)]);
    let refusal = refused(0, key(&folder, 0), expelled);
    assert_eq!(refusal, Untrusted::Expelled(NodeId(0)));
}

#[test]
fn whoever_is_expelled_is_trusted_no_more_and_an_older_list_takes_nothing_back() {
    let (folder, fleet) = fleet();
    let load = || Expelled::load(&path(&folder, "expelled.toml"), &public(&folder)).unwrap();
    let before = load();
    let listener = authenticator(&folder, 0);
    assert!(listener.is_trusted(NodeId(1)));
    fleet.expel(&[NodeId(1)]).unwrap();
    let after = load();
    assert!(after.number() > before.number());
    assert_eq!(listener.expel(after), Ok(false));
    assert!(!listener.is_trusted(NodeId(1)));
    assert!(listener.is_trusted(NodeId(2)));
    let refusal = listener.expel(before).unwrap_err();
    assert!(refusal.offered < refusal.known);
    assert!(!listener.is_trusted(NodeId(1)));
    fleet.expel(&[NodeId(0)]).unwrap();
    assert_eq!(listener.expel(load()), Ok(true), "it is this drone's turn");
}

#[test]
fn nobody_is_expelled_who_does_not_belong_to_the_fleet() {
    let (folder, fleet) = fleet();
    let file = path(&folder, "expelled.toml");
    let before = fs::read(&file).unwrap();
    assert!(matches!(
        fleet.expel(&[NodeId(9)]),
        Err(KeysError::Refused(_))
    ));
    assert_eq!(fs::read(&file).unwrap(), before);
}

#[test]
fn secret_keys_are_for_their_owner_alone() {
    let (folder, _) = fleet();
    for name in ["fleet.key", "drone-0.key"] {
        let file = path(&folder, name);
        let mode = fs::metadata(&file).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o600, "{name}");
    }
    let file = path(&folder, "drone-0.key");
    for mode in [0o640, 0o604, 0o622] {
        fs::set_permissions(&file, fs::Permissions::from_mode(mode)).unwrap();
        let refusal = DroneKey::load(&file).unwrap_err();
        assert!(refusal.to_string().contains("others"), "{refusal}");
    }
}

#[test]
fn no_key_is_written_over() {
    let (folder, fleet) = fleet();
    let all = ["fleet.key", "drone-1.key", "roster.toml"];
    let before = all.map(|name| fs::read(path(&folder, name)).unwrap());
    let again = Fleet::create(&folder.path().join("fleet"));
    assert!(matches!(again, Err(KeysError::Refused(_))));
    assert!(matches!(
        fleet.add_drone(NodeId(1)),
        Err(KeysError::Refused(_))
    ));
    assert_eq!(
        all.map(|name| fs::read(path(&folder, name)).unwrap()),
        before
    );
}

#[test]
fn a_refused_secret_is_not_shown() {
    let (folder, _) = fleet();
    let file = path(&folder, "drone-0.key");
    let secret = fs::read_to_string(&file).unwrap();
    let digits = secret.split_whitespace().nth(1).unwrap();
    fs::write(&file, secret.replace("ed25519", "rsa")).unwrap();
    let refusal = DroneKey::load(&file).unwrap_err();
    let help = refusal.help().map(|help| help.to_string());
    assert!(!format!("{refusal}{help:?}").contains(&digits[..8]));
    assert!(refusal.source_code().is_none());
}

/// A refusal of a file in which `from` was made `to`.
fn spoilt(folder: &TempDir, name: &str, from: &str, to: &str) -> String {
    let file = path(folder, name);
    let text = fs::read_to_string(&file).unwrap();
    assert!(text.contains(from), "{text}");
    fs::write(&file, text.replacen(from, to, 1)).unwrap();
    let load = |file: &Path| match name {
        "roster.toml" => Roster::load(file, &public(folder)).map(drop),
        _ => Expelled::load(file, &public(folder)).map(drop),
    };
    let refusal = load(&file).unwrap_err();
    fs::write(&file, text).unwrap();
    load(&file).unwrap();
    refusal.to_string()
}

#[test]
fn lists_in_which_anything_was_changed_are_refused() {
    let (folder, fleet) = fleet();
    fleet.expel(&[NodeId(1)]).unwrap();
    for (name, from, to, says) in [
        ("roster.toml", "number = 3", "number = 4", "signature"),
        ("roster.toml", "id = 2", "id = 5", "signature"),
        ("roster.toml", "id = 2", "id = 1", "twice"),
        ("roster.toml", "key = \"", "key = \"0", "not a public key"),
        ("roster.toml", "number", "nummer", "unknown field"),
        ("expelled.toml", "number = 2", "number = 1", "signature"),
        ("expelled.toml", "[1]", "[]", "signature"),
        ("expelled.toml", "drones", "drohnen", "unknown field"),
    ] {
        let said = spoilt(&folder, name, from, to);
        assert!(said.contains(says), "{name}, {from} made {to}: {said}");
    }
}

#[test]
fn comments_may_be_added_to_a_list() {
    let (folder, _) = fleet();
    let file = path(&folder, "roster.toml");
    let text = fs::read_to_string(&file).unwrap();
    fs::write(&file, format!("# Ours.\n{text}")).unwrap();
    assert_eq!(roster(&folder).drones().count(), 3);
}

#[test]
fn a_secret_key_that_is_named_in_the_place_of_a_public_file_is_refused_and_not_shown() {
    let (folder, _) = fleet();
    let secret = path(&folder, "fleet.key");
    let digits = fs::read_to_string(&secret).unwrap();
    let digits = digits.split_whitespace().last().unwrap().to_owned();
    let errors = [
        FleetKey::load(&secret).unwrap_err(),
        Roster::load(&secret, &public(&folder)).unwrap_err(),
        Expelled::load(&secret, &public(&folder)).unwrap_err(),
    ];
    for error in errors {
        let shown = error.rendered();
        assert!(shown.contains("this is a secret key"), "{shown}");
        assert!(!shown.contains(&digits[..8]), "{shown}");
    }
}
