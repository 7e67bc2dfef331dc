use std::path::Path;

use ed25519_dalek::{Signature, Signer, SigningKey};
use muster_machines::identity::NodeId;
use muster_machines::radio::Authenticator;
use muster_machines::wire::AUTHENTICATOR_LEN;

use super::key::load_secret;
use super::{FleetKey, RevocationList, Roster};
use crate::diagnostic::BadInput;

/// An operator's credentials: the fleet's secret key and its signed lists.
pub struct OperatorKey {
    key: SigningKey,
    roster: Roster,
    revoked: RevocationList,
}

impl std::fmt::Debug for OperatorKey {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("OperatorKey(..)")
    }
}

impl OperatorKey {
    /// Reads the credentials from a fleet's folder.
    ///
    /// # Errors
    /// If its secret key or a list can't be used.
    pub fn load(folder: &Path) -> Result<Self, BadInput> {
        let key = load_secret(&folder.join("fleet.key"))?;
        let public = FleetKey(key.verifying_key());
        Ok(Self {
            roster: Roster::load(&folder.join("roster.toml"), &public)?,
            revoked: RevocationList::load(&folder.join("revoked.toml"), &public)?,
            key,
        })
    }

    /// The fleet's public key.
    #[must_use]
    pub fn public_key(&self) -> [u8; 32] {
        self.key.verifying_key().to_bytes()
    }

    /// The drone of the fleet with this public key. `None` if there is no such drone.
    #[must_use]
    pub fn drone_with_key(&self, key: &[u8; 32]) -> Option<NodeId> {
        self.roster.drone_with_key(key)
    }

    /// Whether a drone is not revoked.
    #[must_use]
    pub fn is_trusted(&self, drone: NodeId) -> bool {
        !self.revoked.has(drone)
    }
}

impl Authenticator for OperatorKey {
    /// The covered bytes must not begin with the prefix of a roster or a revocation list, which the same key signs.
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
        let key = self.roster.key(sender);
        key.is_some_and(|key| key.verify_strict(covered, &signature).is_ok())
    }
}
