//! What all parts of the world work with.

use std::fmt::Debug;
use std::time::Duration;

use muster_machines::identity::NodeId;
use muster_machines::node::Envelope;
use muster_machines::time::Timestamp;

use super::event::Event;
use super::faults::FaultPlan;
use super::inbox::Inbox;
use super::message::Message;
use super::recorder::Recorder;
use super::swarm::Swarms;
use super::timeline::Timeline;
use super::trace::{Kind, Trace};
use crate::checkers::Checkers;
use crate::scenario::Trigger;

/// The time, the messages, the swarms with their records, the fault plan, the rules and the trace. Each part of the world
/// gets this beside its own state; it knows nothing of them.
#[derive(Debug)]
pub(super) struct Core {
    pub(super) timeline: Timeline,
    pub(super) inbox: Inbox,
    pub(super) swarms: Swarms,
    pub(super) faults: FaultPlan,
    pub(super) checkers: Checkers,
    pub(super) trace: Trace,
}

impl Core {
    pub(super) const fn now(&self) -> Timestamp {
        self.timeline.now()
    }

    pub(super) fn schedule(&mut self, at: Timestamp, event: Event) {
        self.timeline.schedule(at, event);
    }

    pub(super) fn schedule_after(&mut self, delay: Duration, event: Event) {
        self.timeline.schedule_after(delay, event);
    }

    /// Adds an observation to the trace, as it prints.
    pub(super) fn trace(&mut self, drone: NodeId, kind: Kind, value: &impl Debug) {
        self.trace.value(self.timeline.now(), drone, kind, value);
    }

    /// The record of a drone's swarm.
    pub(super) fn recorder(&mut self, drone: NodeId) -> &mut Recorder {
        &mut self.swarms.of_mut(drone).recorder
    }

    /// Sends a message to one of a drone's actors.
    #[inline]
    pub(super) fn post(&mut self, drone: NodeId, envelope: Envelope) {
        let waiting = self.inbox.push(drone, Message::genuine(envelope));
        if self.checkers.are_on() {
            self.checkers.queued(self.timeline.now(), drone, waiting);
        }
    }

    /// Schedules the faults that wait for this trigger. Faults affect the scenario's own swarm only.
    pub(super) fn trigger(&mut self, drone: NodeId, trigger: Trigger) {
        if self.swarms.own().has(drone) {
            self.faults.trigger(trigger, &mut self.timeline);
        }
    }
}
