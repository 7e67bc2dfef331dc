//! Identities of drones, swarms and leaders, and sets of drones.

use std::fmt;
use std::ops::Range;

use serde::de::{Error as _, SeqAccess, Visitor};
use serde::ser::SerializeSeq;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use smallvec::SmallVec;

/// A drone's id, unique in its swarm; also the index of its slot in the formation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct NodeId(pub u32);

impl fmt::Display for NodeId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// A swarm's id. Frames of other swarms are dropped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SwarmId(pub u32);

/// Identifies a leader epoch.
///
/// Of two ballots the later term wins, then the smaller rank. Ranks are unique in a swarm, and the centre slot has rank
/// 0. So two segments of a swarm may share a term, but never a ballot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Ballot {
    /// Rises with each election.
    pub term: u32,
    /// The master's rank in the order of succession; 0 is first.
    pub rank: u32,
    /// The master.
    pub master: NodeId,
}

impl Ballot {
    /// Term of the leader epoch that the operator starts.
    pub const FIRST_TERM: u32 = 1;

    /// Whether an election started the leader epoch, not the operator.
    #[must_use]
    pub const fn is_elected(&self) -> bool {
        self.term > Self::FIRST_TERM
    }

    /// Whether a drone under `other` must adopt this ballot.
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

/// A set of drones, stored as the bounds of its runs of consecutive ids. Memory grows with the number of runs; up to
/// two runs need no heap. `u32::MAX` is no valid id and never in a set.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Default)]
pub struct NodeSet(
    /// Rising: first id of a run, first id after it, first id of the next run, and so on.
    SmallVec<[u32; 4]>,
);

impl NodeSet {
    /// The empty set.
    #[must_use]
    pub const fn new() -> Self {
        Self(SmallVec::new_const())
    }

    /// From rising bounds in pairs, at most `most` of them.
    pub(crate) fn from_bounds(most: usize, bounds: impl Iterator<Item = u32>) -> Self {
        let mut set = Self(SmallVec::with_capacity(most));
        set.0.extend(bounds);
        debug_assert!(set.0.is_sorted_by(|a, b| a < b) && set.0.len().is_multiple_of(2));
        set
    }

    /// As [`Self::from_bounds`]; `None` if any bound is.
    pub(crate) fn try_from_bounds(
        most: usize,
        bounds: impl Iterator<Item = Option<u32>>,
    ) -> Option<Self> {
        let mut set = Self(SmallVec::with_capacity(most));
        for bound in bounds {
            set.0.push(bound?);
        }
        debug_assert!(set.0.is_sorted_by(|a, b| a < b) && set.0.len().is_multiple_of(2));
        Some(set)
    }

    /// Removes ids of `end` and above.
    pub fn truncate(&mut self, end: u32) {
        if self.0.last().is_some_and(|last| *last > end) {
            let kept = self.0.partition_point(|bound| *bound < end);
            self.0.truncate(kept);
            if kept % 2 == 1 {
                self.0.push(end);
            }
        }
    }

    /// Adds a drone.
    pub fn insert(&mut self, id: NodeId) {
        let Some(behind) = id.0.checked_add(1) else {
            return;
        };
        // The common case: the id lies after all others.
        match self.0.last_mut() {
            Some(end) if *end == id.0 => {
                *end = behind;
                return;
            }
            Some(end) if *end > id.0 => {}
            _ => return self.0.extend_from_slice(&[id.0, behind]),
        }
        let at = self.bounds_up_to(id);
        if at % 2 == 1 {
            return;
        }
        let joins_run_before = at > 0 && self.0[at - 1] == id.0;
        let joins_run_behind = self.0.get(at) == Some(&behind);
        match (joins_run_before, joins_run_behind) {
            (true, true) => drop(self.0.drain(at - 1..=at)),
            (true, false) => self.0[at - 1] = behind,
            (false, true) => self.0[at] = id.0,
            (false, false) => self.0.insert_many(at, [id.0, behind]),
        }
    }

    /// Adds all members of another set.
    pub fn extend_from(&mut self, other: &Self) {
        if self.is_empty() {
            self.clone_from(other);
        } else if !self.is_superset(other) {
            *self = self.combined(other, |own, others| own || others);
        }
    }

    /// Whether the drone is a member.
    #[must_use]
    pub fn contains(&self, id: NodeId) -> bool {
        self.bounds_up_to(id) % 2 == 1
    }

    /// Number of bounds at or below `id`.
    fn bounds_up_to(&self, id: NodeId) -> usize {
        self.0.partition_point(|bound| *bound <= id.0)
    }

    /// Whether all members of another set are members.
    #[must_use]
    pub fn is_superset(&self, other: &Self) -> bool {
        let mut own = self.runs().peekable();
        other.runs().all(|run| {
            while own.next_if(|it| it.end <= run.start).is_some() {}
            own.peek()
                .is_some_and(|it| it.start <= run.start && run.end <= it.end)
        })
    }

    /// Members that are not in another set.
    #[must_use]
    pub fn difference(&self, other: &Self) -> Self {
        if self.is_empty() || other.is_empty() {
            return self.clone();
        }
        self.combined(other, |own, others| own && !others)
    }

    /// Members that are in another set, too.
    #[must_use]
    pub fn intersection(&self, other: &Self) -> Self {
        self.combined(other, |own, others| own && others)
    }

    /// Drones that are in exactly one of the two sets.
    #[must_use]
    pub fn symmetric_difference(&self, other: &Self) -> Self {
        self.combined(other, |own, others| own != others)
    }

    /// The ids for which `keep` is true, given whether they are in this set and in the other. `keep(false, false)` must
    /// be false.
    fn combined(&self, other: &Self, keep: impl Fn(bool, bool) -> bool) -> Self {
        let mut bounds = SmallVec::with_capacity(self.0.len() + other.0.len());
        let (mut own_at, mut other_at) = (0, 0);
        let mut is_kept = false;
        loop {
            let (own, others) = (self.0.get(own_at), other.0.get(other_at));
            let Some(bound) = own.into_iter().chain(others).min().copied() else {
                return Self(bounds);
            };
            own_at += usize::from(own == Some(&bound));
            other_at += usize::from(others == Some(&bound));
            if keep(own_at % 2 == 1, other_at % 2 == 1) != is_kept {
                is_kept = !is_kept;
                bounds.push(bound);
            }
        }
    }

    /// Whether `is_wanted` is true for some id, given which of `sets` contain it. It must be false for an id that is in
    /// none.
    pub(crate) fn any_where<const N: usize>(
        sets: [&Self; N],
        is_wanted: impl Fn([bool; N]) -> bool,
    ) -> bool {
        let mut bounds = sets.map(|set| set.0.as_slice());
        let mut has = [false; N];
        loop {
            let Some(next) = bounds.iter().filter_map(|it| it.first()).min().copied() else {
                return false;
            };
            for (bounds, has) in bounds.iter_mut().zip(&mut has) {
                if let [bound, rest @ ..] = bounds
                    && *bound == next
                {
                    (*bounds, *has) = (rest, !*has);
                }
            }
            if is_wanted(has) {
                return true;
            }
        }
    }

    /// Whether the set has no member.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Number of members.
    #[must_use]
    pub fn len(&self) -> usize {
        self.runs().map(|run| run.len()).sum()
    }

    /// Runs of consecutive ids, lowest first.
    pub fn runs(&self) -> impl ExactSizeIterator<Item = Range<u32>> + '_ {
        self.0.chunks_exact(2).map(|run| run[0]..run[1])
    }

    /// Distances from each bound to the next, the first one from 0.
    pub(crate) fn distances(&self) -> impl Iterator<Item = u32> + '_ {
        let before = std::iter::once(0).chain(self.0.iter().copied());
        self.0
            .iter()
            .zip(before)
            .map(|(bound, before)| bound - before)
    }

    /// Members, lowest first.
    pub fn iter(&self) -> impl Iterator<Item = NodeId> + '_ {
        self.runs().flatten().map(NodeId)
    }
}

impl From<Range<u32>> for NodeSet {
    fn from(ids: Range<u32>) -> Self {
        if ids.is_empty() {
            return Self::default();
        }
        Self(SmallVec::from_slice(&[ids.start, ids.end]))
    }
}

impl From<NodeId> for NodeSet {
    fn from(id: NodeId) -> Self {
        Self::from_iter([id])
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

/// Serialised as the distances from each bound to the next, the first one from 0.
impl Serialize for NodeSet {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut seq = serializer.serialize_seq(Some(self.0.len()))?;
        self.distances()
            .try_for_each(|distance| seq.serialize_element(&distance))?;
        seq.end()
    }
}

impl<'de> Deserialize<'de> for NodeSet {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_seq(Bounds)
    }
}

/// Reads a set. Rejects bounds that do not ascend or are not in pairs.
struct Bounds;

impl<'de> Visitor<'de> for Bounds {
    type Value = NodeSet;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the distances between the bounds of runs of ids")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut distances: A) -> Result<NodeSet, A::Error> {
        let mut bounds = SmallVec::<[u32; 4]>::new();
        while let Some(distance) = distances.next_element::<u32>()? {
            let next = match bounds.last() {
                Some(_) if distance == 0 => None,
                last => last.copied().unwrap_or(0).checked_add(distance),
            };
            bounds.push(
                next.ok_or_else(|| A::Error::custom("a set of ids needs ascending run bounds"))?,
            );
        }
        if bounds.len() % 2 == 1 {
            return Err(A::Error::custom("a set of ids needs bounds in pairs"));
        }
        Ok(NodeSet(bounds))
    }
}
