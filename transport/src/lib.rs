//! How a drone's datagrams move: one trait, and what stands behind it.

pub mod quic;
pub mod sim;
pub mod sockets;
pub mod udp;

use bytes::Bytes;
use muster_machines::identity::NodeId;
use muster_machines::radio::Source;
use muster_machines::time::Timestamp;
use thiserror::Error;

/// A way for datagrams between drones.
///
/// Datagrams may be lost, doubled or reordered; none is ever altered or cut short. A transport knows nothing of
/// what they say. One value stands for a whole simulated medium, or for one drone's end of a real network.
pub trait Transport {
    /// The largest datagram that it takes, in bytes.
    fn datagram_max(&self) -> usize;

    /// Sends one datagram from `from`: to whoever can hear it, or to one drone. Whether it gets there is told by
    /// what [`Self::poll_event`] hands out, if at all.
    ///
    /// # Errors
    /// When the datagram can't be sent; nothing was sent then.
    fn send(
        &mut self,
        now: Timestamp,
        from: NodeId,
        to: Destination,
        datagram: &Bytes,
    ) -> Result<(), SendError>;

    /// When [`Self::handle_timeout`] is to be called next; nothing when no time is waited for. Ask again after every
    /// call that changes the transport.
    fn next_timeout(&self) -> Option<Timestamp> {
        None
    }

    /// Does whatever was due by `now`; early or repeated calls do nothing.
    fn handle_timeout(&mut self, _now: Timestamp) {}

    /// The next event that is known of, in the order in which they became known. One that lies in the future is for
    /// the caller to keep until then; a transport over a real network knows of none before it is there.
    fn poll_event(&mut self) -> Option<Event>;

    /// Takes in that a drone is to be found where a datagram came from: it has proved that it sent it. A medium that
    /// finds drones by their numbers does nothing.
    fn learn(&mut self, _node: NodeId, _source: Source) {}
}

/// For whom a datagram is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Destination {
    /// For whoever can hear it. Nobody acknowledges it, and nothing is known of what became of it.
    Broadcast,
    /// For one drone. Others may hear it too. Where the medium has acknowledgements of its own, an [`Event::Outcome`]
    /// follows, whatever becomes of it; where it has none, as UDP, nothing is known and nothing follows.
    To(NodeId),
}

/// What came of datagrams.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Event {
    /// A datagram comes in.
    Arrival(Arrival),
    /// What became of a datagram for one drone, as its sender knows.
    Outcome(Outcome),
}

impl Event {
    /// When.
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
    /// When.
    pub at: Timestamp,
    /// At whom.
    pub to: NodeId,
    /// What.
    pub datagram: Bytes,
    /// From where, on a network whose drones have addresses; good for [`Transport::learn`] soon after. What comes from where
    /// a drone was found by that has one name, as long as it is to be found there.
    pub source: Option<Source>,
    /// Which drone has proved to be at the other end of the connection that it came by, where there are connections.
    pub peer: Option<NodeId>,
}

/// What a sender learns of a datagram that it sent to one drone.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Outcome {
    /// When it learns that.
    pub at: Timestamp,
    /// Who sent it.
    pub from: NodeId,
    /// For whom it was.
    pub to: NodeId,
    /// What was sent.
    pub datagram: Bytes,
    /// What became of it.
    pub fate: Fate,
}

/// What became of a datagram for one drone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fate {
    /// It arrived, and the sender knows.
    Delivered,
    /// The sender stopped trying; it may have arrived all the same, where only the acknowledgements were lost.
    GivenUp,
}

/// Why a datagram was not sent: the caller's fault each. What the network does not take is lost, and counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum SendError {
    /// It is larger than the transport takes.
    #[error("a datagram of {len} bytes, where {max} is the most")]
    TooLong {
        /// Its size in bytes.
        len: usize,
        /// The largest that is taken.
        max: usize,
    },
    /// The transport knows no such sender.
    #[error("drone {0} has no place in this medium")]
    UnknownSender(NodeId),
    /// The transport knows no such receiver.
    #[error("drone {0}, for whom it is, has no place in this medium")]
    UnknownReceiver(NodeId),
}
