use std::num::NonZeroU16;

use bytes::Bytes;
use serde::{Deserialize, Serialize};

use super::{Checkpoint, DropReason, Revoked};
use crate::identity::{Ballot, NodeId};
use crate::time::Timestamp;
use crate::traffic::Intent;
#[cfg(doc)]
use crate::wire::PAYLOAD_MAX;

/// Source of a datagram: a transport's name for an address, valid as long as the transport says. Datagrams from the
/// known address of a drone keep the same name while the address is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Source {
    /// The host, or anything else that can send from many ports.
    pub host: NonZeroU16,
    /// Port on that host.
    pub port: u16,
}

/// Input of a radio.
#[derive(Debug, Clone, PartialEq)]
pub enum Input {
    /// From the routing: send a payload.
    Send {
        /// Receiver of a unicast; `None` for a broadcast.
        to: Option<NodeId>,
        /// Ballot of the current leader.
        ballot: Ballot,
        /// At most [`PAYLOAD_MAX`] bytes.
        payload: Vec<u8>,
        /// Whether it is only a periodic frame; for frame counts.
        keep_alive: bool,
    },
    /// From the navigation: the intent for all following frames.
    AnnounceIntent {
        /// The intent; `None` if the path is unknown.
        intent: Option<Intent>,
        /// Whether to send a frame of its own immediately.
        immediately: bool,
    },
    /// From the navigation after a restart: repeat the intents of others.
    ResendTraffic,
    /// From the transport: a received datagram.
    Received {
        /// The bytes.
        datagram: Bytes,
        /// Source; `None` if the transport does not know it.
        source: Option<Source>,
        /// Drone at the other end of an authenticated connection. It may only send its own frames, and their signatures
        /// are not checked.
        peer: Option<NodeId>,
    },
    /// From the transport: delivery of an own unicast frame.
    Delivery {
        /// Receiver.
        to: NodeId,
        /// The frame.
        frame: Bytes,
        /// Whether it arrived, as far as known.
        delivered: bool,
    },
    /// From the operator: a revocation list, in force from now on. An older one than the known one is ignored.
    Revoked(Box<Revoked>),
}

/// Output of a radio.
#[derive(Debug, Clone, PartialEq)]
pub enum Transmit {
    /// To the transport: a frame.
    Send {
        /// Receiver of a unicast; `None` for a broadcast.
        to: Option<NodeId>,
        /// The frame.
        frame: Bytes,
        /// As in [`Input::Send`].
        keep_alive: bool,
    },
    /// To the routing: an admitted frame.
    Received {
        /// Sender.
        sender: NodeId,
        /// Ballot of the sender's leader.
        ballot: Ballot,
        /// Payload.
        payload: Bytes,
    },
    /// To the navigation: intent of another drone.
    Traffic {
        /// The other drone.
        sender: NodeId,
        /// The intent; `None` if it no longer announces one.
        intent: Option<Intent>,
        /// When it was heard.
        heard_at: Timestamp,
    },
    /// To the navigation after a restart: repeat the intent.
    Resync,
    /// To the transport: an admitted frame came from there, so its sender is reachable there.
    Locate {
        /// Sender of the frame.
        sender: NodeId,
        /// Source of the frame.
        source: Source,
    },
    /// To the process: a newer revocation list of a peer is in force. It must be kept for later radios.
    KeepList(Bytes),
    /// To the routing: delivery of a unicast payload.
    Delivery {
        /// Receiver.
        to: NodeId,
        /// Payload.
        payload: Bytes,
        /// Whether it arrived, as far as known.
        delivered: bool,
    },
}

/// Event of a radio.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Event {
    /// A frame was dropped.
    Dropped(DropReason),
    /// An own payload was too long to send.
    Oversized {
        /// Length in bytes.
        len: usize,
    },
    /// Checkpoint for a restart.
    Checkpoint(Checkpoint),
    /// A newer revocation list was received and taken.
    RevocationList {
        /// Number of the list.
        list: u64,
    },
}
