use std::time::Duration;

use super::Member;
use crate::identity::{NodeId, NodeSet};
use crate::node_map::NodeMap;
use crate::time::Timestamp;

/// Reports of members, collected from the acknowledgements that this drone forwards.
#[derive(Debug, Clone, Default)]
pub(super) struct Members {
    records: NodeMap<MemberRecord>,
    /// Place of the next report, if reports come by ascending id, as a neighbour sends them.
    next: usize,
}

#[derive(Debug, Clone, Copy)]
struct MemberRecord {
    member: Member,
    /// The neighbour that forwarded its last report.
    via: NodeId,
    /// When its number last rose.
    rose_at: Timestamp,
    silent: bool,
}

/// What a member's report changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Change {
    /// It acknowledged a newer order, or its landing changed.
    pub(super) progress: bool,
    /// It was silent before.
    pub(super) returned: bool,
    /// It is new, another neighbour forwards it, or it entered or left the master's range.
    pub(super) path_changed: bool,
}

impl Members {
    /// Records a report. A report without a higher number is ignored.
    pub(super) fn record(&mut self, member: Member, via: NodeId, now: Timestamp) -> Change {
        let record = match self.records.find_near(self.next, member.id) {
            Ok(at) => {
                self.next = at + 1;
                self.records.at(at)
            }
            Err(at) => {
                let record = MemberRecord {
                    member,
                    via,
                    rose_at: now,
                    silent: false,
                };
                self.records.insert(at, member.id, record);
                return Change {
                    progress: true,
                    returned: false,
                    path_changed: true,
                };
            }
        };
        if member.number <= record.member.number {
            return Change::default();
        }
        let change = Change {
            progress: member.acknowledged > record.member.acknowledged
                || member.landing != record.member.landing,
            returned: record.silent,
            path_changed: via != record.via || member.out_of_range != record.member.out_of_range,
        };
        let acknowledged = member.acknowledged.max(record.member.acknowledged);
        *record = MemberRecord {
            member: Member {
                acknowledged,
                ..member
            },
            via,
            rose_at: now,
            silent: false,
        };
        change
    }

    /// Restarts the time to live of `members`, including unknown ones; none is silent any more. Returns those that
    /// were.
    pub(super) fn expect(
        &mut self,
        members: impl Iterator<Item = NodeId>,
        now: Timestamp,
    ) -> NodeSet {
        let silent = self.silent().collect();
        for id in members {
            let unknown = MemberRecord {
                member: Member {
                    id,
                    number: 0,
                    acknowledged: 0,
                    out_of_range: false,
                    landing: false,
                },
                via: id,
                rose_at: now,
                silent: false,
            };
            match self.records.find(id) {
                Ok(at) => {
                    let record = self.records.at(at);
                    record.rose_at = now;
                    record.silent = false;
                }
                Err(at) => self.records.insert(at, id, unknown),
            }
        }
        silent
    }

    /// Restarts the silence timeout of all members. One that ends later anyway stays.
    pub(super) fn reset_timeouts(&mut self, now: Timestamp) {
        for record in self.records.iter_mut() {
            record.rose_at = record.rose_at.max(now);
        }
    }

    pub(super) fn forget_all(&mut self) {
        *self = Self::default();
    }

    /// Removes members whose number has not risen for `time_to_live`.
    pub(super) fn forget_silent(&mut self, now: Timestamp, time_to_live: Duration) {
        self.records
            .retain(|record| now.since(record.rose_at) <= time_to_live);
    }

    /// Marks members whose number has not risen for `time_to_live`; returns those that were not marked before.
    pub(super) fn mark_silent(&mut self, now: Timestamp, time_to_live: Duration) -> NodeSet {
        let mut silent = NodeSet::default();
        for record in self.records.iter_mut() {
            if !record.silent && now.since(record.rose_at) > time_to_live {
                record.silent = true;
                silent.insert(record.member.id);
            }
        }
        silent
    }

    /// Whether the number of a known member has not risen for longer than `time`.
    pub(super) fn is_silent_for(&self, id: NodeId, now: Timestamp, time: Duration) -> bool {
        (self.records.get(id)).is_some_and(|it| now.since(it.rose_at) > time)
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = Member> + '_ {
        self.records.iter().map(|record| record.member)
    }

    pub(super) fn silent(&self) -> impl Iterator<Item = NodeId> + '_ {
        let silent = self.records.iter().filter(|record| record.silent);
        silent.map(|record| record.member.id)
    }

    pub(super) fn len(&self) -> usize {
        self.records.len()
    }
}
