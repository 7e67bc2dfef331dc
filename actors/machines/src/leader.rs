//! The leader that a drone follows. Routing and mission each hold a [`CurrentLeader`], so both order ballots the same
//! way.

use serde::{Deserialize, Serialize};

use crate::flaw::{self, Flaw};
use crate::identity::{Ballot, NodeId};

/// The current leader's ballot; `None` before the first. It never falls.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
pub struct CurrentLeader(Option<Ballot>);

/// Whether the link that delivered a ballot works in both directions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum LinkSymmetry {
    /// The link works in both directions, or the ballot comes from within the drone.
    Symmetric,
    /// The link may work in one direction only. Its ballots do not replace the current leader.
    OneWay,
}

/// Result of observing a ballot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[must_use]
pub enum BallotDecision {
    /// It is the current one.
    Same,
    /// It has become the current one.
    Adopted,
    /// It is not followed: worse than the current one, or received over a one-way link.
    Ignored,
}

impl CurrentLeader {
    /// The ballot; `None` before the first.
    #[must_use]
    pub const fn ballot(self) -> Option<Ballot> {
        self.0
    }

    /// Whether `drone` is the leader.
    #[must_use]
    pub fn is_of(self, drone: NodeId) -> bool {
        self.0.is_some_and(|ballot| ballot.master == drone)
    }

    /// Adopts `ballot` if it beats the current one. The first ballot is adopted over any link.
    pub fn observe(&mut self, ballot: Ballot, symmetry: LinkSymmetry) -> BallotDecision {
        match self.0 {
            Some(own) if own == ballot => BallotDecision::Same,
            Some(_) if symmetry == LinkSymmetry::OneWay => BallotDecision::Ignored,
            Some(own) if !wins(&ballot, &own) => BallotDecision::Ignored,
            _ => {
                self.0 = Some(ballot);
                BallotDecision::Adopted
            }
        }
    }

    /// The term of a claim that beats the current ballot; `None` before the first ballot, and after the last term.
    #[must_use]
    pub fn next_term(self) -> Option<u32> {
        self.0?.term.checked_add(1)
    }
}

/// Whether an observed ballot replaces the current one.
fn wins(observed: &Ballot, own: &Ballot) -> bool {
    let both_elected = observed.is_elected() && own.is_elected();
    if both_elected && flaw::has(Flaw::PrefersWorseBallots) {
        return own.beats(observed);
    }
    observed.beats(own) || flaw::has(Flaw::FollowsAnyBallot)
}

impl From<Ballot> for CurrentLeader {
    fn from(ballot: Ballot) -> Self {
        Self(Some(ballot))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn ballot(term: u32, rank: u32) -> Ballot {
        let master = NodeId(10 + rank);
        Ballot { term, rank, master }
    }

    #[test]
    fn later_term_wins_then_smaller_rank() {
        let mut current = CurrentLeader::default();
        for (observed, decision) in [
            (ballot(2, 3), BallotDecision::Adopted),
            (ballot(2, 3), BallotDecision::Same),
            (ballot(2, 4), BallotDecision::Ignored),
            (ballot(1, 0), BallotDecision::Ignored),
            (ballot(2, 1), BallotDecision::Adopted),
            (ballot(3, 9), BallotDecision::Adopted),
        ] {
            assert_eq!(
                current.observe(observed, LinkSymmetry::Symmetric),
                decision,
                "{observed}"
            );
        }
        assert!(current.is_of(NodeId(19)) && !current.is_of(NodeId(11)));
    }

    #[test]
    fn one_way_link_delivers_the_first_ballot_only() {
        let mut current = CurrentLeader::default();
        assert_eq!(
            current.observe(ballot(1, 1), LinkSymmetry::OneWay),
            BallotDecision::Adopted
        );
        assert_eq!(
            current.observe(ballot(1, 1), LinkSymmetry::OneWay),
            BallotDecision::Same
        );
        assert_eq!(
            current.observe(ballot(2, 0), LinkSymmetry::OneWay),
            BallotDecision::Ignored
        );
        assert_eq!(current.ballot(), Some(ballot(1, 1)));
    }

    #[test]
    fn claim_uses_the_next_term_and_needs_a_leader() {
        assert_eq!(CurrentLeader::default().next_term(), None);
        assert_eq!(CurrentLeader::from(ballot(4, 2)).next_term(), Some(5));
        assert_eq!(CurrentLeader::from(ballot(u32::MAX, 2)).next_term(), None);
    }
}
