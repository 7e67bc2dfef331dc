use std::sync::Arc;

use bytes::Bytes;

use crate::identity::NodeId;
use crate::wire::AUTHENTICATOR_LEN;

/// Signs and verifies frames, and knows the revocation list.
pub trait Authenticator {
    /// Whether frames of `sender` are accepted at all; checked before anything costly.
    fn is_trusted(&self, _sender: NodeId) -> bool {
        true
    }

    /// Authenticator of an own frame.
    fn sign(&self, covered: &[u8]) -> [u8; AUTHENTICATOR_LEN];

    /// Whether `sender` signed this.
    fn verify(
        &self,
        sender: NodeId,
        covered: &[u8],
        authenticator: &[u8; AUTHENTICATOR_LEN],
    ) -> bool;

    /// Number of the newest known revocation list, which rises with each list; 0 without lists.
    fn list_number(&self) -> u64 {
        0
    }

    /// That list with the fleet's signature; `None` if there is none or it does not fit a datagram.
    fn list(&self) -> Option<Bytes> {
        None
    }

    /// Takes a list from a peer if the fleet has signed it and it is newer than the known one.
    fn take_list(&self, _list: &[u8]) -> Offer {
        Offer::Unsigned
    }
}

/// Result of a list offered by a peer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Offer {
    /// Not signed by the fleet.
    Unsigned,
    /// Older than the known list.
    Older,
    /// The known list.
    Same,
    /// Newer; it is the known list from now on.
    Newer,
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

    fn list_number(&self) -> u64 {
        (**self).list_number()
    }

    fn list(&self) -> Option<Bytes> {
        (**self).list()
    }

    fn take_list(&self, list: &[u8]) -> Offer {
        (**self).take_list(list)
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
