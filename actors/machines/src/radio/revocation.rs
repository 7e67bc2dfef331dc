//! Revocation lists, passed on from drone to drone: a radio with a newer list than others sends it.

use std::time::Duration;

use bytes::Bytes;

use crate::identity::{NodeId, NodeSet};
use crate::time::Timestamp;

/// What a revocation list says.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Revoked {
    /// Number of the list, which rises with each one; 0 without lists.
    pub number: u64,
    /// The drones whose frames are dropped.
    pub drones: NodeSet,
    /// The list with the fleet's signature, for other radios; `None` if it does not fit a datagram.
    pub signed: Option<Bytes>,
}

/// Interval of list numbers; shorter as long as a peer has a newer list.
const NUMBER_INTERVAL: Duration = Duration::from_secs(10);
const REQUEST_INTERVAL: Duration = Duration::from_secs(1);

/// Minimum interval between two sendings of the list: for a peer with an older list, and for a revoked sender that
/// still sends.
const LIST_INTERVAL: Duration = Duration::from_secs(1);
const REVOKED_INTERVAL: Duration = Duration::from_secs(10);

/// A message about the own revocation list.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ListMessage {
    /// Its number.
    Number,
    /// The list itself.
    List,
}

/// The list in force, and the schedule of list numbers and lists.
///
/// Invariant: the number of the list in force never falls.
#[derive(Debug)]
pub(super) struct ListGossip {
    in_force: Revoked,
    /// Number of the newest list that was passed on or known at the start.
    passed_on: u64,
    /// Time of the last list number.
    number_sent_at: Option<Timestamp>,
    /// Time when the list was last sent, by this radio or a peer.
    list_sent_at: Option<Timestamp>,
    /// Whether a peer has a newer list.
    is_outdated: bool,
    /// Whether a peer has an older list or is revoked.
    is_list_due: bool,
}

impl ListGossip {
    /// For a radio that starts with list `known`; it sends the number at once.
    pub(super) const fn new(known: Revoked) -> Self {
        Self {
            passed_on: known.number,
            in_force: known,
            number_sent_at: None,
            list_sent_at: None,
            is_outdated: false,
            is_list_due: false,
        }
    }

    /// Whether the list in force names a drone.
    pub(super) fn revokes(&self, drone: NodeId) -> bool {
        self.in_force.drones.contains(drone)
    }

    /// The list in force.
    pub(super) const fn in_force(&self) -> &Revoked {
        &self.in_force
    }

    /// Puts a list in force. An older one changes nothing.
    pub(super) fn replace(&mut self, list: Revoked) {
        if list.number >= self.in_force.number {
            self.in_force = list;
        }
    }

    /// A peer has sent its list number.
    pub(super) const fn update_peer_number(&mut self, theirs: u64) {
        self.is_outdated |= theirs > self.in_force.number;
        self.is_list_due |= theirs < self.in_force.number;
    }

    /// A peer has sent the list that this radio has.
    pub(super) const fn list_received(&mut self, now: Timestamp) {
        self.is_list_due = false;
        self.list_sent_at = Some(now);
    }

    /// A frame of a revoked sender has arrived.
    pub(super) fn revoked_sender_heard(&mut self, now: Timestamp) {
        let next_at = self.list_sent_at.map(|at| at + REVOKED_INTERVAL);
        self.is_list_due |= next_at.is_none_or(|at| at <= now);
    }

    /// Next times of the number and of the list.
    fn times(&self) -> (Timestamp, Option<Timestamp>) {
        let interval = if self.is_outdated {
            REQUEST_INTERVAL
        } else {
            NUMBER_INTERVAL
        };
        let after =
            |at: Option<Timestamp>, interval| at.map_or(Timestamp::ZERO, |at| at + interval);
        let list_at = self
            .is_list_due
            .then(|| after(self.list_sent_at, LIST_INTERVAL));
        (after(self.number_sent_at, interval), list_at)
    }

    pub(super) fn deadline(&self) -> Timestamp {
        let (number_at, list_at) = self.times();
        list_at.map_or(number_at, |at| at.min(number_at))
    }

    /// The message to send now, if any.
    pub(super) fn take_due(&mut self, now: Timestamp) -> Option<ListMessage> {
        let own = self.in_force.number;
        let (number_at, list_at) = self.times();
        if own > self.passed_on || list_at.is_some_and(|at| at <= now) {
            self.passed_on = own;
            self.list_sent_at = Some(now);
            self.is_list_due = false;
            return Some(ListMessage::List);
        }
        (number_at <= now).then(|| {
            self.number_sent_at = Some(now);
            self.is_outdated = false;
            ListMessage::Number
        })
    }
}
