use std::os::unix::fs::PermissionsExt;
use std::path::Path;

use muster_runtime::identity::{Fleet as Keys, Manifest};
use tempfile::TempDir;

use super::*;

/// A fleet of one host, with keys for its drones.
pub(in crate::rollout) fn bench() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let keys = Keys::create(&folder.path().join("keys")).unwrap();
    for id in 0..5 {
        keys.add_drone(NodeId(id)).unwrap();
    }
    folder
}

/// A release without programs.
pub(in crate::rollout) fn release() -> Release {
    Release {
        manifest: Manifest {
            version: "0.1.0".to_owned(),
            wire: vec![1],
            journal: vec![1],
            files: BTreeMap::new(),
        },
        manifest_text: String::new(),
        files: BTreeMap::new(),
    }
}

pub(in crate::rollout) fn desired_of(
    folder: &TempDir,
    scenario: &str,
) -> Result<Vec<Desired>, BadInput> {
    let path = folder.path().join("fleet.toml");
    let text = format!(
        "group = \"239.77.0.1:4700\"\nscenario = {scenario:?}\nkeys = \"keys\"\n[[hosts]]\ndrones = [0, 1, 2, 3, 4]\n"
    );
    fs::write(&path, text).unwrap();
    desired(&Fleet::load(&path)?, &release())
}

#[test]
fn scenario_needs_a_name_that_a_slot_can_have() {
    let folder = bench();
    desired_of(&folder, "swarm-short").unwrap();
    let [(_, text), (mission, mission_text)] =
        scenario::side_by_side(Path::new("swarm-short"), &[]).unwrap();
    fs::write(folder.path().join("my scenario.toml"), text).unwrap();
    fs::write(folder.path().join(mission), mission_text).unwrap();
    let refused = desired_of(&folder, "my scenario.toml")
        .unwrap_err()
        .rendered();
    assert!(
        refused.contains("can have the name \"my scenario.toml\""),
        "{refused}"
    );
}

#[test]
fn key_that_others_can_read_is_refused() {
    let folder = bench();
    let key = folder.path().join("keys/drone-3.key");
    fs::set_permissions(key, fs::Permissions::from_mode(0o644)).unwrap();
    let refused = desired_of(&folder, "swarm-short").unwrap_err().rendered();
    assert!(refused.contains("can read this secret key"), "{refused}");
}
