use std::sync::Arc;

use bytes::Bytes;

use crate::identity::NodeId;
use crate::wire::AUTHENTICATOR_LEN;

/// Who vouches for a frame's sender, and knows who was expelled.
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

    /// The number of the newest list of the expelled that is known, which rises with each list; 0 where there are none.
    fn list_number(&self) -> u64 {
        0
    }

    /// That list with the fleet's signature, as it is passed on; nothing where there is none, or it does not fit a datagram.
    fn list(&self) -> Option<Bytes> {
        None
    }

    /// Takes in what a peer passed on for a list, if the fleet has signed it and it is newer than the one that is known.
    fn take_list(&self, _list: &[u8]) -> Offer {
        Offer::Unsigned
    }
}

/// What a list is that a peer has passed on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Offer {
    /// None that the fleet has signed.
    Unsigned,
    /// Older than the one that is known.
    Older,
    /// The one that is known.
    Same,
    /// Newer; from now on it is the one that is known.
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
