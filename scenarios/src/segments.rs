//! Which drones are connected by radio, and since when that has not changed.

use std::collections::{BTreeSet, VecDeque};
use std::time::Duration;

use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;
use muster_transport::sim::Medium;

/// A link is up if it loses at most this share of frames each way.
pub(crate) const UP_LOSS_MAX: f64 = 0.4;
/// It is down if it loses at least this share either way; in between it is grey. Grey links count, since a drone may hear
/// its master now and then over several links that each lose most frames.
const DOWN_LOSS_MIN: f64 = 0.999;
/// The loss of a link that is grey because its frames are late.
const GREY_LOSS: f64 = 0.9;

/// Up to this many members, a segment's diameter is computed exactly, by a search from each.
const EXACT_DIAMETER_MAX: usize = 256;

/// The segments of a swarm at the last look: the groups of nodes that links which are up connect.
///
/// Invariant: `segments`, `segment_of` and `reach` follow from `live`, `links` and `changed`.
#[derive(Debug, Default)]
pub(crate) struct Segments {
    /// For each node that relays frames, a number that changes whenever it has failed; `None` for others.
    live: Vec<Option<u32>>,
    /// Between live nodes, each once, sorted.
    links: Vec<Link>,
    /// Links with one direction down and the other not, sorted. They connect nobody, but a node that begins to hear another
    /// may believe until the next silence that it is heard, too.
    one_way: Vec<Link>,
    /// When each node, or a link of it, last changed.
    changed: Vec<Timestamp>,
    segments: Vec<Segment>,
    /// The index of each node's segment.
    segment_of: Vec<Option<usize>>,
    /// For each node, the lowest one connected with it by links that are up or grey.
    reach: Vec<NodeId>,
    /// Past values of `segment_of`, and from when on each held; the newest last.
    history: VecDeque<(Timestamp, Vec<Option<usize>>)>,
}

/// A link that is not down in both directions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Link {
    /// The lower id first.
    ends: (NodeId, NodeId),
    state: LinkState,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum LinkState {
    Up,
    Grey,
    /// Only this node hears the other.
    OneWay(NodeId),
}

impl Link {
    /// The link between two nodes, by its losses there and back; `None` if both directions are down.
    pub(crate) fn between(a: NodeId, b: NodeId, [forward, backward]: [f64; 2]) -> Option<Self> {
        let state = match (forward < DOWN_LOSS_MIN, backward < DOWN_LOSS_MIN) {
            (true, true) if forward.max(backward) <= UP_LOSS_MAX => LinkState::Up,
            (true, true) => LinkState::Grey,
            (true, false) => LinkState::OneWay(b),
            (false, true) => LinkState::OneWay(a),
            (false, false) => return None,
        };
        let ends = (a.min(b), a.max(b));
        Some(Self { ends, state })
    }

    /// The nodes at its ends; the lower id first.
    pub(crate) const fn ends(&self) -> (NodeId, NodeId) {
        self.ends
    }

    pub(crate) const fn is_up(&self) -> bool {
        matches!(self.state, LinkState::Up)
    }

    const fn is_one_way(&self) -> bool {
        matches!(self.state, LinkState::OneWay(_))
    }

    /// All links of a medium at present; `spoilt` has the shares of a sender's frames that are altered on their way, and that are
    /// late. A link with many late frames is grey, not down: what arrives late may still be believed.
    pub(crate) fn all(medium: &mut Medium, spoilt: impl Fn(NodeId) -> [f64; 2]) -> Vec<Self> {
        let mut links = Vec::new();
        medium.each_link(|a, b, [forward, backward]| {
            let lost = |from, loss: f64| {
                let [altered, late] = spoilt(from);
                let lost = 1.0 - (1.0 - loss) * (1.0 - altered);
                let unheard_in_time = 1.0 - (1.0 - lost) * (1.0 - late);
                lost.max(unheard_in_time.min(GREY_LOSS))
            };
            links.extend(Self::between(a, b, [lost(a, forward), lost(b, backward)]));
        });
        links
    }
}

/// Live nodes that are connected by links that are up.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Segment {
    /// Lowest first.
    pub(crate) members: Vec<NodeId>,
    /// Whether no grey link connects it with others.
    pub(crate) is_decided: bool,
    /// When a member or a link of one last changed.
    pub(crate) unchanged_since: Timestamp,
}

impl Segments {
    /// Updates the segments. `live` has, for each node that relays frames, any number that changes when it fails or does
    /// something else; `None` for others, whose links are left out. Returns whether anything has changed.
    pub(crate) fn look(
        &mut self,
        now: Timestamp,
        live: Vec<Option<u32>>,
        mut links: Vec<Link>,
    ) -> bool {
        let is_live = |id: NodeId| live.get(id.0 as usize).is_some_and(Option::is_some);
        links.retain(|link| is_live(link.ends.0) && is_live(link.ends.1));
        links.sort_unstable();
        let one_way: Vec<_> = links.extract_if(.., |link| link.is_one_way()).collect();
        if live == self.live && links == self.links && one_way == self.one_way {
            return false;
        }
        self.changed.resize(live.len(), now);
        let before = self.live.iter().zip(&live);
        for (changed, _) in self
            .changed
            .iter_mut()
            .zip(before)
            .filter(|(_, it)| it.0 != it.1)
        {
            *changed = now;
        }
        let changed = differing(&self.links, &links).chain(differing(&self.one_way, &one_way));
        for link in changed {
            self.changed[link.ends.0.0 as usize] = now;
            self.changed[link.ends.1.0 as usize] = now;
        }
        self.live = live;
        self.links = links;
        self.one_way = one_way;
        self.divide();
        self.history.push_back((now, self.segment_of.clone()));
        true
    }

    /// Drops history older than `ago`, but for what held at that time.
    pub(crate) fn forget_older(&mut self, now: Timestamp, ago: Duration) {
        while self.history.get(1).is_some_and(|it| now.since(it.0) >= ago) {
            self.history.pop_front();
        }
    }

    /// Whether two nodes have been in the same segment for the time `ago`, or since the first look.
    pub(crate) fn have_been_together(
        &self,
        (a, b): (NodeId, NodeId),
        now: Timestamp,
        ago: Duration,
    ) -> bool {
        let before = self.history.partition_point(|it| now.since(it.0) >= ago);
        let together = |(_, segment_of): &(Timestamp, Vec<Option<usize>>)| {
            let segment = index(segment_of, a);
            segment.is_some() && segment == index(segment_of, b)
        };
        let mut since = self.history.iter().skip(before.saturating_sub(1));
        since.all(together)
    }

    /// A node was heard by another. If the last look found no link between their segments, one has come and perhaps gone since.
    pub(crate) fn heard(&mut self, now: Timestamp, from: NodeId, by: NodeId) {
        let [Some(a), Some(b)] = [from, by].map(|id| index(&self.segment_of, id)) else {
            return;
        };
        let ends = (from.min(by), from.max(by));
        let has = |links: &[Link]| links.binary_search_by_key(&ends, |link| link.ends).is_ok();
        if a != b && !has(&self.links) && !has(&self.one_way) {
            self.links_changed(now, [from, by].into_iter());
        }
    }

    /// Links of these nodes have changed, though the last look found the same ones.
    pub(crate) fn links_changed(&mut self, now: Timestamp, ids: impl Iterator<Item = NodeId>) {
        for id in ids {
            if let Some(changed) = self.changed.get_mut(id.0 as usize) {
                *changed = now;
            }
        }
        self.divide();
    }

    fn divide(&mut self) {
        let up = first_connected(
            self.live.len(),
            self.links.iter().filter(|link| link.is_up()),
        );
        self.reach = first_connected(self.live.len(), self.links.iter());
        self.segments.clear();
        self.segment_of = vec![None; self.live.len()];
        for (id, first) in (0..).map(NodeId).zip(up) {
            let index = id.0 as usize;
            if self.live[index].is_none() {
                continue;
            }
            let segment = *self.segment_of[first.0 as usize].get_or_insert(self.segments.len());
            self.segment_of[index] = Some(segment);
            match self.segments.get_mut(segment) {
                Some(segment) => segment.members.push(id),
                None => self.segments.push(Segment {
                    members: vec![id],
                    is_decided: true,
                    unchanged_since: Timestamp::ZERO,
                }),
            }
        }
        for link in &self.links {
            let [a, b] = [link.ends.0, link.ends.1].map(|id| self.segment_of[id.0 as usize]);
            if let (Some(a), Some(b), true) = (a, b, a != b) {
                self.segments[a].is_decided = false;
                self.segments[b].is_decided = false;
            }
        }
        for segment in &mut self.segments {
            let changes = segment.members.iter().map(|id| self.changed[id.0 as usize]);
            segment.unchanged_since = changes.max().unwrap_or_default();
        }
    }

    /// Whether a link that is up joins two nodes directly.
    pub(crate) fn are_neighbours(&self, a: NodeId, b: NodeId) -> bool {
        let ends = (a.min(b), a.max(b));
        let is_up = |link: &Link| link.ends == ends && link.is_up();
        let first = self.links.partition_point(|link| link.ends < ends);
        self.links.get(first).is_some_and(is_up)
    }

    /// The links that are up or grey, sorted by their ends.
    pub(crate) fn links(&self) -> &[Link] {
        &self.links
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = &Segment> {
        self.segments.iter()
    }

    /// The members of a node's segment, itself included.
    pub(crate) fn segment_of(&self, id: NodeId) -> BTreeSet<NodeId> {
        let segment = index(&self.segment_of, id);
        let members = segment.map_or(&[][..], |segment| &self.segments[segment].members);
        members.iter().copied().chain([id]).collect()
    }

    /// The lowest node that links which are up or grey connect with a node, over others too; may be itself.
    pub(crate) fn first_connected_with(&self, id: NodeId) -> NodeId {
        self.reach.get(id.0 as usize).copied().unwrap_or(id)
    }

    /// Whether links that are up or grey connect two nodes, over others too. A node is connected with itself.
    pub(crate) fn are_connected(&self, a: NodeId, b: NodeId) -> bool {
        a == b
            || self.first_connected_with(a) == self.first_connected_with(b)
                && self.is_live(a)
                && self.is_live(b)
    }

    fn is_live(&self, id: NodeId) -> bool {
        self.live.get(id.0 as usize).is_some_and(Option::is_some)
    }

    /// The most hops between any two members of a segment, over links that are up; of a large segment an upper bound, at
    /// most twice that.
    pub(crate) fn diameter(&self, segment: &Segment) -> u32 {
        let mut neighbours = vec![Vec::new(); self.live.len()];
        for link in self.links.iter().filter(|link| link.is_up()) {
            neighbours[link.ends.0.0 as usize].push(link.ends.1);
            neighbours[link.ends.1.0 as usize].push(link.ends.0);
        }
        if segment.members.len() > EXACT_DIAMETER_MAX {
            return 2 * farthest(&neighbours, segment.members[0]);
        }
        let hops = segment.members.iter().map(|id| farthest(&neighbours, *id));
        hops.max().unwrap_or(0)
    }
}

/// The index of a node's segment. `None` if it relays no frames.
fn index(segment_of: &[Option<usize>], id: NodeId) -> Option<usize> {
    segment_of.get(id.0 as usize).copied().flatten()
}

/// The most hops from a node to any other.
fn farthest(neighbours: &[Vec<NodeId>], from: NodeId) -> u32 {
    let mut hops = vec![None; neighbours.len()];
    hops[from.0 as usize] = Some(0);
    let mut to_visit = VecDeque::from([(from, 0)]);
    let mut most = 0;
    while let Some((id, so_far)) = to_visit.pop_front() {
        most = so_far;
        for other in &neighbours[id.0 as usize] {
            let known = &mut hops[other.0 as usize];
            if known.is_none() {
                *known = Some(so_far + 1);
                to_visit.push_back((*other, so_far + 1));
            }
        }
    }
    most
}

/// For each of `nodes`, the lowest node that `links` connect it with.
fn first_connected<'a>(nodes: usize, links: impl Iterator<Item = &'a Link>) -> Vec<NodeId> {
    fn first(of: &mut [NodeId], mut id: NodeId) -> NodeId {
        while of[id.0 as usize] != id {
            // Path compression.
            of[id.0 as usize] = of[of[id.0 as usize].0 as usize];
            id = of[id.0 as usize];
        }
        id
    }
    let mut of: Vec<NodeId> = (0..).map(NodeId).take(nodes).collect();
    for link in links {
        let (a, b) = (first(&mut of, link.ends.0), first(&mut of, link.ends.1));
        of[a.max(b).0 as usize] = a.min(b);
    }
    for id in (0..).map(NodeId).take(nodes) {
        of[id.0 as usize] = first(&mut of, id);
    }
    of
}

/// The links that are in only one of two sorted lists.
fn differing<'a>(a: &'a [Link], b: &'a [Link]) -> impl Iterator<Item = &'a Link> {
    let only = |these: &'a [Link], those: &'a [Link]| {
        let is_only_here = move |link: &&Link| those.binary_search(link).is_err();
        these.iter().filter(is_only_here)
    };
    only(a, b).chain(only(b, a))
}

#[cfg(test)]
pub(crate) mod tests;
