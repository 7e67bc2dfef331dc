//! Who may open QUIC connections: the fleet's drones and its operator.

use std::sync::Arc;

use muster_machines::identity::NodeId;
use muster_machines::radio::Authenticator;
use muster_machines::wire::AUTHENTICATOR_LEN;
use muster_runtime::identity::{Ed25519Authenticator, FleetKey, OperatorKey, RevocationList};
use muster_transport::quic::{Distrust, Identities, Peer, PublicKey};
use tokio::sync::watch;

/// Identities as a drone knows them. Its roster maps keys to drones; the fleet's key is the operator's.
pub(crate) struct DroneIdentities {
    pub(crate) authenticator: Arc<Ed25519Authenticator>,
    pub(crate) fleet: FleetKey,
    /// The list in force.
    pub(crate) revoked: watch::Receiver<RevocationList>,
}

impl Authenticator for DroneIdentities {
    fn sign(&self, covered: &[u8]) -> [u8; AUTHENTICATOR_LEN] {
        self.authenticator.sign(covered)
    }

    fn verify(&self, sender: NodeId, covered: &[u8], it: &[u8; AUTHENTICATOR_LEN]) -> bool {
        self.authenticator.verify(sender, covered, it)
    }
}

impl Identities for DroneIdentities {
    fn public_key(&self) -> PublicKey {
        self.authenticator.public_key()
    }

    fn is_trusted(&self, drone: NodeId) -> bool {
        !self.revoked.borrow().has(drone)
    }

    fn peer(&self, key: &PublicKey) -> Result<Peer, Distrust> {
        if *key == self.fleet.to_bytes() {
            return Ok(Peer::Operator);
        }
        drone(self.authenticator.drone_with_key(key), self)
    }
}

/// Identities as an operator knows them: all drones of the fleet whose keys are not revoked.
pub(crate) struct OperatorIdentities(pub(crate) OperatorKey);

impl Authenticator for OperatorIdentities {
    fn sign(&self, covered: &[u8]) -> [u8; AUTHENTICATOR_LEN] {
        self.0.sign(covered)
    }

    fn verify(&self, sender: NodeId, covered: &[u8], it: &[u8; AUTHENTICATOR_LEN]) -> bool {
        self.0.verify(sender, covered, it)
    }
}

impl Identities for OperatorIdentities {
    fn public_key(&self) -> PublicKey {
        self.0.public_key()
    }

    fn is_trusted(&self, drone: NodeId) -> bool {
        self.0.is_trusted(drone)
    }

    fn peer(&self, key: &PublicKey) -> Result<Peer, Distrust> {
        drone(self.0.drone_with_key(key), self)
    }
}

fn drone(id: Option<NodeId>, trusted: &impl Identities) -> Result<Peer, Distrust> {
    match id {
        None => Err(Distrust::Stranger),
        Some(id) if !trusted.is_trusted(id) => Err(Distrust::Revoked),
        Some(id) => Ok(Peer::Drone(id)),
    }
}
