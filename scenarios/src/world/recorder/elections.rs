use std::collections::BTreeSet;

use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;

/// A time in which some of a swarm had no master, or several.
#[derive(Debug, Clone)]
pub(crate) struct Election {
    pub(crate) begun: Timestamp,
    /// When the first drone led that was elected meanwhile.
    pub(crate) led: Option<Timestamp>,
    /// When each segment had one master again, and who they were.
    pub(crate) settled: Option<(Timestamp, BTreeSet<NodeId>)>,
}

/// The elections of a swarm.
///
/// Invariant: all but the last have settled.
#[derive(Debug, Default)]
pub(super) struct Elections(Vec<Election>);

impl Elections {
    pub(super) fn all(&self) -> &[Election] {
        &self.0
    }

    /// Whether the last one has not settled.
    pub(super) fn is_open(&self) -> bool {
        self.0.last().is_some_and(|it| it.settled.is_none())
    }

    fn open(&mut self) -> Option<&mut Election> {
        self.0.last_mut().filter(|it| it.settled.is_none())
    }

    /// Records the masters of all segments, or that some have none or several (`None`). Returns whether an election has
    /// settled by that.
    pub(super) fn masters(&mut self, now: Timestamp, masters: Option<BTreeSet<NodeId>>) -> bool {
        match (self.open(), masters) {
            (Some(election), Some(masters)) => {
                election.settled = Some((now, masters));
                return true;
            }
            (None, None) => self.0.push(Election {
                begun: now,
                led: None,
                settled: None,
            }),
            (Some(_), None) | (None, Some(_)) => {}
        }
        false
    }

    /// Records that an elected drone leads.
    pub(super) fn led(&mut self, now: Timestamp) {
        if let Some(election) = self.open() {
            election.led.get_or_insert(now);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_election_lasts_until_each_segment_has_a_master_again() {
        let (at, mut elections) = (Timestamp::from_nanos, Elections::default());
        let masters = || Some(BTreeSet::from([NodeId(1)]));
        assert!(!elections.masters(at(1), masters()));
        assert!(!elections.masters(at(2), None));
        assert!(!elections.masters(at(3), None));
        elections.led(at(4));
        elections.led(at(5));
        assert!(elections.is_open());
        assert!(elections.masters(at(6), masters()));
        assert!(!elections.masters(at(7), masters()));
        let [election] = elections.all() else {
            panic!("one election");
        };
        assert_eq!((election.begun, election.led), (at(2), Some(at(4))));
        assert_eq!(election.settled.as_ref().unwrap().0, at(6));
    }
}
