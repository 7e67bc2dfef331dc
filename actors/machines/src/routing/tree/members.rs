//! What a master knows of its members: how far they have got, and who is missed.

use std::collections::BTreeMap;
use std::time::Duration;

use super::{Event, NodeId, NodeSet, Notice, TreeRouting};
use crate::time::Timestamp;

/// Who is alive, and who is missed.
#[derive(Debug, Default)]
pub(super) struct Members {
    /// Who was alive when last looked.
    alive: NodeSet,
    /// The others that are known of or expected.
    missed: BTreeMap<NodeId, Missed>,
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
    /// Gives each of these its time to live, heard of or not.
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
}

impl TreeRouting {
    /// As master: tells the protocol what the members' reports have changed.
    pub(super) fn report_members(&mut self, now: Timestamp) {
        if !self.is_master() {
            return;
        }
        let sequence = self.durable.reign.sequence();
        if self.told.0 != sequence {
            self.told = (sequence, NodeSet::default());
        }
        let below = self.links.below(sequence);
        let acknowledged = below.acknowledged.difference(&self.told.1);
        let landing = below.landing.difference(&self.told_landing);
        if !acknowledged.is_empty() || !landing.is_empty() {
            self.told.1.extend_from(&acknowledged);
            self.told_landing.extend_from(&landing);
            self.inform(Notice::Progress {
                sequence,
                acknowledged,
                landing,
            });
        }
        self.miss_members(now);
    }

    /// Says that routes are up; to a master also to whom they need not lead over others.
    pub(super) fn inform_of_routes(&mut self) {
        if self.is_master() {
            let heard = self.links.iter().map(|link| link.id).collect();
            self.inform(Notice::Hears(heard));
        }
        self.inform(Notice::RoutesReady);
    }

    /// As master: gives every member its time to live, heard of or not.
    pub(super) fn expect_members(&mut self, now: Timestamp) {
        let own = self.config.id;
        let others = (0..self.config.drones).map(NodeId).filter(|id| *id != own);
        self.members.expect(others, now);
    }

    fn miss_members(&mut self, now: Timestamp) {
        let below = self.links.below(self.durable.reign.sequence());
        let (back, new) = self.members.look(&below.alive, now);
        if !back.is_empty() {
            self.inform(Notice::Returned(back));
        }
        for id in new.iter() {
            self.reached(id);
        }
        let silent = self.members.fall_silent(now, self.config.time_to_live);
        if !silent.is_empty() {
            self.inform(Notice::Silent(silent));
        }
    }

    /// Lets it be seen through whom the master hears of a member.
    fn reached(&mut self, member: NodeId) {
        let mut children = self.links.children();
        let via = children.find(|link| link.alive().contains(member));
        if let Some(via) = via.map(|link| link.id) {
            self.outbox.event(Event::Reached {
                member,
                via,
                out_of_range: self.links.get(member).is_none(),
            });
        }
    }
}
