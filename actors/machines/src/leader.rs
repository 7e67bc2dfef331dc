//! Whom a drone obeys. Routing and mission each hold one of these and decide by nothing else, so that they can't differ
//! in what a better ballot is.

use serde::{Deserialize, Serialize};

use crate::flaw::{self, Flaw};
use crate::identity::{Ballot, NodeId};

/// The ballot that a drone obeys, if it has heard of any; it never falls.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
pub struct CurrentLeader(Option<Ballot>);

/// By which way a ballot is heard of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum LinkSymmetry {
    /// Over a link that carries both ways, or from within the drone.
    Mutual,
    /// Over a link that is not known to carry both ways: no reason to leave a master for another.
    OneWay,
}

/// What a drone makes of a ballot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[must_use]
pub enum BallotDecision {
    /// It is the one obeyed.
    Same,
    /// It is the one obeyed from now on.
    Turned,
    /// It is not to be obeyed: older than the one that is, or heard over a link that carries one way.
    Ignored,
}

impl CurrentLeader {
    /// Which one it is.
    #[must_use]
    pub const fn ballot(self) -> Option<Ballot> {
        self.0
    }

    /// Whether it is a ballot of `drone`'s own.
    #[must_use]
    pub fn is_of(self, drone: NodeId) -> bool {
        self.0.is_some_and(|ballot| ballot.master == drone)
    }

    /// Hears of a ballot and turns to it if it is better; the first that is heard of is taken in any case.
    pub fn hear(&mut self, ballot: Ballot, symmetry: LinkSymmetry) -> BallotDecision {
        match self.0 {
            Some(own) if own == ballot => BallotDecision::Same,
            Some(_) if symmetry == LinkSymmetry::OneWay => BallotDecision::Ignored,
            Some(own) if !wins(&ballot, &own) => BallotDecision::Ignored,
            _ => {
                self.0 = Some(ballot);
                BallotDecision::Turned
            }
        }
    }

    /// The term of a claim that beats the ballot obeyed; none before there is one, or after the last term.
    #[must_use]
    pub fn next_term(self) -> Option<u32> {
        self.0?.term.checked_add(1)
    }
}

/// Whether a drone turns to a ballot that it hears of.
fn wins(heard: &Ballot, own: &Ballot) -> bool {
    let both_elected = heard.is_elected() && own.is_elected();
    if both_elected && flaw::has(Flaw::TurnsToWorseBallots) {
        return own.beats(heard);
    }
    heard.beats(own) || flaw::has(Flaw::ObeysAnyMaster)
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
    fn a_later_term_wins_then_the_smaller_rank_and_nothing_else_is_turned_to() {
        let mut current = CurrentLeader::default();
        for (heard, verdict) in [
            (ballot(2, 3), BallotDecision::Turned),
            (ballot(2, 3), BallotDecision::Same),
            (ballot(2, 4), BallotDecision::Ignored),
            (ballot(1, 0), BallotDecision::Ignored),
            (ballot(2, 1), BallotDecision::Turned),
            (ballot(3, 9), BallotDecision::Turned),
        ] {
            assert_eq!(
                current.hear(heard, LinkSymmetry::Mutual),
                verdict,
                "{heard}"
            );
        }
        assert!(current.is_of(NodeId(19)) && !current.is_of(NodeId(11)));
    }

    #[test]
    fn over_a_link_that_carries_one_way_only_the_first_ballot_is_taken() {
        let mut current = CurrentLeader::default();
        assert_eq!(
            current.hear(ballot(1, 1), LinkSymmetry::OneWay),
            BallotDecision::Turned
        );
        assert_eq!(
            current.hear(ballot(1, 1), LinkSymmetry::OneWay),
            BallotDecision::Same
        );
        assert_eq!(
            current.hear(ballot(2, 0), LinkSymmetry::OneWay),
            BallotDecision::Ignored
        );
        assert_eq!(current.ballot(), Some(ballot(1, 1)));
    }

    #[test]
    fn a_claim_is_a_term_later_and_nobody_claims_who_never_obeyed() {
        assert_eq!(CurrentLeader::default().next_term(), None);
        assert_eq!(CurrentLeader::from(ballot(4, 2)).next_term(), Some(5));
        assert_eq!(CurrentLeader::from(ballot(u32::MAX, 2)).next_term(), None);
    }
}
