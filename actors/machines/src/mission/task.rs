//! A swarm on task: each drone's agent decides where it flies.
//!
//! The master lists the drones on task in an order, and repeats it when the list changes. Drones acknowledge it, so a newly
//! elected master learns who is there.
//!
//! A drone may leave the swarm. Its agent then decides until the drone lands; the drone follows no master any more.

use super::{LandingReason, Lead, Mission, Order, State, Transmit};
use crate::identity::{NodeId, NodeSet};

impl Mission {
    /// Whether the drone's agent decides where it flies.
    #[must_use]
    pub fn is_on_task(&self) -> bool {
        matches!(self.durable.state, State::OnTask | State::Independent)
    }

    /// Whether the drone has left the swarm.
    #[must_use]
    pub fn is_independent(&self) -> bool {
        self.durable.state == State::Independent
    }

    /// Drones on task, as far as is known. Empty before the task.
    #[must_use]
    pub const fn drones_on_task(&self) -> &NodeSet {
        &self.drones_on_task
    }

    /// The current leader; `None` before the first. Of a drone that has left the swarm the last one.
    #[must_use]
    pub fn leader(&self) -> Option<NodeId> {
        self.durable.leader.ballot().map(|ballot| ballot.master)
    }

    /// As master: all drones are in their slots.
    pub(super) fn start_task(&mut self) {
        self.enter_task();
        self.publish_drones_on_task();
    }

    /// As newly elected master: leads the drones that were on task. Lost ones are added once they acknowledge that.
    pub(super) fn resume_task(&mut self) {
        if let Some(lead) = &mut self.durable.lead {
            lead.silent = lead.members.difference(&self.drones_on_task);
        }
        self.publish_drones_on_task();
    }

    /// As member: the swarm is on task, and these drones are.
    pub(super) fn execute_task(&mut self, sequence: u32, drones: NodeSet) {
        if !self.is_on_task() {
            if !self.ensure_can_follow() {
                return;
            }
            self.enter_task();
        }
        self.drones_on_task = drones;
        self.drones_on_task.insert(self.config.id);
        self.durable.orders.pending = Some(sequence);
        self.complete_order();
    }

    fn enter_task(&mut self) {
        self.durable.deadlines.limit = None;
        self.durable.orders.pending = None;
        self.enter(State::OnTask);
        self.outbox.transmit(Transmit::TopologyChanges);
    }

    /// As master: publishes the drones on task if they have changed.
    pub(super) fn update_drones_on_task(&mut self) {
        let Some(lead) = self.durable.lead.as_ref().filter(|_| self.is_on_task()) else {
            return;
        };
        if present(lead, self.config.id) != self.drones_on_task {
            self.publish_drones_on_task();
        }
    }

    fn publish_drones_on_task(&mut self) {
        if let Some(lead) = &self.durable.lead {
            self.drones_on_task = present(lead, self.config.id);
            let drones = self.drones_on_task.clone();
            self.issue_order(&Order::Task { drones });
            self.complete_order();
        }
    }

    /// Leaves the swarm. Does nothing unless the drone is on task.
    pub(crate) fn leave(&mut self) {
        if self.durable.state != State::OnTask {
            return;
        }
        self.durable.lead = None;
        self.durable.orders.pending = None;
        self.durable.deadlines.limit = None;
        (self.master_silent, self.master_lands) = (None, false);
        self.enter(State::Independent);
        self.outbox.transmit(Transmit::Leave);
        self.checkpoint();
    }

    /// Ends the drone's task: it lands on the spot.
    pub(crate) fn end_task(&mut self, reason: LandingReason) {
        if self.is_on_task() {
            self.announce_and_descend(reason);
            self.checkpoint();
        }
    }
}

/// The drones on task under a master.
fn present(lead: &Lead, own: NodeId) -> NodeSet {
    let absent = [&lead.silent, &lead.landing, &lead.left_out];
    let mut present = absent
        .into_iter()
        .fold(lead.members.clone(), |left, out| left.difference(out));
    present.insert(own);
    present
}
