//! The sockets of a drone's end of a real network, and how they are opened: what UDP and QUIC have in common.

mod open;
mod overflow;

use std::net::{SocketAddr, SocketAddrV4};
use std::sync::Arc;

use bytes::Bytes;
use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;

pub use self::open::OpenError;
pub(crate) use self::open::{apart, open};
pub(crate) use self::overflow::drops;
use crate::SendError;

/// How a drone's end of the network is opened.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Config {
    /// Whose it is.
    pub id: NodeId,
    /// The address and port of its own socket; port 0 for any.
    pub bind: SocketAddr,
    /// How frames for all get to all.
    pub reach: Reach,
    /// The network interface that all goes through, as in `wlan0`; as the system routes it otherwise.
    pub interface: Option<String>,
    /// The largest datagram, in bytes; a longer one that comes in is counted and dropped unread.
    pub datagram_max: usize,
}

impl Config {
    /// Whether a datagram can be sent by this end.
    pub(crate) fn check(&self, from: NodeId, datagram: &Bytes) -> Result<(), SendError> {
        let (len, max) = (datagram.len(), self.datagram_max);
        if from != self.id {
            return Err(SendError::UnknownSender(from));
        }
        if len > max {
            return Err(SendError::TooLong { len, max });
        }
        Ok(())
    }
}

/// How frames for all get to all.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Reach {
    /// To a multicast group.
    Group(SocketAddrV4),
    /// To a network's broadcast address.
    Broadcast(SocketAddrV4),
    /// To each of these.
    Peers(Vec<SocketAddr>),
}

/// What a transport has done so far, in datagrams.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Handed to the system; one for each peer.
    pub sent: u64,
    /// That the system did not take: its buffer was full, or there was no way to go.
    pub unsent: u64,
    /// Taken in.
    pub received: u64,
    /// Dropped unread because they were too long.
    pub too_long: u64,
}

/// Tells what time it is, by the clock of whoever runs the drone.
pub type Clock = Arc<dyn Fn() -> Timestamp + Send + Sync>;
