//! What a policy implements, and the machine that runs one.

use std::hint::black_box;

use bytes::Bytes;

use super::messages::{Context, Messages, Neighbourhood, NoRoutes};
use super::{Checkpoint, Event, Input, PolicyCheckpoint, Routes, SharedState, Transmit};
use crate::identity::{Ballot, NodeId, NodeSet};
use crate::leader::{BallotDecision, LinkSymmetry};
use crate::machine::{Machine, Output};
use crate::time::{Timestamp, first_of};
use crate::wire::{self, RadioPacket};

/// How orders and acknowledgements spread.
pub(super) trait Policy: Neighbourhood + std::fmt::Debug {
    /// Handles [`Input::Received`].
    fn receive(
        &mut self,
        shared: &mut SharedState,
        now: Timestamp,
        from: (NodeId, Ballot),
        payload: &Bytes,
    );

    /// Handles [`Input::Delivery`].
    fn record_delivery(
        &mut self,
        _shared: &mut SharedState,
        _now: Timestamp,
        _to: NodeId,
        _payload: &[u8],
        _is_delivered: bool,
    ) {
    }

    /// The current leader has changed.
    fn start_epoch(&mut self, shared: &mut SharedState, now: Timestamp);

    /// This drone leads. [`Self::start_epoch`] was called before if the leader changed.
    fn lead(&mut self, shared: &mut SharedState, now: Timestamp, ballot: Ballot);

    /// This master published a newer order.
    fn order_published(&mut self, shared: &mut SharedState, now: Timestamp);

    /// This drone has carried an order out.
    fn order_carried_out(&mut self, shared: &mut SharedState, now: Timestamp);

    /// Handles [`Input::Discover`].
    fn discover(&mut self, shared: &mut SharedState, now: Timestamp);

    /// Handles [`Input::TopologyChanges`].
    fn topology_changes(&mut self, shared: &mut SharedState, now: Timestamp);

    /// This drone is going to land.
    fn land(&mut self, shared: &mut SharedState, now: Timestamp);

    /// Sends the last frame.
    fn stop(&mut self, shared: &mut SharedState, now: Timestamp);

    /// Repeats this policy's notices to the protocol.
    fn resync(&mut self, shared: &mut SharedState, now: Timestamp);

    /// Restarts all silence timeouts: the host stalled, so the silence of others proves nothing.
    fn reset_timeouts(&mut self, shared: &mut SharedState, now: Timestamp);

    /// Fires every deadline `<= now`.
    fn handle_timeout(&mut self, shared: &mut SharedState, now: Timestamp);

    /// The next deadline; after `now` once [`Self::handle_timeout`] was called at `now`.
    fn deadline(&self, shared: &SharedState) -> Option<Timestamp>;

    /// The part of its state that outlives a restart.
    fn checkpoint(&self) -> PolicyCheckpoint;

    /// Number of entries in the largest table, and that table's limit.
    fn occupancy(&self) -> (usize, usize);

    /// See [`NodeMachine::read_ahead`](crate::node::NodeMachine::read_ahead).
    fn read_ahead(&self) {}

    /// See [`NodeMachine::read_further_ahead`](crate::node::NodeMachine::read_further_ahead).
    fn read_further_ahead(&self, _sender: Option<NodeId>) {}
}

/// Number of presence frames of a drone that has left in a time to live. Two may be lost.
const PRESENCE_FRAMES: u32 = 3;

/// Whether the drone is in the swarm.
#[derive(Debug)]
enum Membership {
    Member,
    /// It leaves. Until then others may still need what it relays.
    Leaving {
        until: Timestamp,
    },
    /// It has left. The policy does nothing any more. Its next presence frame, which the radio adds the intent to, is due.
    Left {
        routes: NoRoutes,
        due: Timestamp,
    },
}

/// A policy with the state that both policies share.
///
/// Invariant: a checkpoint is emitted before all outputs that depend on it.
#[derive(Debug)]
pub(super) struct Dissemination<P> {
    pub(super) shared: SharedState,
    pub(super) policy: P,
    /// `None` until the first message.
    messages: Option<Box<Messages>>,
    membership: Membership,
    /// The next deadline, as of the end of the last step.
    deadline: Option<Timestamp>,
}

impl<P: Policy> Dissemination<P> {
    pub(super) fn new(mut shared: SharedState, policy: impl FnOnce(&mut SharedState) -> P) -> Self {
        let policy = policy(&mut shared);
        Self {
            deadline: policy.deadline(&shared),
            shared,
            policy,
            messages: None,
            membership: Membership::Member,
        }
    }

    const fn has_left(&self) -> bool {
        matches!(self.membership, Membership::Left { .. })
    }

    /// Starts to leave, as if to land: others must not await this drone. One that did so before a restart has left.
    fn leave(&mut self, now: Timestamp) {
        if !matches!(self.membership, Membership::Member) || self.shared.durable.stopped {
            return;
        }
        if self.shared.durable.landing.is_some() {
            self.membership = Membership::Leaving { until: now };
            return self.advance_membership(now);
        }
        self.shared.start_landing(now);
        self.policy.land(&mut self.shared, now);
        let until = now + self.policy.time_to_live();
        self.membership = Membership::Leaving { until };
    }

    /// Leaves once that is due, and shows from then on that the drone is there.
    fn advance_membership(&mut self, now: Timestamp) {
        if self.shared.durable.stopped {
            return;
        }
        match &mut self.membership {
            Membership::Leaving { until } if *until <= now => {
                self.policy.stop(&mut self.shared, now);
                self.shared.report_deaf(NodeSet::new());
                self.shared.emit(Event::Routes(Routes::default()));
                self.shared.emit(Event::Left);
                let routes = NoRoutes::of(&self.policy);
                let due = now + routes.time_to_live() / PRESENCE_FRAMES;
                self.membership = Membership::Left { routes, due };
            }
            Membership::Left { routes, due } if *due <= now => {
                *due = due.next_period(routes.time_to_live() / PRESENCE_FRAMES, now);
                let payload = wire::encode_radio_packet(&RadioPacket::Intent);
                self.shared.send(None, payload, true);
            }
            _ => {}
        }
    }

    /// When the membership or the policy needs the next timeout.
    fn policy_deadline(&self) -> Option<Timestamp> {
        let of_membership = match self.membership {
            Membership::Member => None,
            Membership::Leaving { until } => Some(until),
            Membership::Left { due, .. } => Some(due),
        };
        let of_policy = (!self.has_left()).then(|| self.policy.deadline(&self.shared));
        first_of([
            of_membership.filter(|_| !self.shared.durable.stopped),
            of_policy.flatten(),
        ])
    }

    pub(super) fn occupancy(&self) -> (usize, usize) {
        let of_policy = self.policy.occupancy();
        let Some(messages) = &self.messages else {
            return of_policy;
        };
        let of_messages = messages.occupancy();
        let is_fuller = of_messages.0 * of_policy.1 > of_policy.0 * of_messages.1;
        if is_fuller { of_messages } else { of_policy }
    }

    pub(super) fn read_ahead(&self) {
        black_box(self.deadline);
        self.shared.read_ahead();
        self.policy.read_ahead();
    }

    pub(super) fn read_further_ahead(&self, sender: Option<NodeId>) {
        self.policy.read_further_ahead(sender);
    }

    fn reset_timeouts_if_stalled(&mut self, now: Timestamp) {
        if self.shared.has_stalled(now) {
            self.policy.reset_timeouts(&mut self.shared, now);
        }
    }

    fn lead(&mut self, now: Timestamp, ballot: Ballot) {
        match self.shared.observe_ballot(ballot, LinkSymmetry::Symmetric) {
            // The routing has adopted a better ballot; the notice to the protocol is on its way.
            BallotDecision::Ignored => return,
            BallotDecision::Same => {}
            BallotDecision::Adopted => self.policy.start_epoch(&mut self.shared, now),
        }
        self.policy.lead(&mut self.shared, now, ballot);
    }

    /// The messages, which exist from the first one on, and what they work with.
    fn messages(&mut self, now: Timestamp) -> (&mut Messages, Context<'_>) {
        let shared = &mut self.shared;
        let messages = (self.messages).get_or_insert_with(|| Box::new(Messages::new(shared)));
        let cx = Context {
            shared,
            neighbourhood: match &self.membership {
                Membership::Left { routes, .. } => routes,
                _ => &self.policy,
            },
            now,
        };
        (messages, cx)
    }

    fn receive_message(&mut self, now: Timestamp, sender: NodeId, payload: &Bytes) {
        let Ok(message) = wire::decode_message(payload) else {
            return self.shared.emit(Event::Ignored(sender));
        };
        if !self.shared.durable.stopped {
            let (messages, mut cx) = self.messages(now);
            messages.receive(&mut cx, sender, message);
            messages.run(&mut cx);
        }
    }

    fn record_delivery(&mut self, now: Timestamp, to: NodeId, payload: &[u8], is_delivered: bool) {
        if !wire::is_message(payload) {
            if self.has_left() {
                return;
            }
            let (shared, policy) = (&mut self.shared, &mut self.policy);
            return policy.record_delivery(shared, now, to, payload, is_delivered);
        }
        if self.shared.durable.stopped || self.messages.is_none() {
            return;
        }
        if !self.has_left() {
            (self.policy).record_message(&mut self.shared, now, to, is_delivered);
        }
        let (messages, mut cx) = self.messages(now);
        messages.record_delivery(&mut cx, to, payload, is_delivered);
        messages.run(&mut cx);
    }

    /// At the end of a step: sends the messages that are due, within what the policy, which has sent so many frames, has left
    /// of the budget.
    #[inline(never)]
    fn end_messages(&mut self, now: Timestamp, sent: u32) {
        let (messages, mut cx) = self.messages(now);
        messages.record_sent(now, sent);
        if messages.deadline().is_some_and(|due| due <= now) {
            messages.run(&mut cx);
        }
        self.shared.notify_sent();
    }

    fn stop(&mut self, now: Timestamp) {
        if self.shared.durable.stopped {
            return;
        }
        self.shared.start_landing(now);
        if !self.has_left() {
            self.policy.stop(&mut self.shared, now);
        }
        self.shared.durable.stopped = true;
        if self.messages.is_some() {
            let (messages, mut cx) = self.messages(now);
            messages.stop(&mut cx);
        }
    }

    fn end_step(&mut self, now: Timestamp) {
        let sent = self.shared.take_sent();
        if self.messages.is_some() {
            self.end_messages(now, sent);
        }
        if self.shared.take_changed() {
            self.emit_checkpoint();
        }
        let messages = self.messages.as_ref().and_then(|it| it.deadline());
        self.deadline = first_of([self.policy_deadline(), messages]);
        self.shared.expect_step(now, self.deadline);
    }

    /// Emits a checkpoint before all other outputs of the step.
    #[inline(never)]
    fn emit_checkpoint(&mut self) {
        let checkpoint = Checkpoint {
            common: self.shared.durable.clone(),
            policy: self.policy.checkpoint(),
        };
        (self.shared).emit_first(Event::Checkpoint(Box::new(checkpoint)));
    }
}

impl<P: Policy> Dissemination<P> {
    /// Handles what a drone does as a member of the swarm.
    fn handle_swarm(&mut self, now: Timestamp, input: Input) {
        let (shared, policy) = (&mut self.shared, &mut self.policy);
        match input {
            Input::Received {
                sender,
                ballot,
                payload,
            } => policy.receive(shared, now, (sender, ballot), &payload),
            Input::Lead(ballot) => self.lead(now, ballot),
            Input::Publish {
                ballot,
                sequence,
                order,
            } => {
                let own = shared.id;
                if shared.durable.epoch.publish(own, ballot, sequence, order) {
                    shared.mark_changed();
                    policy.order_published(shared, now);
                }
            }
            Input::Acknowledge { ballot, sequence } => {
                if shared.durable.epoch.acknowledge(ballot, sequence) {
                    shared.mark_changed();
                    policy.order_carried_out(shared, now);
                }
            }
            Input::Discover => policy.discover(shared, now),
            Input::Land => {
                shared.start_landing(now);
                policy.land(shared, now);
            }
            Input::TopologyChanges => policy.topology_changes(shared, now),
            Input::Resync => {
                shared.resync();
                policy.resync(shared, now);
                shared.resync_master();
            }
            // Handled by all drones.
            Input::Delivery { .. } | Input::Leave | Input::Stop | Input::Messages(_) => {}
        }
    }
}

impl<P: Policy> Machine for Dissemination<P> {
    type Input = Input;
    type Transmit = Transmit;
    type Event = Event;

    fn handle_input(&mut self, now: Timestamp, input: Input) {
        self.reset_timeouts_if_stalled(now);
        match input {
            Input::Received {
                sender, payload, ..
            } if wire::is_message(&payload) => self.receive_message(now, sender, &payload),
            Input::Delivery {
                to,
                payload,
                delivered,
            } => self.record_delivery(now, to, &payload, delivered),
            Input::Leave => self.leave(now),
            Input::Stop => self.stop(now),
            Input::Messages(outgoing) => {
                let (messages, mut cx) = self.messages(now);
                for outgoing in outgoing {
                    messages.submit(&mut cx, outgoing);
                }
                messages.run(&mut cx);
            }
            input if !self.has_left() => self.handle_swarm(now, input),
            _ => {}
        }
        self.end_step(now);
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        self.reset_timeouts_if_stalled(now);
        if !self.has_left() {
            self.policy.handle_timeout(&mut self.shared, now);
        }
        self.advance_membership(now);
        self.end_step(now);
    }

    fn poll_output(&mut self) -> Output<Transmit, Event> {
        self.shared.poll(self.deadline)
    }
}
