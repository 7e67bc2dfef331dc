use std::fmt;

use super::message::MESSAGE;
use super::radio::{CHALLENGE, INTENT};
use super::routing::{FLOOD, HELLO, HOP_UPDATE, TREE};

/// Kind of a packet, for statistics.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum PacketKind {
    /// Neighbour discovery.
    Hello,
    /// Hop update.
    HopUpdate,
    /// State of policy `flood`.
    Flood,
    /// State of policy `tree`.
    Tree,
    /// A packet between radios.
    Radio,
    /// Unknown in this version.
    Other,
    /// Messages between drones.
    Message,
}

impl PacketKind {
    /// The kind of a packet by its first byte; the rest is not checked.
    #[must_use]
    pub const fn of(payload: &[u8]) -> Self {
        match payload {
            [HELLO, ..] => Self::Hello,
            [HOP_UPDATE, ..] => Self::HopUpdate,
            [FLOOD, ..] => Self::Flood,
            [TREE, ..] => Self::Tree,
            [CHALLENGE..=INTENT, ..] => Self::Radio,
            [MESSAGE, ..] => Self::Message,
            _ => Self::Other,
        }
    }
}

impl fmt::Display for PacketKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Hello => "hello",
            Self::HopUpdate => "hop_update",
            Self::Flood => "flood",
            Self::Tree => "tree",
            Self::Radio => "radio",
            Self::Other => "other",
            Self::Message => "message",
        })
    }
}
