//! Transports for datagrams between drones: the trait [`Transport`] and its implementations.

pub mod quic;
pub mod sim;
pub mod sockets;
pub mod udp;

use bytes::Bytes;
use muster_machines::identity::NodeId;
use muster_machines::radio::Source;
use muster_machines::time::Timestamp;
use thiserror::Error;

/// Carries datagrams between drones.
///
/// Datagrams may be lost, duplicated or reordered, but are never altered or truncated. A transport does not read their
/// content. One value is a whole simulated medium, or one drone's end of a real network.
pub trait Transport {
    /// Largest accepted datagram, in bytes.
    fn datagram_max(&self) -> usize;

    /// Sends one datagram. Its fate, if known, follows as an event of [`Self::poll_event`].
    ///
    /// # Errors
    /// If the datagram can't be sent; nothing was sent then.
    fn send(
        &mut self,
        now: Timestamp,
        from: NodeId,
        to: Destination,
        datagram: &Bytes,
    ) -> Result<(), SendError>;

    /// Next deadline for [`Self::handle_timeout`]; `None` if there is none. Every call that changes the transport may change
    /// the deadline.
    fn next_timeout(&self) -> Option<Timestamp> {
        None
    }

    /// Handles everything due by `now`; early or repeated calls do nothing.
    fn handle_timeout(&mut self, _now: Timestamp) {}

    /// The next known event. A simulated medium also returns future events; the caller keeps those until their time.
    fn poll_event(&mut self) -> Option<Event>;

    /// Learns the address of a drone from the source of an authenticated datagram. A medium without addresses ignores it.
    fn learn(&mut self, _node: NodeId, _source: Source) {}
}

/// The destination of a datagram.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Destination {
    /// All drones in reach. Never acknowledged.
    Broadcast,
    /// Unicast to one drone; others may overhear it. A medium with acknowledgements reports an [`Event::Outcome`] for each;
    /// UDP and QUIC report none.
    To(NodeId),
}

/// An event of a transport.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Event {
    /// A datagram arrives.
    Arrival(Arrival),
    /// The sender learns the fate of a unicast datagram.
    Outcome(Outcome),
}

impl Event {
    /// Time of the event.
    #[must_use]
    pub const fn at(&self) -> Timestamp {
        match self {
            Self::Arrival(arrival) => arrival.at,
            Self::Outcome(outcome) => outcome.at,
        }
    }
}

/// A datagram that arrives.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Arrival {
    /// Time of arrival.
    pub at: Timestamp,
    /// The receiver.
    pub to: NodeId,
    /// The content.
    pub datagram: Bytes,
    /// The address that it came from, for [`Transport::learn`]; `None` on a medium without addresses. The name of an address
    /// stays the same while a learned drone has that address.
    pub source: Option<Source>,
    /// The authenticated drone at the other end of the connection; `None` without connections.
    pub peer: Option<NodeId>,
}

/// The fate of a unicast datagram, as its sender learns it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Outcome {
    /// When the sender learns it.
    pub at: Timestamp,
    /// The sender.
    pub from: NodeId,
    /// The intended receiver.
    pub to: NodeId,
    /// The content.
    pub datagram: Bytes,
    /// The fate.
    pub fate: Fate,
}

/// The fate of a unicast datagram.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fate {
    /// It arrived and was acknowledged.
    Delivered,
    /// The sender gave up. The datagram may have arrived if only acknowledgements were lost.
    GivenUp,
}

/// Why a datagram was not sent; always an error of the caller. Datagrams that the network refuses are counted instead.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum SendError {
    /// The datagram is too long.
    #[error("datagram of {len} bytes exceeds the maximum of {max}")]
    TooLong {
        /// Its size in bytes.
        len: usize,
        /// Largest accepted size, in bytes.
        max: usize,
    },
    /// The transport does not know the sender.
    #[error("unknown sender: drone {0}")]
    UnknownSender(NodeId),
    /// The transport does not know the receiver.
    #[error("unknown receiver: drone {0}")]
    UnknownReceiver(NodeId),
}
