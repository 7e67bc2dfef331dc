//! The sockets of a drone, shared by the UDP and QUIC transports.

mod open;
mod overflow;

use std::net::{SocketAddr, SocketAddrV4};
use std::sync::Arc;

use bytes::Bytes;
use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;

pub use self::open::OpenError;
pub(crate) use self::open::{open, peer_sockets};
pub(crate) use self::overflow::kernel_drops;
use crate::SendError;

/// Configuration of a drone's sockets.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Config {
    /// The drone.
    pub id: NodeId,
    /// Address and port of the own socket; port 0 selects a free one.
    pub bind: SocketAddr,
    /// How broadcasts reach the other drones.
    pub reach: Reach,
    /// Network interface for all traffic, for example `wlan0`; if `None`, the kernel's routes apply.
    pub interface: Option<String>,
    /// Largest datagram, in bytes; a longer incoming one is counted and dropped.
    pub datagram_max: usize,
}

impl Config {
    /// Checks a datagram before it is sent.
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

/// How broadcasts reach the other drones.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Reach {
    /// Through a multicast group.
    Group(SocketAddrV4),
    /// Through the broadcast address of the network.
    Broadcast(SocketAddrV4),
    /// One datagram to each of these addresses.
    Peers(Vec<SocketAddr>),
}

/// Counters of a transport since its start, in datagrams.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Accepted by the kernel; counted once per peer.
    pub sent: u64,
    /// Refused by the kernel: its buffer was full, or there is no route.
    pub unsent: u64,
    /// Received.
    pub received: u64,
    /// Dropped because they exceed the maximum length.
    pub too_long: u64,
}

/// Returns the current time.
pub type Clock = Arc<dyn Fn() -> Timestamp + Send + Sync>;
