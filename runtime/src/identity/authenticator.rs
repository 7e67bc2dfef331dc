use std::cmp::Ordering;
use std::sync::{PoisonError, RwLock, RwLockReadGuard};

use bytes::Bytes;
use ed25519_dalek::{Signature, Signer, SigningKey, VerifyingKey};
use muster_machines::identity::NodeId;
use muster_machines::radio::{Authenticator, Offer};
use muster_machines::wire::AUTHENTICATOR_LEN;
use thiserror::Error;

use super::{DroneKey, FleetKey, RevocationList, Roster};

/// Signs a drone's frames with its own key and checks those of others by the roster: no drone speaks for another.
///
/// A signature covers a frame from its version on, with the swarm that it is for. What else a drone's key signs, beacons and
/// handshakes of QUIC, begins otherwise, so nothing else can pass for a frame.
pub struct Ed25519Authenticator {
    id: NodeId,
    key: SigningKey,
    /// What it has signed is believed.
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

/// Why a drone can't speak for itself: what it was given does not fit together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum Untrusted {
    /// The roster does not name it.
    #[error("drone {0} is not in the roster")]
    NotListed(NodeId),
    /// The roster has another key for it.
    #[error("the roster has another key for drone {0}")]
    OtherKey(NodeId),
    /// It is on the list of the revoked.
    #[error("drone {0} was revoked from the fleet")]
    Revoked(NodeId),
}

/// A list of the expelled is older than the one that is known, and was not taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("list {offered} of the revoked is older than list {known}")]
pub struct OlderList {
    /// The number of the list that is known.
    pub known: u64,
    /// The number of the one that was offered.
    pub offered: u64,
}

impl Ed25519Authenticator {
    /// What a drone of a fleet signs and checks with.
    ///
    /// # Errors
    /// When the roster does not name the drone with this very key, or it was expelled.
    pub fn new(
        id: NodeId,
        key: DroneKey,
        fleet: FleetKey,
        roster: Roster,
        revoked: RevocationList,
    ) -> Result<Self, Untrusted> {
        let listed = roster.key(id).ok_or(Untrusted::NotListed(id))?;
        if *listed != key.0.verifying_key() {
            return Err(Untrusted::OtherKey(id));
        }
        if revoked.has(id) {
            return Err(Untrusted::Revoked(id));
        }
        Ok(Self {
            id,
            key: key.0,
            fleet,
            roster,
            revoked: RwLock::new(revoked),
        })
    }

    /// Takes a newer list of the expelled, or the same again.
    ///
    /// # Errors
    /// When it is older than the one that is known, which stays.
    pub fn revoke(&self, list: RevocationList) -> Result<(), OlderList> {
        let mut revoked = self.revoked.write().unwrap_or_else(PoisonError::into_inner);
        let (known, offered) = (revoked.number(), list.number());
        if offered < known {
            return Err(OlderList { known, offered });
        }
        *revoked = list;
        Ok(())
    }

    /// The list of the expelled that is known.
    #[must_use]
    pub fn revoked(&self) -> RevocationList {
        self.read_revocation_list().clone()
    }

    /// Whether this very drone was expelled.
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

    /// The drone of the fleet that has a public key, expelled or not.
    #[must_use]
    pub fn whose(&self, key: &[u8; 32]) -> Option<NodeId> {
        self.roster.whose(key)
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
