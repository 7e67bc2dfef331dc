use bytes::Bytes;

use crate::identity::{NodeId, NodeSet};

/// What radios say to each other; all else that a frame carries is for the routing.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Packet {
    /// A radio that can't know what it has heard before asks others to prove that they say now what they say.
    Challenge {
        /// A number that it has never used before.
        nonce: u64,
        /// Of whom this is asked.
        of: NodeSet,
    },
    /// The proof: those who asked last, and what each had for a nonce.
    Response(Vec<(NodeId, u64)>),
    /// The number of the newest list of the expelled that is known.
    ListNumber(u64),
    /// That list, with the fleet's signature, as the [`Authenticator`](super::Authenticator) has it.
    List(Bytes),
    /// Nothing but what the frame's header says: where the sender is and goes.
    Intent,
}
