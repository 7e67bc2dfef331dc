use std::sync::Arc;

use super::Revoked;
use crate::identity::NodeId;
use crate::wire::AUTHENTICATOR_LEN;

/// Signs and verifies frames and revocation lists. It never changes; the list in force is the radio's.
pub trait Authenticator {
    /// Authenticator of an own frame.
    fn sign(&self, covered: &[u8]) -> [u8; AUTHENTICATOR_LEN];

    /// Whether `sender` signed this.
    fn verify(
        &self,
        sender: NodeId,
        covered: &[u8],
        authenticator: &[u8; AUTHENTICATOR_LEN],
    ) -> bool;

    /// Decodes a revocation list from a peer. `None` if the fleet has not signed it.
    fn read_list(&self, _list: &[u8]) -> Option<Revoked> {
        None
    }
}

impl<A: Authenticator + ?Sized> Authenticator for Arc<A> {
    fn sign(&self, covered: &[u8]) -> [u8; AUTHENTICATOR_LEN] {
        (**self).sign(covered)
    }

    fn verify(
        &self,
        sender: NodeId,
        covered: &[u8],
        authenticator: &[u8; AUTHENTICATOR_LEN],
    ) -> bool {
        (**self).verify(sender, covered, authenticator)
    }

    fn read_list(&self, list: &[u8]) -> Option<Revoked> {
        (**self).read_list(list)
    }
}

/// Authenticator of a simulation: all frames have the same mark, as long as a signature. Forged frames in a simulated
/// medium lack it.
#[derive(Debug, Clone, Copy, Default)]
pub struct IdealAuthenticator;

const MARK: [u8; AUTHENTICATOR_LEN] = [0x5a; AUTHENTICATOR_LEN];

impl Authenticator for IdealAuthenticator {
    fn sign(&self, _covered: &[u8]) -> [u8; AUTHENTICATOR_LEN] {
        MARK
    }

    fn verify(&self, _: NodeId, _: &[u8], authenticator: &[u8; AUTHENTICATOR_LEN]) -> bool {
        *authenticator == MARK
    }
}
