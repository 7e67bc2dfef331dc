//! A master's members: their progress, and which are missed.

use std::collections::BTreeMap;
use std::time::Duration;

use super::link_table::LinkTable;
use crate::identity::{NodeId, NodeSet};
use crate::routing::shared::SharedState;
use crate::routing::{Event, Notice};
use crate::time::Timestamp;

/// Members that are alive or missed, and what the protocol was notified of.
///
/// Invariant: no member is both alive and missed. The reported acknowledgements belong to one order.
#[derive(Debug, Default)]
pub(super) struct Members {
    /// Members that were alive at the last update.
    alive: NodeSet,
    /// Other members that are known or expected.
    missed: BTreeMap<NodeId, Missed>,
    /// Acknowledgements that the protocol was notified of, with the number of their order.
    reported: (u32, NodeSet),
    reported_landing: NodeSet,
}

/// A member without a route to the master.
#[derive(Debug, Clone, Copy)]
struct Missed {
    since: Timestamp,
    reported: bool,
}

impl Missed {
    const fn from(now: Timestamp) -> Self {
        Self {
            since: now,
            reported: false,
        }
    }
}

impl Members {
    /// Starts the time to live of all other drones, including unknown ones.
    pub(super) fn expect_all(&mut self, shared: &SharedState, now: Timestamp) {
        let others = (0..shared.drones).map(NodeId).filter(|id| *id != shared.id);
        self.expect(others, now);
    }

    fn expect(&mut self, ids: impl Iterator<Item = NodeId>, now: Timestamp) {
        for id in ids.filter(|id| !self.alive.contains(*id)) {
            self.missed.entry(id).or_insert(Missed::from(now));
        }
    }

    /// Updates which members are alive; returns those that were reported silent, and those that were unknown.
    fn update_alive(&mut self, alive: &NodeSet, now: Timestamp) -> (NodeSet, NodeSet) {
        let (mut returned, mut new) = (NodeSet::default(), NodeSet::default());
        if *alive != self.alive {
            for id in alive.difference(&self.alive).iter() {
                match self.missed.remove(&id) {
                    Some(missed) if missed.reported => returned.insert(id),
                    Some(_) => {}
                    None => new.insert(id),
                }
            }
            for id in self.alive.difference(alive).iter() {
                self.missed.insert(id, Missed::from(now));
            }
            self.alive.clone_from(alive);
        }
        (returned, new)
    }

    /// Marks members that have been missed for `time_to_live`; returns those that were not marked before.
    fn take_newly_silent(&mut self, now: Timestamp, time_to_live: Duration) -> NodeSet {
        let silent = self.missed.iter_mut().filter_map(|(id, missed)| {
            let falls_silent = !missed.reported && now.since(missed.since) > time_to_live;
            missed.reported |= falls_silent;
            falls_silent.then_some(*id)
        });
        silent.collect()
    }

    pub(super) fn silent(&self) -> NodeSet {
        let silent = self.missed.iter().filter(|(_, missed)| missed.reported);
        silent.map(|(id, _)| *id).collect()
    }

    /// Restarts the silence timeout of all missed members.
    pub(super) fn reset_timeouts(&mut self, now: Timestamp) {
        for missed in self.missed.values_mut() {
            missed.since = now;
        }
    }

    /// Notifies the protocol of what the members' reports changed.
    pub(super) fn report(
        &mut self,
        shared: &mut SharedState,
        links: &LinkTable,
        (now, time_to_live): (Timestamp, Duration),
    ) {
        let sequence = shared.sequence();
        if self.reported.0 != sequence {
            self.reported = (sequence, NodeSet::default());
        }
        let subtree = links.subtree(sequence);
        let acknowledged = subtree.acknowledged.difference(&self.reported.1);
        let landing = subtree.landing.difference(&self.reported_landing);
        if !acknowledged.is_empty() || !landing.is_empty() {
            self.reported.1.extend_from(&acknowledged);
            self.reported_landing.extend_from(&landing);
            shared.notify(Notice::Progress {
                sequence,
                acknowledged,
                landing,
            });
        }
        let (returned, new) = self.update_alive(&subtree.alive, now);
        if !returned.is_empty() {
            shared.notify(Notice::Returned(returned));
        }
        for member in new.iter() {
            emit_reached(shared, links, member);
        }
        let silent = self.take_newly_silent(now, time_to_live);
        if !silent.is_empty() {
            shared.notify(Notice::Silent(silent));
        }
    }

    /// Forgets what the protocol was notified of, after its restart.
    pub(super) fn forget_reported(&mut self) {
        self.reported = (0, NodeSet::default());
        self.reported_landing = NodeSet::default();
    }
}

/// Emits the path over which the master hears of a member.
fn emit_reached(shared: &mut SharedState, links: &LinkTable, member: NodeId) {
    let mut children = links.children();
    let via = children.find(|link| link.sets().alive.contains(member));
    if let Some(via) = via.map(|link| link.id) {
        shared.emit(Event::Reached {
            member,
            via,
            out_of_range: links.get(member).is_none(),
        });
    }
}
