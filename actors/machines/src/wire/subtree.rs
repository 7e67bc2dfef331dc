//! Bytes of the sets that a packet of policy `tree` has of its sender's subtree.

use std::borrow::Cow;

use super::Tree;
use super::reader::Reader;
use super::tree::EncodedSet;
use super::writer::Writer;
use crate::identity::{NodeId, NodeSet};

const ACKNOWLEDGED_DIFFERS: u8 = 1;
const LANDING_DIFFERS: u8 = 2;

/// The encoded sets of a sender's subtree.
///
/// Invariant: `acknowledged` and `landing` are encoded as differences from `alive` where `differences` has their flag.
#[derive(Debug, Clone, Copy, Default)]
pub struct EncodedSubtree<'a> {
    alive: EncodedSet<'a>,
    acknowledged: EncodedSet<'a>,
    landing: EncodedSet<'a>,
    differences: u8,
}

/// Writes the sets.
pub(super) fn write(tree: &Tree, writer: &mut Writer) {
    let (acknowledged, first) =
        relative_to_alive(&tree.alive, &tree.acknowledged, ACKNOWLEDGED_DIFFERS);
    let (landing, second) = relative_to_alive(&tree.alive, &tree.landing, LANDING_DIFFERS);
    writer.u8(first | second);
    writer.encoded_set(&tree.alive);
    writer.encoded_set(&acknowledged);
    writer.encoded_set(&landing);
}

/// A set as it is encoded beside `alive`: as the difference from `alive`, with `flag`, if that has fewer runs.
fn relative_to_alive<'a>(alive: &NodeSet, set: &'a NodeSet, flag: u8) -> (Cow<'a, NodeSet>, u8) {
    if !set.is_empty() && !alive.is_empty() {
        let differs = alive.symmetric_difference(set);
        if differs.runs().len() < set.runs().len() {
            return (Cow::Owned(differs), flag);
        }
    }
    (Cow::Borrowed(set), 0)
}

impl<'a> EncodedSubtree<'a> {
    pub(super) fn read(reader: &mut Reader<'a>) -> Option<Self> {
        let differences = reader.u8()?;
        Some(Self {
            differences,
            alive: EncodedSet::read(reader.bytes()?)?,
            acknowledged: EncodedSet::read(reader.bytes()?)?,
            landing: EncodedSet::read(reader.bytes()?)?,
        })
    }

    /// See [`Tree::alive`].
    #[must_use]
    pub fn alive(&self) -> NodeSet {
        self.alive.to_set()
    }

    /// See [`Tree::acknowledged`].
    #[must_use]
    pub fn acknowledged(&self) -> NodeSet {
        self.relative_to_alive(self.acknowledged, ACKNOWLEDGED_DIFFERS)
    }

    /// See [`Tree::landing`].
    #[must_use]
    pub fn landing(&self) -> NodeSet {
        self.relative_to_alive(self.landing, LANDING_DIFFERS)
    }

    fn relative_to_alive(&self, runs: EncodedSet<'_>, flag: u8) -> NodeSet {
        let set = runs.to_set();
        if self.differences & flag == 0 {
            set
        } else {
            self.alive.to_set().symmetric_difference(&set)
        }
    }

    /// Whether a drone is in [`Tree::alive`].
    #[must_use]
    pub fn is_alive(&self, id: NodeId) -> bool {
        self.alive.contains(id)
    }

    /// Whether a drone is in [`Tree::landing`].
    #[must_use]
    pub fn is_landing(&self, id: NodeId) -> bool {
        let differs = self.differences & LANDING_DIFFERS != 0;
        self.landing.contains(id) != (differs && self.alive.contains(id))
    }
}
