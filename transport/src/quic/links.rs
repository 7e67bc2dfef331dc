//! The open connections: at most one with each other drone.

use std::collections::BTreeMap;
use std::net::{IpAddr, SocketAddr};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use bytes::Bytes;
use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;
use quinn::{Connection, VarInt};
use tokio::sync::mpsc;

use super::identity::Identities;

/// Two connections opened by both sides within this time count as simultaneous: neither side knew of the other's.
const SIMULTANEOUS_MAX: Duration = Duration::from_secs(2);

/// Reasons for closing a connection, as sent to the peer.
pub(super) const REPLACED: (VarInt, &[u8]) = (VarInt::from_u32(1), b"replaced");
pub(super) const NOT_TRUSTED: (VarInt, &[u8]) = (VarInt::from_u32(2), b"not trusted");
pub(super) const BUSY: (VarInt, &[u8]) = (VarInt::from_u32(3), b"busy");
pub(super) const OVER: (VarInt, &[u8]) = (VarInt::from_u32(0), b"over");

pub(super) fn close(connection: &Connection, (code, reason): (VarInt, &[u8])) {
    connection.close(code, reason);
}

/// Who opened a connection, and when it was established.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Opened {
    pub(super) by: NodeId,
    pub(super) at: Timestamp,
}

impl Opened {
    /// Whether this newer connection replaces an old one between the same drones. Both ends must decide alike. Of
    /// simultaneous connections, that of the lower number stays. Otherwise the new one stays: its opener has lost the old
    /// one, for example by a restart.
    fn replaces(&self, old: &Self) -> bool {
        let are_simultaneous = self.by != old.by && self.at.since(old.at) < SIMULTANEOUS_MAX;
        !are_simultaneous || self.by < old.by
    }
}

/// A connection with another drone.
#[derive(Debug, Clone)]
pub(super) struct Link {
    pub(super) connection: Connection,
    pub(super) opened: Opened,
    /// Queue of frames that exceed a datagram.
    pub(super) long_frames: mpsc::Sender<Bytes>,
}

impl Link {
    /// Sends a frame as a datagram, or on a stream if it is too long. Returns `false` if it was dropped or displaced an older
    /// frame.
    fn send(&self, frame: &Bytes) -> bool {
        let fits = (self.connection.max_datagram_size()).is_some_and(|max| frame.len() <= max);
        if !fits {
            return self.long_frames.try_send(frame.clone()).is_ok();
        }
        // A full buffer drops its oldest datagrams.
        let has_room = self.connection.datagram_send_buffer_space() >= frame.len();
        self.connection.send_datagram(frame.clone()).is_ok() && has_room
    }
}

/// The connections by drone.
#[derive(Debug, Default)]
pub(super) struct Links(Mutex<BTreeMap<NodeId, Link>>);

impl Links {
    /// Adds a connection with a drone and closes the previous one. Returns `false` if the new one is closed instead.
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

    /// Removes an ended connection, unless another one has replaced it.
    pub(super) fn remove(&self, drone: NodeId, connection: &Connection) {
        let mut links = self.lock();
        let is_current = |it: &Link| it.connection.stable_id() == connection.stable_id();
        if links.get(&drone).is_some_and(is_current) {
            links.remove(&drone);
        }
    }

    /// The open connection with a drone.
    pub(super) fn get(&self, drone: NodeId) -> Option<Connection> {
        let links = self.lock();
        let link = links.get(&drone).filter(|link| link.is_open());
        link.map(|link| link.connection.clone())
    }

    /// The drone with which there is an open connection at an address.
    pub(super) fn drone_at(&self, address: SocketAddr) -> Option<NodeId> {
        let links = self.lock();
        let mut links = links.iter();
        let at = |link: &Link| link.connection.remote_address() == address && link.is_open();
        links.find(|(_, link)| at(link)).map(|(drone, _)| *drone)
    }

    /// Whether there is an open connection with an address, at any port.
    pub(super) fn has_address(&self, address: IpAddr) -> bool {
        let has_address = |link: &Link| link.connection.remote_address().ip() == address;
        self.lock()
            .values()
            .any(|link| has_address(link) && link.is_open())
    }

    /// Number of open connections.
    pub(super) fn count(&self) -> usize {
        self.lock().values().filter(|link| link.is_open()).count()
    }

    /// Closes the connections with drones that are no longer trusted.
    pub(super) fn close_untrusted(&self, identities: &dyn Identities) {
        let links = self.lock();
        for (_, link) in (links.iter()).filter(|(drone, _)| !identities.is_trusted(**drone)) {
            close(&link.connection, NOT_TRUSTED);
        }
    }

    /// Sends a frame to one drone; to all if `to` is `None` or not connected. Returns the numbers of connections that
    /// accepted it and that did not.
    pub(super) fn send(&self, to: Option<NodeId>, frame: &Bytes) -> (u64, u64) {
        let links = self.lock();
        let link = to
            .and_then(|drone| links.get(&drone))
            .filter(|it| it.is_open());
        if let Some(link) = link {
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
    fn of_simultaneous_connections_both_ends_keep_that_of_the_lower_number() {
        // The ends may establish them in different orders.
        assert!(opened(1, 30).replaces(&opened(2, 10)));
        assert!(!opened(2, 30).replaces(&opened(1, 10)));
    }

    #[test]
    fn later_connection_replaces_the_old_one() {
        assert!(opened(2, 5_000).replaces(&opened(1, 10)));
        assert!(opened(1, 5_000).replaces(&opened(2, 10)));
        assert!(opened(2, 30).replaces(&opened(2, 10)), "the same side");
    }
}
