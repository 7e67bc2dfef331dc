use std::fmt;

use super::radio::{CHALLENGE, INTENT};
use super::{FLOOD, HELLO, HOP_UPDATE, TREE};

/// What a packet is, for whoever counts frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum PacketKind {
    /// A neighbour says hello.
    Hello,
    /// How far it is to the master.
    HopUpdate,
    /// All that policy `flood` repeats.
    Flood,
    /// What policy `tree` says.
    Tree,
    /// What radios say to each other.
    Radio,
    /// None of this version.
    Other,
}

impl PacketKind {
    /// Of a packet, by the first of its bytes; whether the rest is one nobody looks at.
    #[must_use]
    pub const fn of(payload: &[u8]) -> Self {
        match payload {
            [HELLO, ..] => Self::Hello,
            [HOP_UPDATE, ..] => Self::HopUpdate,
            [FLOOD, ..] => Self::Flood,
            [TREE, ..] => Self::Tree,
            [CHALLENGE..=INTENT, ..] => Self::Radio,
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
        })
    }
}
