use std::sync::Arc;

use crate::identity::NodeId;
use crate::wire::AUTHENTICATOR_LEN;

/// Who vouches for a frame's sender.
pub trait Authenticator {
    /// Whether anything that `sender` signs is believed at all; asked before anything costly is done about a frame.
    fn is_trusted(&self, _sender: NodeId) -> bool {
        true
    }

    /// The authenticator of a frame of our own.
    fn sign(&self, covered: &[u8]) -> [u8; AUTHENTICATOR_LEN];

    /// Whether `sender` signed this.
    fn verify(
        &self,
        sender: NodeId,
        covered: &[u8],
        authenticator: &[u8; AUTHENTICATOR_LEN],
    ) -> bool;
}

impl<A: Authenticator + ?Sized> Authenticator for Arc<A> {
    fn is_trusted(&self, sender: NodeId) -> bool {
        (**self).is_trusted(sender)
    }

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
}

/// The authenticator of a simulation: every sender's frames bear the same mark, of the length of a signature, and
/// whoever forges a frame in a simulated medium leaves the mark out.
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
