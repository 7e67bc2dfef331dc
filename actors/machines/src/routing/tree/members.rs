//! What a master knows of its members: how far they have got, and who is missed.

use std::collections::BTreeMap;
use std::time::Duration;

use super::link_table::LinkTable;
use crate::identity::{NodeId, NodeSet};
use crate::routing::core::Core;
use crate::routing::{Event, Notice};
use crate::time::Timestamp;

/// Who is alive, who is missed, and what the protocol was told of them.
///
/// Invariant: nobody is both alive and missed; what the protocol was told of acknowledgements is of one order.
#[derive(Debug, Default)]
pub(super) struct Members {
    /// Who was alive when last looked.
    alive: NodeSet,
    /// The others that are known of or expected.
    missed: BTreeMap<NodeId, Missed>,
    /// Whose acknowledgements the protocol has been told of, and of which order.
    told: (u32, NodeSet),
    told_landing: NodeSet,
}

/// Since when a member has been missed.
#[derive(Debug, Clone, Copy)]
struct Missed {
    since: Timestamp,
    told: bool,
}

impl Missed {
    const fn from(now: Timestamp) -> Self {
        Self {
            since: now,
            told: false,
        }
    }
}

impl Members {
    /// Gives every other drone its time to live, heard of or not.
    pub(super) fn expect_all(&mut self, core: &Core, now: Timestamp) {
        let others = (0..core.drones).map(NodeId).filter(|id| *id != core.id);
        self.expect(others, now);
    }

    fn expect(&mut self, ids: impl Iterator<Item = NodeId>, now: Timestamp) {
        for id in ids.filter(|id| !self.alive.contains(*id)) {
            self.missed.entry(id).or_insert(Missed::from(now));
        }
    }

    /// Takes in who is alive now: who had been silent and is back, and who was neither known of nor expected.
    fn look(&mut self, alive: &NodeSet, now: Timestamp) -> (NodeSet, NodeSet) {
        let (mut back, mut new) = (NodeSet::default(), NodeSet::default());
        if *alive != self.alive {
            for id in alive.difference(&self.alive).iter() {
                match self.missed.remove(&id) {
                    Some(missed) if missed.told => back.insert(id),
                    Some(_) => {}
                    None => new.insert(id),
                }
            }
            for id in self.alive.difference(alive).iter() {
                self.missed.insert(id, Missed::from(now));
            }
            self.alive.clone_from(alive);
        }
        (back, new)
    }

    /// Marks and returns those that have been missed for `time_to_live`, each once.
    fn fall_silent(&mut self, now: Timestamp, time_to_live: Duration) -> NodeSet {
        let silent = self.missed.iter_mut().filter_map(|(id, missed)| {
            let falls_silent = !missed.told && now.since(missed.since) > time_to_live;
            missed.told |= falls_silent;
            falls_silent.then_some(*id)
        });
        silent.collect()
    }

    pub(super) fn silent(&self) -> NodeSet {
        let silent = self.missed.iter().filter(|(_, missed)| missed.told);
        silent.map(|(id, _)| *id).collect()
    }

    /// Nobody was heard, through no fault of theirs.
    pub(super) fn forgive(&mut self, now: Timestamp) {
        for missed in self.missed.values_mut() {
            missed.since = now;
        }
    }

    /// Tells the protocol what the members' reports have changed.
    pub(super) fn report(
        &mut self,
        core: &mut Core,
        links: &LinkTable,
        (now, time_to_live): (Timestamp, Duration),
    ) {
        let sequence = core.sequence();
        if self.told.0 != sequence {
            self.told = (sequence, NodeSet::default());
        }
        let below = links.below(sequence);
        let acknowledged = below.acknowledged.difference(&self.told.1);
        let landing = below.landing.difference(&self.told_landing);
        if !acknowledged.is_empty() || !landing.is_empty() {
            self.told.1.extend_from(&acknowledged);
            self.told_landing.extend_from(&landing);
            core.inform(Notice::Progress {
                sequence,
                acknowledged,
                landing,
            });
        }
        let (back, new) = self.look(&below.alive, now);
        if !back.is_empty() {
            core.inform(Notice::Returned(back));
        }
        for member in new.iter() {
            show_reached(core, links, member);
        }
        let silent = self.fall_silent(now, time_to_live);
        if !silent.is_empty() {
            core.inform(Notice::Silent(silent));
        }
    }

    /// The protocol restarted: it has been told nothing.
    pub(super) fn forget_told(&mut self) {
        self.told = (0, NodeSet::default());
        self.told_landing = NodeSet::default();
    }
}

/// Lets it be seen through whom the master hears of a member.
fn show_reached(core: &mut Core, links: &LinkTable, member: NodeId) {
    let mut children = links.children();
    let via = children.find(|link| link.sets().alive.contains(member));
    if let Some(via) = via.map(|link| link.id) {
        core.show(Event::Reached {
            member,
            via,
            out_of_range: links.get(member).is_none(),
        });
    }
}
