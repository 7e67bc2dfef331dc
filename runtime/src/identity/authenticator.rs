use std::cmp::Ordering;
use std::sync::{PoisonError, RwLock, RwLockReadGuard};

use bytes::Bytes;
use ed25519_dalek::{Signature, Signer, SigningKey, VerifyingKey};
use muster_machines::identity::NodeId;
use muster_machines::radio::{Authenticator, Offer};
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
    revoked: RwLock<RevocationList>,
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

/// An offered revocation list is older than the known one, which is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("revocation list {offered} is older than the known list {known}")]
pub struct OutdatedList {
    /// Number of the known list.
    pub known: u64,
    /// Number of the offered list.
    pub offered: u64,
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
        revoked: RevocationList,
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
            revoked: RwLock::new(revoked),
        })
    }

    /// Replaces the revocation list by a newer one or the same one.
    ///
    /// # Errors
    /// If the list is older than the known one, which is kept.
    pub fn revoke(&self, list: RevocationList) -> Result<(), OutdatedList> {
        let mut revoked = self.revoked.write().unwrap_or_else(PoisonError::into_inner);
        let (known, offered) = (revoked.number(), list.number());
        if offered < known {
            return Err(OutdatedList { known, offered });
        }
        *revoked = list;
        Ok(())
    }

    /// The known revocation list.
    #[must_use]
    pub fn revoked(&self) -> RevocationList {
        self.read_revocation_list().clone()
    }

    /// Whether this drone itself is revoked.
    #[must_use]
    pub fn is_revoked(&self) -> bool {
        self.read_revocation_list().has(self.id)
    }

    fn read_revocation_list(&self) -> RwLockReadGuard<'_, RevocationList> {
        self.revoked.read().unwrap_or_else(PoisonError::into_inner)
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
    fn is_trusted(&self, sender: NodeId) -> bool {
        !self.read_revocation_list().has(sender)
    }

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

    fn list_number(&self) -> u64 {
        self.read_revocation_list().number()
    }

    fn list(&self) -> Option<Bytes> {
        self.read_revocation_list().to_bytes()
    }

    fn take_list(&self, list: &[u8]) -> Offer {
        let Some(offered) = RevocationList::from_bytes(list, &self.fleet) else {
            return Offer::Unsigned;
        };
        let known = self.list_number();
        match offered.number().cmp(&known) {
            Ordering::Less => Offer::Older,
            Ordering::Equal => Offer::Same,
            Ordering::Greater if self.revoke(offered).is_ok() => Offer::Newer,
            Ordering::Greater => Offer::Older,
        }
    }
}
