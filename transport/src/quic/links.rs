//! The connections that a drone has: one with each other drone.

use std::collections::BTreeMap;
use std::net::IpAddr;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use bytes::Bytes;
use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;
use quinn::{Connection, VarInt};
use tokio::sync::mpsc;

use super::identity::Identities;

/// How much later than another a connection may be opened from the other side and still have been opened not knowing of it.
const AT_ONCE: Duration = Duration::from_secs(2);

/// Why connections are closed, for the other end's log.
pub(super) const REPLACED: (VarInt, &[u8]) = (VarInt::from_u32(1), b"replaced");
pub(super) const NOT_TRUSTED: (VarInt, &[u8]) = (VarInt::from_u32(2), b"not trusted");
pub(super) const BUSY: (VarInt, &[u8]) = (VarInt::from_u32(3), b"busy");
pub(super) const OVER: (VarInt, &[u8]) = (VarInt::from_u32(0), b"over");

pub(super) fn close(connection: &Connection, (code, why): (VarInt, &[u8])) {
    connection.close(code, why);
}

/// By whom a connection was opened, and when it was there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Opened {
    pub(super) by: NodeId,
    pub(super) at: Timestamp,
}

impl Opened {
    /// Whether of two connections between the same two drones the newer one stays, which both must see alike. Where each
    /// has opened one, not knowing of the other's, that is the lower number's. Otherwise whoever opens another has lost
    /// the old one, for its process started anew, say.
    fn replaces(&self, old: &Self) -> bool {
        let are_opened_at_once = self.by != old.by && self.at.since(old.at) < AT_ONCE;
        !are_opened_at_once || self.by < old.by
    }
}

/// A connection with another drone.
#[derive(Debug, Clone)]
pub(super) struct Link {
    pub(super) connection: Connection,
    pub(super) opened: Opened,
    /// What is too long for a datagram.
    pub(super) long: mpsc::Sender<Bytes>,
}

impl Link {
    /// Hands a frame to the connection, as a datagram where it fits into one and else on a stream; whether it was taken,
    /// and nothing had to give way to it.
    fn send(&self, frame: &Bytes) -> bool {
        let fits = (self.connection.max_datagram_size()).is_some_and(|max| frame.len() <= max);
        if !fits {
            return self.long.try_send(frame.clone()).is_ok();
        }
        // The oldest of what waits gives way, for the newest counts.
        let has_room = self.connection.datagram_send_buffer_space() >= frame.len();
        self.connection.send_datagram(frame.clone()).is_ok() && has_room
    }
}

/// One connection with each drone that there is one with.
#[derive(Debug, Default)]
pub(super) struct Links(Mutex<BTreeMap<NodeId, Link>>);

impl Links {
    /// Takes in a connection with a drone; it closes the one that there was, or is refused and closed itself.
    pub(super) fn admit(&self, drone: NodeId, link: Link) -> bool {
        let mut links = self.lock();
        let old = links.get(&drone).filter(|old| old.is_open());
        if let Some(old) = old {
            if !link.opened.replaces(&old.opened) {
                close(&link.connection, REPLACED);
                return false;
            }
            close(&old.connection, REPLACED);
        }
        links.insert(drone, link);
        true
    }

    /// A connection has ended.
    pub(super) fn dismiss(&self, drone: NodeId, connection: &Connection) {
        let mut links = self.lock();
        let is_it = |it: &Link| it.connection.stable_id() == connection.stable_id();
        if links.get(&drone).is_some_and(is_it) {
            links.remove(&drone);
        }
    }

    /// The connection with a drone.
    pub(super) fn with(&self, drone: NodeId) -> Option<Connection> {
        let links = self.lock();
        let link = links.get(&drone).filter(|link| link.is_open());
        link.map(|link| link.connection.clone())
    }

    /// Whether there is a connection with a drone at an address, at whichever port.
    pub(super) fn lead_to(&self, address: IpAddr) -> bool {
        let is_there = |link: &Link| link.connection.remote_address().ip() == address;
        self.lock()
            .values()
            .any(|link| is_there(link) && link.is_open())
    }

    /// With how many drones there is a connection.
    pub(super) fn count(&self) -> usize {
        self.lock().values().filter(|link| link.is_open()).count()
    }

    /// Closes the connections with those who are not trusted any more.
    pub(super) fn review(&self, identities: &dyn Identities) {
        let links = self.lock();
        for (_, link) in (links.iter()).filter(|(drone, _)| !identities.is_trusted(**drone)) {
            close(&link.connection, NOT_TRUSTED);
        }
    }

    /// Sends a frame to one drone or, if there is no connection with it or nobody is named, to all; how many connections
    /// took it, and how many did not.
    pub(super) fn send(&self, to: Option<NodeId>, frame: &Bytes) -> (u64, u64) {
        let links = self.lock();
        let one = to
            .and_then(|drone| links.get(&drone))
            .filter(|it| it.is_open());
        if let Some(link) = one {
            let is_sent = u64::from(link.send(frame));
            return (is_sent, 1 - is_sent);
        }
        let (mut sent, mut unsent) = (0, 0);
        for link in links.values() {
            if link.send(frame) {
                sent += 1;
            } else {
                unsent += 1;
            }
        }
        (sent, unsent)
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<NodeId, Link>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Link {
    fn is_open(&self) -> bool {
        self.connection.close_reason().is_none()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn opened(by: u32, at_ms: u64) -> Opened {
        Opened {
            by: NodeId(by),
            at: Timestamp::ZERO + Duration::from_millis(at_ms),
        }
    }

    #[test]
    fn of_two_connections_opened_at_once_both_ends_keep_the_lower_numbers() {
        // Each end may learn of them in another order.
        assert!(opened(1, 30).replaces(&opened(2, 10)));
        assert!(!opened(2, 30).replaces(&opened(1, 10)));
    }

    #[test]
    fn whoever_connects_again_has_lost_the_old_connection() {
        assert!(opened(2, 5_000).replaces(&opened(1, 10)));
        assert!(opened(1, 5_000).replaces(&opened(2, 10)));
        assert!(opened(2, 30).replaces(&opened(2, 10)), "the same side");
    }
}
