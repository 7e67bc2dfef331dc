//! Who is who in a swarm.

use std::fmt;

/// A drone, unique within its swarm; also the index of its slot in the formation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct NodeId(pub u32);

impl fmt::Display for NodeId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// A swarm: frames of another one are not obeyed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SwarmId(pub u32);

/// The name of a reign: which master, by which right.
///
/// Of two ballots the later term wins, then the smaller rank; ranks are unique in a swarm, the centre slot first,
/// so two parts of a swarm may share a term but never a ballot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Ballot {
    /// Rises with each election.
    pub term: u32,
    /// The master's place in the order of succession.
    pub rank: u32,
    /// The master.
    pub master: NodeId,
}

impl Ballot {
    /// Whether a drone that obeys `other` must turn to this one.
    #[must_use]
    pub fn beats(&self, other: &Self) -> bool {
        self.term > other.term || (self.term == other.term && self.rank < other.rank)
    }
}
