//! Who is who in a swarm.

use std::fmt;

use serde::{Deserialize, Serialize};

/// A drone, unique within its swarm; also the index of its slot in the formation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Ballot {
    /// Rises with each election.
    pub term: u32,
    /// The master's place in the order of succession.
    pub rank: u32,
    /// The master.
    pub master: NodeId,
}

impl Ballot {
    /// The term of the reign that the operator starts.
    pub const FIRST_TERM: u32 = 1;

    /// Whether the reign began by an election, and not by the operator.
    #[must_use]
    pub const fn is_elected(&self) -> bool {
        self.term > Self::FIRST_TERM
    }

    /// Whether a drone that obeys `other` must turn to this one.
    #[must_use]
    pub fn beats(&self, other: &Self) -> bool {
        self.term > other.term || (self.term == other.term && self.rank < other.rank)
    }
}

impl fmt::Display for Ballot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "drone {}'s ballot of term {}", self.master, self.term)
    }
}

/// A set of drones, a bit each; as small as its highest member asks for.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
pub struct NodeSet(Vec<u8>);

impl NodeSet {
    /// From bits, lowest first.
    #[must_use]
    pub fn from_bytes(bytes: &[u8]) -> Self {
        let end = bytes
            .iter()
            .rposition(|byte| *byte != 0)
            .map_or(0, |last| last + 1);
        Self(bytes[..end].to_vec())
    }

    /// Leaves out whoever is not below `end`.
    pub fn truncate(&mut self, end: u32) {
        self.0.truncate(end.div_ceil(8) as usize);
        if !end.is_multiple_of(8)
            && let Some(last) = self.0.get_mut((end / 8) as usize)
        {
            *last &= (1 << (end % 8)) - 1;
        }
        let end = self
            .0
            .iter()
            .rposition(|byte| *byte != 0)
            .map_or(0, |last| last + 1);
        self.0.truncate(end);
    }

    /// Its bits, lowest first, without trailing zeros.
    #[must_use]
    pub fn as_bytes(&self) -> &[u8] {
        &self.0
    }

    /// Adds a drone.
    pub fn insert(&mut self, id: NodeId) {
        let byte = (id.0 / 8) as usize;
        if self.0.len() <= byte {
            self.0.resize(byte + 1, 0);
        }
        self.0[byte] |= 1 << (id.0 % 8);
    }

    /// Adds all of another set.
    pub fn extend_from(&mut self, other: &Self) {
        if self.0.len() < other.0.len() {
            self.0.resize(other.0.len(), 0);
        }
        for (own, others) in self.0.iter_mut().zip(&other.0) {
            *own |= others;
        }
    }

    /// Whether it has this drone.
    #[must_use]
    pub fn contains(&self, id: NodeId) -> bool {
        self.0
            .get((id.0 / 8) as usize)
            .is_some_and(|byte| byte >> (id.0 % 8) & 1 == 1)
    }

    /// Whether it has all of another set.
    #[must_use]
    pub fn is_superset(&self, other: &Self) -> bool {
        other.iter().all(|id| self.contains(id))
    }

    /// The members that another set has not.
    #[must_use]
    pub fn difference(&self, other: &Self) -> Self {
        self.iter().filter(|id| !other.contains(*id)).collect()
    }

    /// Whether it has nobody.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// How many it has.
    #[must_use]
    pub fn len(&self) -> usize {
        self.0.iter().map(|byte| byte.count_ones() as usize).sum()
    }

    /// Its members, lowest first.
    pub fn iter(&self) -> impl Iterator<Item = NodeId> + '_ {
        self.0
            .iter()
            .zip((0_u32..).step_by(8))
            .flat_map(|(byte, first)| {
                (0..8)
                    .filter(move |bit| byte >> bit & 1 == 1)
                    .map(move |bit| NodeId(first + bit))
            })
    }
}

impl Extend<NodeId> for NodeSet {
    fn extend<I: IntoIterator<Item = NodeId>>(&mut self, ids: I) {
        for id in ids {
            self.insert(id);
        }
    }
}

impl FromIterator<NodeId> for NodeSet {
    fn from_iter<I: IntoIterator<Item = NodeId>>(ids: I) -> Self {
        let mut set = Self::default();
        set.extend(ids);
        set
    }
}
