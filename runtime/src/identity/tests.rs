use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use miette::Diagnostic;
use muster_machines::identity::NodeId;
use muster_machines::radio::Authenticator;
use muster_machines::wire::PAYLOAD_MAX;
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

fn revoked(folder: &TempDir) -> RevocationList {
    RevocationList::load(&path(folder, "revoked.toml"), &public(folder)).unwrap()
}

/// A drone's authenticator with the fleet's current revocation list.
fn authenticator(folder: &TempDir, id: u32) -> Ed25519Authenticator {
    identified(folder, id, key(folder, id)).unwrap()
}

fn identified(
    folder: &TempDir,
    id: u32,
    key: DroneKey,
) -> Result<Ed25519Authenticator, IdentityMismatch> {
    let (roster, revoked) = (roster(folder), revoked(folder));
    Ed25519Authenticator::new(NodeId(id), key, public(folder), roster, &revoked)
}

#[test]
fn signature_verifies_for_its_sender_and_no_other_drone() {
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
fn signatures_and_lists_of_another_fleet_are_refused() {
    let ((ours, _), (theirs, _)) = (fleet(), fleet());
    let signature = authenticator(&theirs, 0).sign(FRAME);
    assert!(!authenticator(&ours, 1).verify(NodeId(0), FRAME, &signature));
    let refusal = Roster::load(&path(&theirs, "roster.toml"), &public(&ours)).unwrap_err();
    assert!(refusal.to_string().contains("signature"), "{refusal}");
}

#[test]
fn drone_that_does_not_match_the_roster_gets_no_authenticator() {
    let (folder, fleet) = fleet();
    let refused = |id| identified(&folder, id, key(&folder, 0)).unwrap_err();
    assert_eq!(refused(7), IdentityMismatch::NotListed(NodeId(7)));
    assert_eq!(refused(1), IdentityMismatch::OtherKey(NodeId(1)));
    fleet.revoke(&[NodeId(0)]).unwrap();
    let refusal = refused(0);
    assert_eq!(refusal, IdentityMismatch::Revoked(NodeId(0)));
}

#[test]
fn forwarded_list_is_read_if_signed_by_the_fleet() {
    let (folder, fleet) = fleet();
    let listener = authenticator(&folder, 0);
    let older = revoked(&folder).revoked();
    assert_eq!(
        listener.read_list(&older.signed.clone().unwrap()),
        Some(older)
    );
    fleet.revoke(&[NodeId(2)]).unwrap();
    let list = revoked(&folder).revoked();
    assert_eq!((list.number, &list.drones), (2, &NodeId(2).into()));
    let signed = list.signed.clone().unwrap();
    for at in 0..signed.len() {
        let mut altered = signed.to_vec();
        altered[at] ^= 1;
        assert_eq!(listener.read_list(&altered), None, "{at}");
        assert_eq!(listener.read_list(&signed[..at]), None, "{at}");
    }
    // A forwarded list equals the operator's file.
    assert_eq!(listener.read_list(&signed), Some(list));

    let (theirs, _) = self::fleet();
    let strange = revoked(&theirs).revoked().signed.unwrap();
    assert_eq!(listener.read_list(&strange), None);
    let claims = [&[0; 64][..], &[1, 2, 0, 0xff, 0xff, 0xff, 0xff, 0x0f]].concat();
    assert_eq!(listener.read_list(&claims), None, "of all drones");
}

#[test]
fn list_too_long_for_a_datagram_is_not_forwarded() {
    let (folder, fleet) = fleet();
    for (drones, apart, fits) in [(400, 10_000, true), (600, 2, true), (700, 2, false)] {
        let mut list = revoked(&folder);
        list.add((0..drones).map(|id| NodeId(apart * id)), fleet.key());
        assert_eq!(list.fits_datagram(), fits, "{drones} drones");
        let bytes = list.to_bytes();
        assert!(bytes.as_ref().is_none_or(|it| it.len() < PAYLOAD_MAX));
        let read = bytes.map(|it| RevocationList::from_bytes(&it, &public(&folder)));
        assert_eq!(read, fits.then_some(Some(list)));
    }
}

#[test]
fn drone_outside_the_roster_cannot_be_revoked() {
    let (folder, fleet) = fleet();
    let file = path(&folder, "revoked.toml");
    let before = fs::read(&file).unwrap();
    assert!(matches!(
        fleet.revoke(&[NodeId(9)]),
        Err(KeysError::Refused(_))
    ));
    assert_eq!(fs::read(&file).unwrap(), before);
}

#[test]
fn secret_keys_must_be_readable_by_their_owner_only() {
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
        assert!(refusal.to_string().contains("other than"), "{refusal}");
    }
}

#[test]
fn keys_are_never_overwritten() {
    let (folder, fleet) = fleet();
    let all = ["fleet.key", "drone-1.key", "roster.toml"];
    let before = all.map(|name| fs::read(path(&folder, name)).unwrap());
    let second = Fleet::create(&folder.path().join("fleet"));
    assert!(matches!(second, Err(KeysError::Refused(_))));
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
fn refused_secret_key_is_not_shown() {
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

/// The error of a file in which `from` is replaced by `to`.
fn error_after_change(folder: &TempDir, name: &str, from: &str, to: &str) -> String {
    let file = path(folder, name);
    let text = fs::read_to_string(&file).unwrap();
    assert!(text.contains(from), "{text}");
    fs::write(&file, text.replacen(from, to, 1)).unwrap();
    let load = |file: &Path| match name {
        "roster.toml" => Roster::load(file, &public(folder)).map(drop),
        _ => RevocationList::load(file, &public(folder)).map(drop),
    };
    let refusal = load(&file).unwrap_err();
    fs::write(&file, text).unwrap();
    load(&file).unwrap();
    refusal.to_string()
}

#[test]
fn changed_lists_are_refused() {
    let (folder, fleet) = fleet();
    fleet.revoke(&[NodeId(1)]).unwrap();
    for (name, from, to, says) in [
        ("roster.toml", "number = 3", "number = 4", "signature"),
        ("roster.toml", "id = 2", "id = 5", "signature"),
        ("roster.toml", "id = 2", "id = 1", "twice"),
        ("roster.toml", "key = \"", "key = \"0", "not a public key"),
        ("roster.toml", "number", "nummer", "unknown field"),
        ("revoked.toml", "number = 2", "number = 1", "signature"),
        ("revoked.toml", "[1]", "[]", "signature"),
        ("revoked.toml", "drones", "drohnen", "unknown field"),
    ] {
        let error = error_after_change(&folder, name, from, to);
        assert!(error.contains(says), "{name}, {from} -> {to}: {error}");
    }
}

#[test]
fn comments_in_a_list_keep_its_signature_valid() {
    let (folder, _) = fleet();
    let file = path(&folder, "roster.toml");
    let text = fs::read_to_string(&file).unwrap();
    fs::write(&file, format!("# Ours.\n{text}")).unwrap();
    assert_eq!(roster(&folder).drones().count(), 3);
}

#[test]
fn secret_key_given_as_public_file_is_refused_and_not_shown() {
    let (folder, _) = fleet();
    let secret = path(&folder, "fleet.key");
    let digits = fs::read_to_string(&secret).unwrap();
    let digits = digits.split_whitespace().last().unwrap().to_owned();
    let errors = [
        FleetKey::load(&secret).unwrap_err(),
        Roster::load(&secret, &public(&folder)).unwrap_err(),
        RevocationList::load(&secret, &public(&folder)).unwrap_err(),
    ];
    for error in errors {
        let shown = error.rendered();
        assert!(shown.contains("this is a secret key"), "{shown}");
        assert!(!shown.contains(&digits[..8]), "{shown}");
    }
}

mod grants {
    use std::time::Duration;

    use muster_msp::{Configuration, Uid};
    use proptest::prelude::*;

    use super::*;
    use crate::identity::{
        CalendarTime, ControllerFacts, Evidence, EvidenceKind, Grant, GrantRefusal, GrantedStage,
    };

    fn facts(seed: u32) -> ControllerFacts {
        let uid = Uid { uid: [seed, 2, 3] };
        ControllerFacts::new(&Configuration::default(), &uid)
    }

    fn at(text: &str) -> CalendarTime {
        CalendarTime::read(text).unwrap()
    }

    fn grant() -> Grant {
        let issued = at("2026-11-26T12:00:00Z");
        Grant {
            drone: NodeId(1),
            stage: GrantedStage::Tethered,
            controller: facts(7),
            issued,
            until: issued.after(Duration::from_secs(86_400)),
            evidence: evidence(GrantedStage::Tethered),
        }
    }

    /// All that a stage needs.
    fn evidence(stage: GrantedStage) -> Evidence {
        let kinds = EvidenceKind::ALL.iter().filter(|it| it.stage() <= stage);
        kinds.map(|kind| (*kind, [3; 32])).collect()
    }

    fn signed() -> (TempDir, Fleet, PathBuf) {
        let (folder, fleet) = fleet();
        let file = fleet.grant(&grant()).unwrap();
        (folder, fleet, file)
    }

    #[test]
    fn a_signed_grant_allows_its_stage_to_its_drone_until_its_end() {
        let (folder, _, file) = signed();
        let read = Grant::load(&file, &public(&folder)).unwrap();
        assert_eq!(read, grant());
        let (mine, tethered) = (NodeId(1), GrantedStage::Tethered);
        let now = at("2026-11-26T13:00:00Z");
        let allows = |drone, stage, found: &ControllerFacts, now| {
            read.allows(drone, stage, found, now).err()
        };
        assert_eq!(allows(mine, tethered, &facts(7), now), None);
        // A clock that is behind the signature can't prolong it.
        let behind = at("1970-01-01T00:00:00Z");
        assert_eq!(allows(mine, tethered, &facts(7), behind), None);
        let other = allows(NodeId(2), tethered, &facts(7), now);
        assert_eq!(other, Some(GrantRefusal::OtherDrone(mine)));
        let skipped = allows(mine, GrantedStage::Flight, &facts(7), now);
        assert_eq!(skipped, Some(GrantRefusal::LowerStage(tethered)));
        let ended = allows(mine, tethered, &facts(7), at("2026-11-27T12:00:00Z"));
        assert!(matches!(ended, Some(GrantRefusal::Ended { .. })));
        let swapped = allows(mine, tethered, &facts(8), now);
        assert!(matches!(
            swapped,
            Some(GrantRefusal::OtherController { .. })
        ));
        let newer = ControllerFacts {
            firmware: "BTFL 4.7.0".to_owned(),
            ..facts(7)
        };
        let newer = allows(mine, tethered, &newer, now);
        assert!(matches!(newer, Some(GrantRefusal::OtherFirmware { .. })));
        let mut changed = Configuration::default();
        changed.failsafe.delay_ds = 200;
        let changed = ControllerFacts::new(&changed, &Uid { uid: [7, 2, 3] });
        let changed = allows(mine, tethered, &changed, now);
        assert_eq!(changed, Some(GrantRefusal::OtherSettings));
    }

    #[test]
    fn a_grant_that_was_signed_without_what_a_stage_needs_allows_no_stage_from_there_on() {
        let (_folder, fleet) = fleet();
        for kind in EvidenceKind::ALL {
            let mut skipping = Grant {
                stage: GrantedStage::Flight,
                evidence: evidence(GrantedStage::Flight),
                ..grant()
            };
            skipping.evidence.retain(|it| it != kind);
            let file = fleet.grant(&skipping).unwrap();
            let read = Grant::load(&file, &fleet.public()).unwrap();
            for stage in [
                GrantedStage::Bench,
                GrantedStage::Tethered,
                GrantedStage::Flight,
            ] {
                let missing = kind;
                let refused = (stage >= kind.stage())
                    .then_some(GrantRefusal::SkipsEvidence { stage, missing });
                assert_eq!(read.is_for(NodeId(1), stage).err(), refused, "{kind}");
            }
        }
    }

    #[test]
    fn a_drone_outside_the_fleet_is_granted_nothing() {
        let (_folder, fleet) = fleet();
        fleet.revoke(&[NodeId(1)]).unwrap();
        for id in [1, 9] {
            let wanted = Grant {
                drone: NodeId(id),
                ..grant()
            };
            fleet.grant(&wanted).unwrap_err();
        }
    }

    #[test]
    fn a_grant_of_another_fleet_is_refused() {
        let (_folder, _fleet, file) = signed();
        let (other, _) = fleet();
        Grant::load(&file, &public(&other)).unwrap_err();
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(1_000))]

        /// Any change of a byte leaves it as it was signed, or refused.
        #[test]
        fn an_altered_grant_is_refused(at in 0_usize..1_000, byte in 32_u8..127) {
            thread_local! {
                static SIGNED: (TempDir, Fleet, PathBuf) = signed();
            }
            SIGNED.with(|(folder, _, file)| {
                let text = fs::read(file).unwrap();
                let mut altered = text.clone();
                let at = at % altered.len();
                altered[at] = byte;
                let other = folder.path().join("altered.grant");
                fs::write(&other, &altered).unwrap();
                if let Ok(read) = Grant::load(&other, &public(folder)) {
                    prop_assert_eq!(read, grant());
                }
                Ok(())
            })?;
        }
    }
}

/// A release with two files.
fn release() -> Manifest {
    let files = [
        ("x86_64/musterd", &b"program"[..]),
        ("units/a.service", b"unit"),
    ];
    Manifest {
        version: "0.2.0".to_owned(),
        wire: vec![1, 2],
        journal: vec![1],
        files: files
            .map(|(path, content)| (path.to_owned(), ReleaseFile::of(content)))
            .into(),
    }
}

#[test]
fn altered_manifest_is_refused() {
    let (_folder, fleet) = fleet();
    let text = fleet.sign_release(&release());
    let parse = |text: String| Manifest::parse(Path::new("manifest.toml"), text, &fleet.public());
    assert_eq!(parse(text.clone()).unwrap(), release());
    // Each byte of the text, changed in its lowest bit, gives another manifest, a refused one, or one that says the same.
    let mut refused = 0;
    for at in 0..text.len() {
        let mut bytes = text.clone().into_bytes();
        bytes[at] ^= 1;
        match String::from_utf8(bytes).map(&parse) {
            Ok(Ok(read)) => assert_eq!(read, release(), "byte {at}"),
            _ => refused += 1,
        }
    }
    assert!(refused > text.len() / 2, "{refused} of {}", text.len());
    let (_other_folder, other) = self::fleet();
    assert!(
        parse(other.sign_release(&release())).is_err(),
        "another fleet's"
    );
}

#[test]
fn manifest_names_no_path_out_of_its_folder() {
    for path in ["x86_64/musterd", "units/musterd@.service", "a"] {
        assert!(is_plain(path), "{path}");
    }
    for path in [
        "",
        "/etc/passwd",
        "../a",
        "a/../b",
        "a//b",
        "a/",
        "a b",
        "-a",
        "a/-b",
        "a\"b",
        "a;b",
        "a/.b",
    ] {
        assert!(!is_plain(path), "{path}");
        let (_folder, fleet) = fleet();
        let mut manifest = release();
        manifest.files.insert(path.to_owned(), ReleaseFile::of(b""));
        let text = fleet.sign_release(&manifest);
        assert!(Manifest::parse(Path::new("manifest.toml"), text, &fleet.public()).is_err());
    }
}
