//! The packet of policy `tree`, read where it lies: most of what a neighbour says is of no use to whoever hears it.

use std::borrow::Cow;
use std::ops::Range;

use super::reader::{Reader, take_varint};
use super::writer::Writer;
use crate::identity::{NodeId, NodeSet};
use crate::routing::{Reception, Tree};

/// What a packet of policy `tree` begins with.
#[derive(Debug, Clone, Copy, Default)]
pub struct TreeFront {
    /// As in [`Tree`], as all that follow.
    pub number: u32,
    /// See there.
    pub hops: Option<u16>,
    /// See there.
    pub cost: u16,
    /// See there.
    pub parent: Option<NodeId>,
    /// See there.
    pub heartbeat: u32,
    /// See there.
    pub lag: u32,
}

impl TreeFront {
    #[inline]
    pub(super) fn read(from: &mut Reader<'_>) -> Option<Self> {
        Some(Self {
            number: from.number()?,
            hops: from.hops()?,
            cost: u16::try_from(from.number()?).ok()?,
            parent: from.id()?,
            heartbeat: from.number()?,
            lag: from.number()?,
        })
    }
}

/// A packet of policy `tree` as it was received; its sets are made only when they are asked for.
#[derive(Debug, Clone, Default)]
pub struct TreeFrame<'a> {
    /// What it begins with.
    pub front: TreeFront,
    /// As in [`Tree`], as all that follow.
    pub sequence: u32,
    /// See there.
    pub span: Option<Range<u32>>,
    /// See there.
    pub hears: Option<Runs<'a>>,
    /// See there.
    pub asks: Runs<'a>,
    /// See there.
    pub to: Option<NodeId>,
    /// See there.
    pub unicasts: u32,
    /// See there.
    pub pending: Runs<'a>,
    /// See there.
    pub order: Option<&'a [u8]>,
    /// See there.
    pub alive: Runs<'a>,
    acknowledged: Runs<'a>,
    landing: Runs<'a>,
    weak: Receptions<'a>,
    differences: u8,
}

/// Neighbours and how well they are heard, as they are written: the distance from the id before, and the share.
#[derive(Debug, Clone, Copy, Default)]
struct Receptions<'a>(&'a [u8]);

/// The shares that a [`Reception`] may have.
const SIXTEENTHS: Range<u8> = 1..16;

impl<'a> Receptions<'a> {
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

/// A set of drones as it is written: the distances from each bound of its runs to the next, the first one from 0, as
/// varints. Whoever has one knows that the bounds rise and come in pairs.
#[derive(Debug, Clone, Copy, Default)]
pub struct Runs<'a>(&'a [u8]);

impl<'a> Runs<'a> {
    fn read(bytes: &'a [u8]) -> Option<Self> {
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

    /// Whether it has this drone.
    #[must_use]
    pub fn contains(self, id: NodeId) -> bool {
        self.bounds().take_while(|bound| *bound <= id.0).count() % 2 == 1
    }

    /// How many drones it has; at most [`u16::MAX`] are told.
    #[must_use]
    pub fn members(self) -> u16 {
        let distances = (0..).zip(std::iter::from_fn({
            let mut rest = self.0;
            move || take_varint(&mut rest)
        }));
        let members = distances.filter(|(place, _)| place % 2 == 1);
        let members: u32 = members.fold(0, |sum: u32, (_, run)| sum.saturating_add(run));
        u16::try_from(members).unwrap_or(u16::MAX)
    }

    /// The set.
    #[must_use]
    pub fn to_set(self) -> NodeSet {
        NodeSet::of_bounds(self.0.len(), self.bounds())
    }
}

const ACKNOWLEDGED_DIFFERS: u8 = 1;
const LANDING_DIFFERS: u8 = 2;

/// A set as it is written beside `alive`: as what differs from that, if that has fewer runs, which is then told by `flag`.
fn beside_alive<'a>(alive: &NodeSet, set: &'a NodeSet, flag: u8) -> (Cow<'a, NodeSet>, u8) {
    if !set.is_empty() && !alive.is_empty() {
        let differs = alive.symmetric_difference(set);
        if differs.runs().len() < set.runs().len() {
            return (Cow::Owned(differs), flag);
        }
    }
    (Cow::Borrowed(set), 0)
}

/// Writes a packet, behind its number.
pub(super) fn write(tree: &Tree, to: &mut Writer) {
    to.number(tree.number);
    to.hops(tree.hops);
    to.number(tree.cost.into());
    to.id(tree.parent);
    to.number(tree.heartbeat);
    to.number(tree.lag);
    to.number(tree.sequence);
    to.or_nothing(tree.span.as_ref(), |to, span| {
        to.number(span.start);
        to.number(span.end);
    });
    let (acknowledged, first) = beside_alive(&tree.alive, &tree.acknowledged, ACKNOWLEDGED_DIFFERS);
    let (landing, second) = beside_alive(&tree.alive, &tree.landing, LANDING_DIFFERS);
    to.byte(first | second);
    to.runs(&tree.alive);
    to.runs(&acknowledged);
    to.runs(&landing);
    to.or_nothing(tree.hears.as_ref(), |to, hears| {
        to.runs(hears);
        to.receptions(&tree.weak);
    });
    to.runs(&tree.asks);
    to.id(tree.to);
    if tree.to.is_some() {
        to.number(tree.unicasts);
    }
    to.runs(&tree.pending);
    to.or_nothing(tree.order.as_deref(), Writer::bytes);
}

impl<'a> TreeFrame<'a> {
    /// Reads the packet that has these words behind its front, field by field; nothing if they are none.
    #[must_use]
    pub fn read(front: TreeFront, words: &'a [u8]) -> Option<Self> {
        let mut from = Reader(words);
        let mut frame = Self {
            front,
            ..Self::default()
        };
        frame.sequence = from.number()?;
        if from.is_there()? {
            frame.span = Some(from.number()?..from.number()?);
        }
        frame.differences = from.byte()?;
        frame.alive = Runs::read(from.bytes()?)?;
        frame.acknowledged = Runs::read(from.bytes()?)?;
        frame.landing = Runs::read(from.bytes()?)?;
        if from.is_there()? {
            frame.hears = Some(Runs::read(from.bytes()?)?);
            frame.weak = Receptions::read(from.bytes()?)?;
        }
        frame.asks = Runs::read(from.bytes()?)?;
        frame.to = from.id()?;
        if frame.to.is_some() {
            frame.unicasts = from.number()?;
        }
        frame.pending = Runs::read(from.bytes()?)?;
        if from.is_there()? {
            frame.order = Some(from.bytes()?);
        }
        from.0.is_empty().then_some(frame)
    }
}

impl TreeFrame<'_> {
    /// See [`Tree::acknowledged`].
    #[must_use]
    pub fn acknowledged(&self) -> NodeSet {
        self.beside_alive(self.acknowledged, ACKNOWLEDGED_DIFFERS)
    }

    /// See [`Tree::landing`].
    #[must_use]
    pub fn landing(&self) -> NodeSet {
        self.beside_alive(self.landing, LANDING_DIFFERS)
    }

    fn beside_alive(&self, runs: Runs<'_>, flag: u8) -> NodeSet {
        let set = runs.to_set();
        if self.differences & flag == 0 {
            set
        } else {
            self.alive.to_set().symmetric_difference(&set)
        }
    }

    /// Whether a drone is on its way to the ground, as far as this tells.
    #[must_use]
    pub fn is_landing(&self, id: NodeId) -> bool {
        let differs = self.differences & LANDING_DIFFERS != 0;
        self.landing.contains(id) != (differs && self.alive.contains(id))
    }

    /// The same, with nothing but that its sender is there and whom it hears.
    #[must_use]
    pub fn only_of_its_link(&self) -> Self {
        Self {
            front: TreeFront {
                number: self.front.number,
                ..TreeFront::default()
            },
            span: self.span.clone(),
            hears: self.hears,
            weak: self.weak,
            unicasts: self.unicasts,
            ..Self::default()
        }
    }

    /// Whether its sender hears a drone, as far as this tells.
    #[must_use]
    pub fn hears(&self, id: NodeId) -> Option<bool> {
        let tells_of = self.span.as_ref().is_none_or(|span| span.contains(&id.0));
        let hears = self.hears.filter(|_| tells_of);
        hears.map(|hears| hears.contains(id))
    }

    /// The share of a drone's broadcasts that its sender hears, in sixteenths; `None` if it does not tell.
    #[must_use]
    pub fn reception_of(&self, id: NodeId) -> Option<u8> {
        if !self.hears(id)? {
            return None;
        }
        let weak = self.weak.iter().find(|it| it.id == id);
        Some(weak.map_or(SIXTEENTHS.end, |it| it.sixteenths))
    }

    /// What its sender says of everybody, where `said` is one of the sets of this packet and `before` what the sender
    /// said before.
    #[must_use]
    pub fn and_before(&self, mut said: NodeSet, before: &NodeSet) -> NodeSet {
        if let Some(span) = &self.span {
            said.extend_from(&before.difference(&span.clone().into()));
        }
        said
    }

    /// All of it, made.
    #[must_use]
    pub fn to_tree(&self) -> Tree {
        Tree {
            number: self.front.number,
            hops: self.front.hops,
            cost: self.front.cost,
            parent: self.front.parent,
            heartbeat: self.front.heartbeat,
            lag: self.front.lag,
            sequence: self.sequence,
            span: self.span.clone(),
            acknowledged: self.acknowledged(),
            alive: self.alive.to_set(),
            landing: self.landing(),
            hears: self.hears.map(Runs::to_set),
            weak: self.weak.iter().collect(),
            asks: self.asks.to_set(),
            to: self.to,
            unicasts: self.unicasts,
            pending: self.pending.to_set(),
            order: self.order.map(bytes::Bytes::copy_from_slice),
        }
    }
}
