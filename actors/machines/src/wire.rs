//! Bytes on the air: frames, the packets that they carry, and orders. All input from outside is checked once, here.
//!
//! A frame consists of
//!
//! | part | bytes |
//! | --- | --- |
//! | version | 1 |
//! | header: swarm, sender, incarnation, counter, ballot (term, rank, master) | 7 postcard varints |
//! | version 2 only: the sender's intent, two positions with 3 coordinates each, then progress and priority | 6 postcard varints and 1 byte |
//! | payload | the rest |
//! | authenticator over all bytes before it | 64 |
//!
//! postcard numbers the variants of an enum by position, so enums on the wire grow at the end only. Golden bytes in the
//! tests check that.
//!
//! This module knows no state machine: machines depend on it, never vice versa.

mod frame;
mod intent;
mod kind;
mod message;
mod order;
mod packet;
mod radio;
mod reader;
mod routing;
mod subtree;
mod tree;
mod writer;

use thiserror::Error;

pub use self::frame::{
    Frame, FrameError, Header, VERSION, VERSION_WITH_INTENT, decode_frame, encode_covered, sender,
};
pub use self::intent::Intent;
pub use self::kind::PacketKind;
pub use self::message::{
    Accepted, Destination, MESSAGE_FRAME_MAX, MESSAGE_HOPS_MAX, MESSAGE_MAX, Message, MessageBody,
    MessageFrame, message_pieces,
};
pub use self::order::{
    HOLD_MAX, Order, PLAN_PART_MAX, Step, TASK_RUNS_MAX, decode_order, encode_order,
};
pub use self::packet::{ETX_UNIT, Flood, Member, Packet, Reception, Tree};
pub use self::radio::{RadioPacket, decode_radio_packet, encode_radio_packet};
pub use self::routing::{
    decode_message, decode_packet, decode_packet_reusing, decode_tree, encode_message,
    encode_packet, encode_tree, is_message, split_tree,
};
pub use self::subtree::EncodedSubtree;
pub use self::tree::{EncodedSet, TreeFrame, TreeHeader};

/// Largest datagram in bytes: an Ethernet frame of 1,500 bytes without the headers of IPv4 and UDP (the ancestor's
/// limit, too).
pub const DATAGRAM_MAX: usize = 1_472;
/// Size of an authenticator in bytes: an Ed25519 signature.
pub const AUTHENTICATOR_LEN: usize = 64;
/// Largest header with its version, in bytes: six varints of 32 bits and one of 64. A frame without room for it carries
/// no intent.
pub const HEADER_MAX: usize = 1 + 6 * 5 + 10;
/// Largest intent, in bytes: six varints of 32 bits and a byte.
pub(crate) const INTENT_MAX: usize = 6 * 5 + 1;
/// Largest payload in bytes that fits any header.
pub const PAYLOAD_MAX: usize = DATAGRAM_MAX - HEADER_MAX - AUTHENTICATOR_LEN;

/// Bytes that are no payload or no order: a peer's fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Error)]
#[error("not a payload of this version")]
pub struct PayloadError;

#[cfg(test)]
mod tests;
