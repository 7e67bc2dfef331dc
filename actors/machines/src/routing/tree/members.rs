//! What a master knows of its members: how far they have got, and who is missed.

use super::{Event, NodeId, NodeSet, Notice, TreeRouting};
use crate::time::Timestamp;

/// Since when a member has been missed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Missed {
    pub(super) since: Timestamp,
    pub(super) told: bool,
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
        let acknowledged = self.acknowledged_below();
        let landing = self.below(|said| &said.landing);
        let news: Vec<NodeId> = acknowledged
            .iter()
            .filter(|id| !self.told.1.contains(*id))
            .chain(landing.iter().filter(|id| !self.told_landing.contains(*id)))
            .collect();
        for member in news {
            let carried_out = acknowledged.contains(member);
            self.inform(Notice::Progress {
                member,
                acknowledged: if carried_out { sequence } else { 0 },
                landing: landing.contains(member),
            });
        }
        self.told.1.extend_from(&acknowledged);
        self.told_landing.extend_from(&landing);
        self.miss_members(now);
    }

    /// Says that routes are up; to a master also to whom they need not lead over others.
    pub(super) fn inform_of_routes(&mut self) {
        if self.is_master() {
            let heard = self.links.iter().map(|(id, _)| id).collect();
            self.inform(Notice::Hears(heard));
        }
        self.inform(Notice::RoutesReady);
    }

    /// As master: gives every member its time to live, heard of or not.
    pub(super) fn expect_members(&mut self, now: Timestamp) {
        for id in (0..self.config.drones)
            .map(NodeId)
            .filter(|id| *id != self.config.id)
        {
            let missed = Missed {
                since: now,
                told: false,
            };
            self.missed.entry(id).or_insert(missed);
        }
    }

    fn miss_members(&mut self, now: Timestamp) {
        let alive = self.below(|said| &said.alive);
        for id in alive.iter() {
            match self.missed.insert(
                id,
                Missed {
                    since: now,
                    told: false,
                },
            ) {
                Some(missed) if missed.told => self.inform(Notice::Returned(id)),
                Some(_) => {}
                None => self.reached(id),
            }
        }
        let time_to_live = self.config.time_to_live;
        let mut silent = Vec::new();
        for (id, missed) in &mut self.missed {
            if !missed.told && !alive.contains(*id) && now.since(missed.since) > time_to_live {
                missed.told = true;
                silent.push(*id);
            }
        }
        for id in silent {
            self.inform(Notice::Silent(id));
        }
    }

    /// Lets it be seen through whom the master hears of a member.
    fn reached(&mut self, member: NodeId) {
        let own = self.config.id;
        let via = self
            .links
            .children(own)
            .find(|(_, link)| link.said.alive.contains(member))
            .map(|(id, _)| id);
        if let Some(via) = via {
            self.outbox.event(Event::Reached {
                member,
                via,
                out_of_range: self.links.get(member).is_none(),
            });
        }
    }
}
