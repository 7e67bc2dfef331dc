use std::time::Duration;

use super::Member;
use crate::identity::{NodeId, NodeSet};
use crate::roster::Roster;
use crate::time::Timestamp;

/// What is known of the members below this drone, gathered from the acknowledgements that it passes on.
#[derive(Debug, Clone, Default)]
pub(super) struct Members(Roster<Known>);

#[derive(Debug, Clone, Copy)]
struct Known {
    member: Member,
    /// The neighbour that spoke for it last.
    via: NodeId,
    /// When its own number last rose.
    rose_at: Timestamp,
    silent: bool,
}

/// What a member's report changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Change {
    /// It acknowledged more than before, or began to land.
    pub(super) progress: bool,
    /// It had been taken for silent.
    pub(super) returned: bool,
    /// Another neighbour speaks for it than before, it came into the master's range or left it, or it was not known.
    pub(super) moved: bool,
}

impl Members {
    /// Takes a report in; one whose number has not risen proves nothing and changes nothing.
    pub(super) fn hear(&mut self, member: Member, via: NodeId, now: Timestamp) -> Change {
        let known = match self.0.find(member.id) {
            Ok(at) => self.0.at(at),
            Err(at) => {
                let known = Known {
                    member,
                    via,
                    rose_at: now,
                    silent: false,
                };
                self.0.insert(at, member.id, known);
                return Change {
                    progress: true,
                    returned: false,
                    moved: true,
                };
            }
        };
        if member.number <= known.member.number {
            return Change::default();
        }
        let change = Change {
            progress: member.acknowledged > known.member.acknowledged
                || member.landing != known.member.landing,
            returned: known.silent,
            moved: via != known.via || member.out_of_range != known.member.out_of_range,
        };
        let acknowledged = member.acknowledged.max(known.member.acknowledged);
        *known = Known {
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

    /// Starts the time to live of each of `members` anew, heard of or not; nobody is silent any more. Who was?
    pub(super) fn expect(
        &mut self,
        members: impl Iterator<Item = NodeId>,
        now: Timestamp,
    ) -> NodeSet {
        let silent = self.silent().collect();
        for id in members {
            let unheard = Known {
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
            match self.0.find(id) {
                Ok(at) => {
                    let known = self.0.at(at);
                    known.rose_at = now;
                    known.silent = false;
                }
                Err(at) => self.0.insert(at, id, unheard),
            }
        }
        silent
    }

    /// That this drone heard nobody is no fault of theirs: everybody's silence begins anew.
    pub(super) fn forgive(&mut self, now: Timestamp) {
        for known in self.0.iter_mut() {
            known.rose_at = now;
        }
    }

    pub(super) fn forget_all(&mut self) {
        *self = Self::default();
    }

    /// Forgets members whose number has not risen for `time_to_live`.
    pub(super) fn forget_silent(&mut self, now: Timestamp, time_to_live: Duration) {
        self.0
            .retain(|known| now.since(known.rose_at) <= time_to_live);
    }

    /// Marks and returns the members whose number has not risen for `time_to_live`, each once.
    pub(super) fn fall_silent(&mut self, now: Timestamp, time_to_live: Duration) -> NodeSet {
        let mut silent = NodeSet::default();
        for known in self.0.iter_mut() {
            if !known.silent && now.since(known.rose_at) > time_to_live {
                known.silent = true;
                silent.insert(known.member.id);
            }
        }
        silent
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = Member> + '_ {
        self.0.iter().map(|known| known.member)
    }

    pub(super) fn silent(&self) -> impl Iterator<Item = NodeId> + '_ {
        let silent = self.0.iter().filter(|known| known.silent);
        silent.map(|known| known.member.id)
    }

    pub(super) fn len(&self) -> usize {
        self.0.len()
    }
}
