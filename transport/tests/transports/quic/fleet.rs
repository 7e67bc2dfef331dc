//! A fleet for tests: keys, and who trusts whom.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex};

use ed25519_dalek::{Signature, Signer, SigningKey, VerifyingKey};
use muster_machines::identity::NodeId;
use muster_machines::radio::Authenticator;
use muster_transport::quic::{Distrust, Identities, Peer, PublicKey};

/// Drones 0 to 7, their keys, and the revocation list that all of them share.
pub(crate) struct Fleet {
    own: SigningKey,
    keys: BTreeMap<NodeId, SigningKey>,
    pub(crate) revoked: Arc<Mutex<BTreeSet<NodeId>>>,
}

impl Fleet {
    pub(crate) fn new() -> Self {
        Self::of(1)
    }

    /// A numbered fleet. All fleets have drones with the same numbers, but other keys.
    pub(crate) fn of(number: u8) -> Self {
        let key = |id: u8| SigningKey::from_bytes(&[number, id].repeat(16).try_into().unwrap());
        Self {
            own: key(255),
            keys: (0..8).map(|id| (NodeId(id.into()), key(id))).collect(),
            revoked: Arc::default(),
        }
    }

    /// The identities of a drone.
    pub(crate) fn identities(&self, id: u32) -> Arc<dyn Identities> {
        self.with_key(self.keys[&NodeId(id)].clone())
    }

    /// The identities of the fleet's operator.
    pub(crate) fn operator(&self) -> Arc<dyn Identities> {
        self.with_key(self.own.clone())
    }

    /// Identities that trust this fleet, but have a key of another fleet.
    pub(crate) fn with_key_of(&self, other: &Self, id: u32) -> Arc<dyn Identities> {
        self.with_key(other.keys[&NodeId(id)].clone())
    }

    /// Identities that present a drone's public key without its secret key.
    pub(crate) fn with_public_key_only(&self, id: u32) -> Arc<dyn Identities> {
        let mut keys = self.keys(SigningKey::from_bytes(&[99; 32]));
        keys.shown = self.keys[&NodeId(id)].verifying_key();
        Arc::new(keys)
    }

    fn with_key(&self, key: SigningKey) -> Arc<dyn Identities> {
        Arc::new(self.keys(key))
    }

    fn keys(&self, key: SigningKey) -> Keys {
        let public = |(id, key): (&NodeId, &SigningKey)| (*id, key.verifying_key());
        Keys {
            shown: key.verifying_key(),
            key,
            fleet: self.own.verifying_key(),
            roster: self.keys.iter().map(public).collect(),
            revoked: Arc::clone(&self.revoked),
        }
    }
}

struct Keys {
    key: SigningKey,
    shown: VerifyingKey,
    fleet: VerifyingKey,
    roster: BTreeMap<NodeId, VerifyingKey>,
    revoked: Arc<Mutex<BTreeSet<NodeId>>>,
}

impl Authenticator for Keys {
    fn sign(&self, covered: &[u8]) -> [u8; 64] {
        self.key.sign(covered).to_bytes()
    }

    fn verify(&self, sender: NodeId, covered: &[u8], signature: &[u8; 64]) -> bool {
        let signature = Signature::from_bytes(signature);
        let key = self.roster.get(&sender);
        key.is_some_and(|key| key.verify_strict(covered, &signature).is_ok())
    }
}

impl Identities for Keys {
    fn public_key(&self) -> PublicKey {
        self.shown.to_bytes()
    }

    fn is_trusted(&self, drone: NodeId) -> bool {
        !self.revoked.lock().unwrap().contains(&drone)
    }

    fn peer(&self, key: &PublicKey) -> Result<Peer, Distrust> {
        if key == self.fleet.as_bytes() {
            return Ok(Peer::Operator);
        }
        let found = self.roster.iter().find(|(_, it)| it.as_bytes() == key);
        match found {
            None => Err(Distrust::Stranger),
            Some((id, _)) if !self.is_trusted(*id) => Err(Distrust::Revoked),
            Some((id, _)) => Ok(Peer::Drone(*id)),
        }
    }
}
