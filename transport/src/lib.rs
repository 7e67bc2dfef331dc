//! How a drone's datagrams move: one trait, and what stands behind it.

pub mod sim;

use bytes::Bytes;
use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;
use thiserror::Error;

/// A way for datagrams between drones.
///
/// Datagrams may be lost, doubled or reordered; none is ever altered or cut short. A transport knows nothing of
/// what they say.
pub trait Transport {
    /// The largest datagram that it takes, in bytes.
    fn datagram_max(&self) -> usize;

    /// Sends one datagram from `from` to whoever can hear it.
    ///
    /// # Errors
    /// When the datagram can't be sent; nothing was sent then.
    fn broadcast(
        &mut self,
        now: Timestamp,
        from: NodeId,
        datagram: &Bytes,
    ) -> Result<(), SendError>;

    /// The next arrival that is known of, in the order in which they became known. One that lies in the future is
    /// for the caller to keep until then; a transport over a real network knows of none before it is there.
    fn poll_arrival(&mut self) -> Option<Arrival>;
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
}

/// Why a datagram was not sent: the caller's fault each.
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
}
