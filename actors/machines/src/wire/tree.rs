//! Bytes of packets of policy `tree`. They are read in place, because receivers need only a small part of most.

use std::ops::Range;

use super::reader::{Reader, take_varint};
use super::writer::Writer;
use super::{EncodedSubtree, Reception, Tree, subtree};
use crate::identity::{NodeId, NodeSet};

/// First part of a packet of policy `tree`.
#[derive(Debug, Clone, Copy, Default)]
pub struct TreeHeader {
    /// See [`Tree::number`].
    pub number: u32,
    /// See [`Tree::hops`].
    pub hops: Option<u16>,
    /// See [`Tree::cost`].
    pub cost: u16,
    /// See [`Tree::parent`].
    pub parent: Option<NodeId>,
    /// See [`Tree::heartbeat`].
    pub heartbeat: u32,
    /// See [`Tree::lag`].
    pub lag: u32,
}

impl TreeHeader {
    #[inline]
    pub(super) fn read(reader: &mut Reader<'_>) -> Option<Self> {
        Some(Self {
            number: reader.u32()?,
            hops: reader.hops()?,
            cost: u16::try_from(reader.u32()?).ok()?,
            parent: reader.id()?,
            heartbeat: reader.u32()?,
            lag: reader.u32()?,
        })
    }
}

/// A received packet of policy `tree`. Its sets are decoded on demand.
#[derive(Debug, Clone, Default)]
pub struct TreeFrame<'a> {
    /// The header.
    pub header: TreeHeader,
    /// See [`Tree::sequence`].
    pub sequence: u32,
    /// See [`Tree::span`].
    pub span: Option<Range<u32>>,
    /// See [`Tree::hears`].
    pub hears: Option<EncodedSet<'a>>,
    /// See [`Tree::requests`].
    pub requests: EncodedSet<'a>,
    /// See [`Tree::to`].
    pub to: Option<NodeId>,
    /// See [`Tree::unicasts`].
    pub unicasts: u32,
    /// See [`Tree::pending`].
    pub pending: EncodedSet<'a>,
    /// See [`Tree::order`].
    pub order: Option<&'a [u8]>,
    /// The sender's subtree.
    pub subtree: EncodedSubtree<'a>,
    weak: EncodedReceptions<'a>,
}

/// Encoded receptions: for each the distance from the id before, and the share.
#[derive(Debug, Clone, Copy, Default)]
struct EncodedReceptions<'a>(&'a [u8]);

/// Valid shares of a [`Reception`].
const SIXTEENTHS: Range<u8> = 1..16;

impl<'a> EncodedReceptions<'a> {
    fn read(bytes: &'a [u8]) -> Option<Self> {
        let receptions = Self(bytes);
        let mut rest = bytes;
        let mut id = 0_u32;
        let mut is_first = true;
        while !rest.is_empty() {
            let distance = take_varint(&mut rest)?;
            let rises = distance > 0 || is_first;
            id = id.checked_add(distance).filter(|_| rises)?;
            is_first = false;
            let (sixteenths, behind) = rest.split_first()?;
            if !SIXTEENTHS.contains(sixteenths) {
                return None;
            }
            rest = behind;
        }
        Some(receptions)
    }

    fn iter(self) -> impl Iterator<Item = Reception> + 'a {
        let (mut rest, mut id) = (self.0, 0);
        std::iter::from_fn(move || {
            id += take_varint(&mut rest)?;
            let (sixteenths, behind) = rest.split_first()?;
            rest = behind;
            Some(Reception {
                id: NodeId(id),
                sixteenths: *sixteenths,
            })
        })
    }
}

/// An encoded set of drones: distances between the bounds of its runs as varints, the first one from 0. The bounds are
/// known to rise and to come in pairs.
#[derive(Debug, Clone, Copy, Default)]
pub struct EncodedSet<'a>(&'a [u8]);

impl<'a> EncodedSet<'a> {
    pub(super) fn read(bytes: &'a [u8]) -> Option<Self> {
        let mut rest = bytes;
        let (mut bound, mut is_in, mut is_first) = (0_u32, false, true);
        while !rest.is_empty() {
            let distance = take_varint(&mut rest)?;
            let rises = distance > 0 || is_first;
            bound = bound.checked_add(distance).filter(|_| rises)?;
            is_in = !is_in;
            is_first = false;
        }
        (!is_in).then_some(Self(bytes))
    }

    fn bounds(self) -> impl Iterator<Item = u32> + 'a {
        let (mut rest, mut bound) = (self.0, 0);
        std::iter::from_fn(move || {
            bound += take_varint(&mut rest)?;
            Some(bound)
        })
    }

    /// Whether the drone is a member.
    #[must_use]
    pub fn contains(self, id: NodeId) -> bool {
        self.bounds().take_while(|bound| *bound <= id.0).count() % 2 == 1
    }

    /// Number of members, at most [`u16::MAX`].
    #[must_use]
    pub fn member_count(self) -> u16 {
        let distances = (0..).zip(std::iter::from_fn({
            let mut rest = self.0;
            move || take_varint(&mut rest)
        }));
        let members = distances.filter(|(place, _)| place % 2 == 1);
        let members: u32 = members.fold(0, |sum: u32, (_, run)| sum.saturating_add(run));
        u16::try_from(members).unwrap_or(u16::MAX)
    }

    /// The decoded set.
    #[must_use]
    pub fn to_set(self) -> NodeSet {
        NodeSet::from_bounds(self.0.len(), self.bounds())
    }
}

/// Writes a packet behind its kind.
pub(super) fn write(tree: &Tree, writer: &mut Writer) {
    writer.u32(tree.number);
    writer.hops(tree.hops);
    writer.u32(tree.cost.into());
    writer.id(tree.parent);
    writer.u32(tree.heartbeat);
    writer.u32(tree.lag);
    writer.u32(tree.sequence);
    writer.option(tree.span.as_ref(), |writer, span| {
        writer.u32(span.start);
        writer.u32(span.end);
    });
    subtree::write(tree, writer);
    writer.option(tree.hears.as_ref(), |writer, hears| {
        writer.encoded_set(hears);
        writer.receptions(&tree.weak);
    });
    writer.encoded_set(&tree.requests);
    writer.id(tree.to);
    if tree.to.is_some() {
        writer.u32(tree.unicasts);
    }
    writer.encoded_set(&tree.pending);
    writer.option(tree.order.as_deref(), Writer::bytes);
}

impl<'a> TreeFrame<'a> {
    /// Reads a packet from its header and body; `None` if the body is malformed or bytes follow it.
    #[must_use]
    pub fn read(header: TreeHeader, body: &'a [u8]) -> Option<Self> {
        let mut reader = Reader(body);
        let mut frame = Self {
            header,
            ..Self::default()
        };
        frame.sequence = reader.u32()?;
        if reader.option_tag()? {
            frame.span = Some(reader.u32()?..reader.u32()?);
        }
        frame.subtree = EncodedSubtree::read(&mut reader)?;
        if reader.option_tag()? {
            frame.hears = Some(EncodedSet::read(reader.bytes()?)?);
            frame.weak = EncodedReceptions::read(reader.bytes()?)?;
        }
        frame.requests = EncodedSet::read(reader.bytes()?)?;
        frame.to = reader.id()?;
        if frame.to.is_some() {
            frame.unicasts = reader.u32()?;
        }
        frame.pending = EncodedSet::read(reader.bytes()?)?;
        if reader.option_tag()? {
            frame.order = Some(reader.bytes()?);
        }
        reader.0.is_empty().then_some(frame)
    }
}

impl TreeFrame<'_> {
    /// The same packet with only what describes the link to its sender: packet numbers and whom it hears.
    #[must_use]
    pub fn link_part(&self) -> Self {
        Self {
            header: TreeHeader {
                number: self.header.number,
                ..TreeHeader::default()
            },
            span: self.span.clone(),
            hears: self.hears,
            weak: self.weak,
            unicasts: self.unicasts,
            ..Self::default()
        }
    }

    fn covers(&self, id: NodeId) -> bool {
        self.span.as_ref().is_none_or(|span| span.contains(&id.0))
    }

    /// Whether the sender hears a drone; `None` if the packet does not cover that drone.
    #[must_use]
    pub fn hears(&self, id: NodeId) -> Option<bool> {
        let hears = self.hears.filter(|_| self.covers(id));
        hears.map(|hears| hears.contains(id))
    }

    /// Whether a drone is in the sender's subtree; `None` if the packet does not cover that drone.
    #[must_use]
    pub fn counts(&self, id: NodeId) -> Option<bool> {
        self.covers(id).then(|| self.subtree.is_alive(id))
    }

    /// Share of a drone's broadcasts that the sender receives, in sixteenths; `None` if the packet does not contain it.
    #[must_use]
    pub fn reception_of(&self, id: NodeId) -> Option<u8> {
        if !self.hears(id)? {
            return None;
        }
        let weak = self.weak.iter().find(|it| it.id == id);
        Some(weak.map_or(SIXTEENTHS.end, |it| it.sixteenths))
    }

    /// `reported`, a set of this packet, with the members of `before`, the same set of the sender's last packet, that
    /// the span does not cover.
    #[must_use]
    pub fn merged_with_previous(&self, mut reported: NodeSet, before: &NodeSet) -> NodeSet {
        if let Some(span) = &self.span {
            reported.extend_from(&before.difference(&span.clone().into()));
        }
        reported
    }

    /// The decoded packet.
    #[must_use]
    pub fn to_tree(&self) -> Tree {
        Tree {
            number: self.header.number,
            hops: self.header.hops,
            cost: self.header.cost,
            parent: self.header.parent,
            heartbeat: self.header.heartbeat,
            lag: self.header.lag,
            sequence: self.sequence,
            span: self.span.clone(),
            acknowledged: self.subtree.acknowledged(),
            alive: self.subtree.alive(),
            landing: self.subtree.landing(),
            hears: self.hears.map(EncodedSet::to_set),
            weak: self.weak.iter().collect(),
            requests: self.requests.to_set(),
            to: self.to,
            unicasts: self.unicasts,
            pending: self.pending.to_set(),
            order: self.order.map(bytes::Bytes::copy_from_slice),
        }
    }
}
