//! State that both policies share: the leader epoch with its orders, the durable state, and the notices to the
//! protocol.

use std::hint::black_box;
use std::time::Duration;

use bytes::Bytes;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Durable, Event, Notice, Outcome, Transmit};
use crate::identity::{Ballot, NodeId, NodeSet};
use crate::leader::{BallotDecision, LinkSymmetry};
use crate::machine::{Outbox, Output};
use crate::stall::StallDetector;
use crate::time::Timestamp;

/// Ballot in messages of a drone that knows no leader.
const NO_BALLOT: Ballot = Ballot {
    term: 0,
    rank: 0,
    master: NodeId(0),
};

/// State of a routing with any policy.
///
/// Invariant: orders and acknowledgements belong to the current leader epoch. A step that changes durable state marks
/// it as changed.
#[derive(Debug)]
pub(super) struct SharedState {
    pub(super) id: NodeId,
    /// Number of drones in the swarm; their ids are 0 to `drones - 1`. Ids of pure relays follow.
    pub(super) drones: u32,
    pub(super) durable: Durable,
    /// Whether durable state, here or in the policy, has changed in this step.
    has_changed: bool,
    master_silent: bool,
    /// Whether the master reports that it is going to land.
    master_lands: bool,
    rng: Box<ChaCha8Rng>,
    stall_detector: StallDetector,
    /// Neighbours that may not hear this drone, as last reported.
    deaf: NodeSet,
    /// Outcomes of messages in this step.
    outcomes: Vec<(u32, Outcome)>,
    outbox: Outbox<Transmit, Event>,
    /// Number of frames sent in this step, without messages.
    sent: u32,
}

impl SharedState {
    pub(super) fn new(id: NodeId, drones: u32, seed: u64) -> Self {
        Self {
            id,
            drones,
            durable: Durable::default(),
            has_changed: false,
            master_silent: false,
            master_lands: false,
            rng: Box::new(ChaCha8Rng::seed_from_u64(seed)),
            stall_detector: StallDetector::default(),
            deaf: NodeSet::new(),
            outcomes: Vec::new(),
            outbox: Outbox::new(),
            sent: 0,
        }
    }

    /// Resumes from the durable state before the restart.
    pub(super) fn resume(&mut self, durable: Durable) {
        self.durable = durable;
        let is_master = self.is_master();
        self.durable.heartbeats.skip_reserved(is_master);
        self.notify(Notice::Resync);
        self.inform_of_deaf();
        self.mark_changed();
    }

    pub(super) fn is_master(&self) -> bool {
        self.durable.epoch.is_led_by(self.id)
    }

    /// Whether this node is a pure relay.
    pub(super) const fn is_relay(&self) -> bool {
        self.id.0 >= self.drones
    }

    /// The current leader; `None` before the first.
    pub(super) fn master(&self) -> Option<NodeId> {
        self.durable.epoch.ballot().map(|ballot| ballot.master)
    }

    /// Number of the newest order; 0 before the first.
    pub(super) const fn sequence(&self) -> u32 {
        self.durable.epoch.sequence()
    }

    /// Requests a checkpoint, which leaves before all other outputs of this step.
    pub(super) const fn mark_changed(&mut self) {
        self.has_changed = true;
    }

    /// Whether a checkpoint is due. Call once, at the end of a step.
    pub(super) const fn take_changed(&mut self) -> bool {
        std::mem::replace(&mut self.has_changed, false)
    }

    pub(super) fn emit_first(&mut self, event: Event) {
        self.outbox.event_first(event);
    }

    /// Sends a notice to the protocol. A pure relay has no protocol.
    pub(super) fn notify(&mut self, notice: Notice) {
        if !self.is_relay() {
            self.outbox.transmit(Transmit::Inform(notice));
        }
    }

    /// Neighbours that may not hear this drone, as last reported.
    pub(super) const fn deaf(&self) -> &NodeSet {
        &self.deaf
    }

    /// Records whether a neighbour hears this drone, and reports a change.
    pub(super) fn record_hearing(&mut self, id: NodeId, hears_own: bool) {
        if hears_own != self.deaf.contains(id) {
            return;
        }
        let mut deaf = self.deaf.clone();
        if hears_own {
            deaf = deaf.difference(&id.into());
        } else {
            deaf.insert(id);
        }
        self.report_deaf(deaf);
    }

    /// Reports the neighbours that may not hear this drone.
    pub(super) fn report_deaf(&mut self, deaf: NodeSet) {
        let is_known = deaf.is_empty() && self.deaf.is_empty();
        self.deaf = deaf;
        if !is_known {
            self.inform_of_deaf();
        }
    }

    /// A pure relay has no navigation.
    fn inform_of_deaf(&mut self) {
        if !self.is_relay() {
            self.outbox.transmit(Transmit::Deaf(self.deaf.clone()));
        }
    }

    /// Reports what became of a message, at the end of the step.
    pub(super) fn report_sent(&mut self, id: u32, outcome: Outcome) {
        self.outcomes.push((id, outcome));
    }

    /// At the end of a step: tells the protocol what became of its messages. One notice, for the protocol's queue is bounded.
    pub(super) fn notify_sent(&mut self) {
        if !self.outcomes.is_empty() {
            let outcomes = std::mem::take(&mut self.outcomes);
            self.notify(Notice::Sent(outcomes));
        }
    }

    pub(super) fn emit(&mut self, event: Event) {
        self.outbox.event(event);
    }

    /// Sends a packet to the radio. Does nothing before there is a leader.
    pub(super) fn send(&mut self, to: Option<NodeId>, payload: Vec<u8>, keep_alive: bool) {
        if let Some(ballot) = self.durable.epoch.ballot() {
            self.sent += 1;
            self.outbox.transmit(Transmit::Send {
                to,
                ballot,
                payload,
                keep_alive,
            });
        }
    }

    /// Sends a packet of the messages, also before there is a leader: no one adopts its ballot.
    pub(super) fn send_message(&mut self, to: Option<NodeId>, payload: Vec<u8>) {
        self.outbox.transmit(Transmit::Send {
            to,
            ballot: self.durable.epoch.ballot().unwrap_or(NO_BALLOT),
            payload,
            keep_alive: false,
        });
    }

    /// Number of frames sent since the last call, without messages.
    pub(super) const fn take_sent(&mut self) -> u32 {
        std::mem::replace(&mut self.sent, 0)
    }

    /// A random number.
    pub(super) fn draw(&mut self) -> u32 {
        self.rng.random()
    }

    /// Observes the ballot of a received frame, or of this drone's own protocol.
    pub(super) fn observe_ballot(
        &mut self,
        ballot: Ballot,
        symmetry: LinkSymmetry,
    ) -> BallotDecision {
        let decision = self.durable.epoch.observe(ballot, symmetry);
        if decision == BallotDecision::Adopted {
            self.start_epoch();
        }
        decision
    }

    /// Forgets the heartbeats and the landing of the leader before.
    fn start_epoch(&mut self) {
        self.durable.heartbeats = self.durable.heartbeats.for_new_master();
        self.master_silent = false;
        self.master_lands = false;
        self.mark_changed();
    }

    /// Accepts an order of the current leader; returns whether it is new.
    pub(super) fn accept_order(&mut self, sequence: u32, order: Option<&[u8]>) -> bool {
        let Some(order) = order.filter(|_| sequence > self.sequence()) else {
            return false;
        };
        let order = Bytes::copy_from_slice(order);
        let is_new = self.durable.epoch.receive_order(self.id, sequence, order);
        if is_new {
            if let Some(notice) = self.durable.epoch.newest_order() {
                self.notify(notice);
            }
            self.mark_changed();
        }
        is_new
    }

    /// Records that the master is going to land, as reported together with order `sequence`. A master that takes the
    /// swarm down with it says so in its last order, so the report counts only if this drone knows that order.
    pub(super) fn record_master_landing(&mut self, sequence: u32) {
        let is_known = sequence <= self.sequence();
        if is_known && !self.master_lands && !self.is_master() {
            self.master_lands = true;
            self.notify(Notice::MasterLands);
        }
    }

    /// Whether the master is known to be going to land.
    pub(super) const fn master_lands(&self) -> bool {
        self.master_lands
    }

    /// Whether the protocol was notified that the master is silent.
    pub(super) const fn is_master_silent(&self) -> bool {
        self.master_silent
    }

    pub(super) fn report_master_silent(&mut self) {
        if !self.master_silent {
            self.master_silent = true;
            self.notify(Notice::MasterSilent);
        }
    }

    pub(super) fn report_master_returned(&mut self) {
        if self.master_silent {
            self.master_silent = false;
            self.notify(Notice::MasterReturned);
        }
    }

    /// Marks this drone as going to land.
    pub(super) fn start_landing(&mut self, now: Timestamp) {
        self.durable.landing.get_or_insert(now);
        self.mark_changed();
    }

    /// Whether this drone has been going to land for `time_to_live`, so that others no longer depend on it.
    pub(super) fn is_settled_to_land(&self, now: Timestamp, time_to_live: Duration) -> bool {
        let landing = self.durable.landing;
        landing.is_some_and(|since| now.since(since) > time_to_live)
    }

    /// Repeats the notices of the leader and the newest order.
    pub(super) fn resync(&mut self) {
        for notice in self.durable.epoch.clone().notices() {
            self.notify(notice);
        }
    }

    /// Repeats the notices of a silent or landing master.
    pub(super) fn resync_master(&mut self) {
        if self.master_silent {
            self.notify(Notice::MasterSilent);
        }
        if self.master_lands {
            self.notify(Notice::MasterLands);
        }
    }

    /// See [`NodeMachine::read_ahead`](crate::node::NodeMachine::read_ahead).
    pub(super) fn read_ahead(&self) {
        black_box((self.id, self.durable.epoch.sequence(), self.durable.stopped));
        black_box((self.durable.heartbeats.master, self.stall_detector));
        black_box((self.has_changed, self.outbox.is_empty()));
    }

    /// A random duration below `up_to`.
    pub(super) fn jitter(&mut self, up_to: Duration) -> Duration {
        let nanos = u64::try_from(up_to.as_nanos()).unwrap_or(u64::MAX);
        Duration::from_nanos(self.rng.random_range(0..nanos.max(1)))
    }

    /// Whether the host stalled before this step.
    pub(super) fn has_stalled(&self, now: Timestamp) -> bool {
        self.stall_detector.stalled_for(now).is_some()
    }

    /// At the end of a step: remembers the deadline to detect stalls.
    pub(super) fn expect_step(&mut self, now: Timestamp, deadline: Option<Timestamp>) {
        self.stall_detector.expect_step(now, deadline);
    }

    pub(super) fn poll(&mut self, deadline: Option<Timestamp>) -> Output<Transmit, Event> {
        self.outbox.poll(deadline)
    }
}
