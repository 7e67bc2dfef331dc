use ed25519_dalek::{Signature, Signer, SigningKey, VerifyingKey};
use muster_machines::identity::NodeId;
use muster_machines::radio::{Authenticator, Revoked};
use muster_machines::wire::AUTHENTICATOR_LEN;
use thiserror::Error;

use super::{DroneKey, FleetKey, RevocationList, Roster};

/// Signs a drone's frames with its own key, and verifies other drones' frames with their keys from the roster.
///
/// A signature covers a frame from its version byte on, including the swarm's id. Other messages signed with a drone's key
/// (QUIC discovery beacons and handshakes) begin differently, so they can't be replayed as frames.
pub struct Ed25519Authenticator {
    id: NodeId,
    key: SigningKey,
    /// The pinned key that verifies lists.
    fleet: FleetKey,
    roster: Roster,
}

impl std::fmt::Debug for Ed25519Authenticator {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Ed25519Authenticator")
            .field(&self.id)
            .finish()
    }
}

/// A drone's key, roster and revocation list don't fit together: the configuration's fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum IdentityMismatch {
    /// The roster has no such drone.
    #[error("drone {0} is not in the roster")]
    NotListed(NodeId),
    /// The roster has another key for the drone.
    #[error("the roster has another key for drone {0}")]
    OtherKey(NodeId),
    /// The drone's key is revoked.
    #[error("the key of drone {0} is revoked")]
    Revoked(NodeId),
}

impl Ed25519Authenticator {
    /// Creates a drone's authenticator.
    ///
    /// # Errors
    /// If the roster does not have the drone with this key, or the drone is revoked.
    pub fn new(
        id: NodeId,
        key: DroneKey,
        fleet: FleetKey,
        roster: Roster,
        revoked: &RevocationList,
    ) -> Result<Self, IdentityMismatch> {
        let listed = roster.key(id).ok_or(IdentityMismatch::NotListed(id))?;
        if *listed != key.0.verifying_key() {
            return Err(IdentityMismatch::OtherKey(id));
        }
        if revoked.has(id) {
            return Err(IdentityMismatch::Revoked(id));
        }
        Ok(Self {
            id,
            key: key.0,
            fleet,
            roster,
        })
    }

    /// The drone's own public key.
    #[must_use]
    pub fn public_key(&self) -> [u8; 32] {
        self.key.verifying_key().to_bytes()
    }

    /// The drone of the fleet with this public key, revoked or not. `None` if there is no such drone.
    #[must_use]
    pub fn drone_with_key(&self, key: &[u8; 32]) -> Option<NodeId> {
        self.roster.drone_with_key(key)
    }

    fn key(&self, id: NodeId) -> Option<&VerifyingKey> {
        self.roster.key(id)
    }
}

impl Authenticator for Ed25519Authenticator {
    fn sign(&self, covered: &[u8]) -> [u8; AUTHENTICATOR_LEN] {
        self.key.sign(covered).to_bytes()
    }

    fn verify(
        &self,
        sender: NodeId,
        covered: &[u8],
        authenticator: &[u8; AUTHENTICATOR_LEN],
    ) -> bool {
        let signature = Signature::from_bytes(authenticator);
        self.key(sender)
            .is_some_and(|key| key.verify_strict(covered, &signature).is_ok())
    }

    fn read_list(&self, list: &[u8]) -> Option<Revoked> {
        let list = RevocationList::from_bytes(list, &self.fleet)?;
        Some(list.revoked())
    }
}
