//! Rosters and revocation lists, from files and from frames: any bytes are refused, for they are not signed by the fleet's
//! key.

use std::sync::OnceLock;

use crate::{scratch, with_file};
use muster_machines::identity::NodeId;
use muster_machines::radio::Authenticator;
use muster_runtime::identity::{DroneKey, Ed25519Authenticator, FleetKey, RevocationList, Roster};

/// The authenticator of drone 2 of a fleet.
fn drone() -> &'static Ed25519Authenticator {
    static DRONE: OnceLock<Ed25519Authenticator> = OnceLock::new();
    DRONE.get_or_init(|| {
        let fleet = scratch().join("fleet");
        let key = FleetKey::load(&fleet.join("fleet.pub")).expect("the fleet's key");
        let roster = Roster::load(&fleet.join("roster.toml"), &key).expect("the roster");
        let revoked = RevocationList::load(&fleet.join("revoked.toml"), &key).expect("the list");
        let own = DroneKey::load(&fleet.join("drone-2.key")).expect("its key");
        Ed25519Authenticator::new(NodeId(2), own, key, roster, &revoked).expect("they fit")
    })
}

pub(super) fn run(bytes: &[u8]) {
    let fleet = FleetKey::load(&scratch().join("fleet/fleet.pub")).expect("the fleet's key");
    assert_eq!(drone().read_list(bytes), None);
    with_file("list.toml", bytes, |path| {
        let roster = Roster::load(path, &fleet).expect_err("it is not signed");
        let revoked = RevocationList::load(path, &fleet).expect_err("it is not signed");
        assert!(!roster.rendered().is_empty() && !revoked.rendered().is_empty());
        if let Err(error) = FleetKey::load(path) {
            assert!(!error.rendered().is_empty());
        }
    });
}
