//! What both policies share: the leader epoch with its orders, what outlives a restart, and what the protocol is told.

use std::hint::black_box;
use std::time::Duration;

use bytes::Bytes;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Durable, Event, Notice, Transmit};
use crate::identity::{Ballot, NodeId};
use crate::leader::{BallotDecision, LinkSymmetry};
use crate::machine::{Outbox, Output};
use crate::stall::StallDetector;
use crate::time::Timestamp;

/// The part of a routing that is the same by either policy.
///
/// Invariant: orders and acknowledgements are those of the current leader epoch; whatever must outlive a restart is
/// marked as changed in the step that changes it.
#[derive(Debug)]
pub(super) struct Core {
    pub(super) id: NodeId,
    /// How many drones the swarm has; ids run from 0 to one below. Pure relays follow.
    pub(super) drones: u32,
    pub(super) durable: Durable,
    /// Whether something in `durable`, or in what the policy adds to it, has changed in this step.
    has_changed: bool,
    master_silent: bool,
    /// Whether the master says that it is going to land.
    master_lands: bool,
    rng: Box<ChaCha8Rng>,
    stall: StallDetector,
    outbox: Outbox<Transmit, Event>,
}

impl Core {
    pub(super) fn new(id: NodeId, drones: u32, seed: u64) -> Self {
        Self {
            id,
            drones,
            durable: Durable::default(),
            has_changed: false,
            master_silent: false,
            master_lands: false,
            rng: Box::new(ChaCha8Rng::seed_from_u64(seed)),
            stall: StallDetector::default(),
            outbox: Outbox::new(),
        }
    }

    /// Goes on from what outlived the routing before.
    pub(super) fn resume(&mut self, durable: Durable) {
        self.durable = durable;
        let is_master = self.is_master();
        self.durable.heartbeats.skip_reserved(is_master);
        self.inform(Notice::Resync);
        self.keep();
    }

    pub(super) fn is_master(&self) -> bool {
        self.durable.epoch.is_led_by(self.id)
    }

    /// Whether this is a pure relay.
    pub(super) const fn is_relay(&self) -> bool {
        self.id.0 >= self.drones
    }

    /// The current leader, if there is one.
    pub(super) fn master(&self) -> Option<NodeId> {
        self.durable.epoch.ballot().map(|ballot| ballot.master)
    }

    /// The number of the newest order; 0 before the first.
    pub(super) const fn sequence(&self) -> u32 {
        self.durable.epoch.sequence()
    }

    /// Has a checkpoint leave ahead of everything that this step says.
    pub(super) const fn keep(&mut self) {
        self.has_changed = true;
    }

    /// Whether a checkpoint is due; asked once, at the end of a step.
    pub(super) const fn takes_checkpoint(&mut self) -> bool {
        std::mem::replace(&mut self.has_changed, false)
    }

    pub(super) fn put_first(&mut self, event: Event) {
        self.outbox.event_first(event);
    }

    /// Tells the protocol; a pure relay has none.
    pub(super) fn inform(&mut self, notice: Notice) {
        if !self.is_relay() {
            self.outbox.transmit(Transmit::Inform(notice));
        }
    }

    pub(super) fn show(&mut self, event: Event) {
        self.outbox.event(event);
    }

    /// Gives a packet to the radio; nothing before there is a leader.
    pub(super) fn send(&mut self, to: Option<NodeId>, payload: Vec<u8>, keep_alive: bool) {
        if let Some(ballot) = self.durable.epoch.ballot() {
            self.outbox.transmit(Transmit::Send {
                to,
                ballot,
                payload,
                keep_alive,
            });
        }
    }

    /// Takes in under which ballot a frame was sent, over a link that carries `way`.
    pub(super) fn hear_ballot(&mut self, ballot: Ballot, symmetry: LinkSymmetry) -> BallotDecision {
        let decision = self.durable.epoch.hear(ballot, symmetry);
        if decision == BallotDecision::Turned {
            self.begin_epoch();
        }
        decision
    }

    /// The current leader is another one than before: its heartbeats and its landing are not known yet.
    fn begin_epoch(&mut self) {
        self.durable.heartbeats = self.durable.heartbeats.under_another_master();
        self.master_silent = false;
        self.master_lands = false;
        self.keep();
    }

    /// Takes in an order of the current leader; whether it is news.
    pub(super) fn take_order(&mut self, sequence: u32, order: Option<&[u8]>) -> bool {
        let Some(order) = order.filter(|_| sequence > self.sequence()) else {
            return false;
        };
        let order = Bytes::copy_from_slice(order);
        let is_news = self.durable.epoch.hear_order(self.id, sequence, order);
        if is_news {
            if let Some(notice) = self.durable.epoch.newest_order() {
                self.inform(notice);
            }
            self.keep();
        }
        is_news
    }

    /// Takes in, beside order `sequence`, that the master is going to land. A master that takes the swarm down with it
    /// says so in its last order, so only a drone that knows that order can tell.
    pub(super) fn hear_of_landing(&mut self, sequence: u32) {
        let is_known = sequence <= self.sequence();
        if is_known && !self.master_lands && !self.is_master() {
            self.master_lands = true;
            self.inform(Notice::MasterLands);
        }
    }

    /// Whether the master is known to be going to land.
    pub(super) const fn master_lands(&self) -> bool {
        self.master_lands
    }

    /// Whether the master is missed.
    pub(super) const fn misses_master(&self) -> bool {
        self.master_silent
    }

    pub(super) fn miss_master(&mut self) {
        if !self.master_silent {
            self.master_silent = true;
            self.inform(Notice::MasterSilent);
        }
    }

    pub(super) fn find_master(&mut self) {
        if self.master_silent {
            self.master_silent = false;
            self.inform(Notice::MasterReturned);
        }
    }

    /// Marks this drone as going to land.
    pub(super) fn begin_landing(&mut self, now: Timestamp) {
        self.durable.landing.get_or_insert(now);
        self.keep();
    }

    /// Whether this drone has been going to land for `time_to_live`, so that nobody needs it any more.
    pub(super) fn is_settled_to_land(&self, now: Timestamp, time_to_live: Duration) -> bool {
        let landing = self.durable.landing;
        landing.is_some_and(|since| now.since(since) > time_to_live)
    }

    /// Tells the protocol anew who leads, and the newest order.
    pub(super) fn resync(&mut self) {
        for notice in self.durable.epoch.clone().notices() {
            self.inform(notice);
        }
    }

    /// Tells the protocol anew what is wrong with the master.
    pub(super) fn resync_master(&mut self) {
        if self.master_silent {
            self.inform(Notice::MasterSilent);
        }
        if self.master_lands {
            self.inform(Notice::MasterLands);
        }
    }

    /// As [`NodeMachine::read_ahead`](crate::node::NodeMachine::read_ahead) says.
    pub(super) fn read_ahead(&self) {
        black_box((self.id, self.durable.epoch.sequence(), self.durable.stopped));
        black_box((self.durable.heartbeats.master, self.stall));
        black_box((self.has_changed, self.outbox.is_empty()));
    }

    /// A random time below `up_to`.
    pub(super) fn jitter(&mut self, up_to: Duration) -> Duration {
        let nanos = u64::try_from(up_to.as_nanos()).unwrap_or(u64::MAX);
        Duration::from_nanos(self.rng.random_range(0..nanos.max(1)))
    }

    /// Whether the host stood still before this step.
    pub(super) fn has_stalled(&self, now: Timestamp) -> bool {
        self.stall.stalled_for(now).is_some()
    }

    /// The end of a step: when the routing asks to be stepped next.
    pub(super) fn ask(&mut self, now: Timestamp, deadline: Option<Timestamp>) {
        self.stall.ask(now, deadline);
    }

    pub(super) fn poll(&mut self, deadline: Option<Timestamp>) -> Output<Transmit, Event> {
        self.outbox.poll(deadline)
    }
}
