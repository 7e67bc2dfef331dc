//! Chooses the parent: the next hop of the route with the fewest expected transmissions, without loops.
//!
//! Each drone announces the label of its route: the heartbeat sequence that came with it, and its cost. A label is
//! nearer than another if its sequence is newer or, of two equal sequences, its cost is lower. A drone's distance is
//! the nearest label that it ever announced. It takes a neighbour as parent only if the neighbour's label is nearer
//! than that distance (the feasibility condition of EIGRP and Babel, RFC 8966, 2.4).
//!
//! **No loops.** Distances get nearer at each hop of a route. A drone that takes a parent announces the parent's
//! sequence at a higher cost. So its distance is farther than the parent's announcement, which is no nearer than the
//! parent's distance. Later changes keep that: the parent's distance only gets nearer, and the drone's own follows the
//! parent's announcements. A drone on a loop would be nearer than itself. A restarted drone has forgotten its distance
//! and accepts only sequences that are newer than its checkpoint's. A loop that this allows opens with the next
//! heartbeat, which comes from the master only.

use std::time::Duration;

use super::Config;
use super::link::Neighbour;
use super::link_table::LinkTable;
use crate::flaw::{self, Flaw};
use crate::identity::NodeId;
use crate::routing::{ETX_UNIT, Routes};
use crate::time::Timestamp;

/// A new route must be cheaper by this, so that routes do not flap: half the threshold of MRHOF (RFC 6719, section 5:
/// 1.5 expected transmissions), which measures links for longer.
const HYSTERESIS: u16 = ETX_UNIT * 3 / 4;

/// Leaf periods for which a parent's reports may leave out this drone: the parent sends within 1.4 of them.
const UNCOUNTED_LEAF_PERIODS: u32 = 2;

/// The route to the master.
///
/// Invariant: no label nearer than `distance` was announced in this leader epoch.
#[derive(Debug)]
pub(super) struct ParentSelection {
    own: NodeId,
    heartbeat_period: Duration,
    /// A parent is stale if its reports have left out this drone for longer. `None` for a pure relay, which reports never
    /// contain.
    uncounted_max: Option<Duration>,
    routes: Routes,
    label: Label,
    /// When the parent was chosen, or last reported that this drone is in its subtree.
    counted_at: Timestamp,
    distance: Label,
    /// `Some` if the parent was not stale when chosen, and nothing but silence speaks against it.
    sound_parent: Option<SoundParent>,
    /// Since when there is no route.
    orphaned_since: Option<Timestamp>,
}

/// Distance of a route to the master.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Label {
    heartbeat: u32,
    cost: u16,
}

impl Label {
    /// Label of a drone that never had a route.
    const FARTHEST: Self = Self {
        heartbeat: 0,
        cost: u16::MAX,
    };

    const fn is_nearer_than(self, other: Self) -> bool {
        self.heartbeat > other.heartbeat
            || self.heartbeat == other.heartbeat && self.cost < other.cost
    }
}

/// A parent that stays until it is stale, so its link need not be checked with each frame.
#[derive(Debug, Clone, Copy)]
struct SoundParent {
    /// When it becomes stale, unless it is heard before.
    stale_at: Timestamp,
}

/// What an update of the route changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct RouteChange {
    /// Any field of the routes.
    pub(super) routes: bool,
    /// The parent, or the number of hops.
    pub(super) hops_or_parent: bool,
}

/// What a route depends on besides the links.
#[derive(Debug, Clone, Copy)]
pub(super) struct RouteContext {
    pub(super) is_master: bool,
    /// The current leader.
    pub(super) master: Option<NodeId>,
    /// Highest known heartbeat sequence.
    pub(super) heartbeat: u32,
    /// Whether leaves do not send each heartbeat. Then most reports omit some neighbours at the start of an epoch.
    pub(super) throttles_leaves: bool,
}

impl ParentSelection {
    pub(super) fn new(config: &Config) -> Self {
        let is_relay = config.id.0 >= config.drones;
        Self {
            own: config.id,
            heartbeat_period: config.heartbeat_period,
            uncounted_max: (!is_relay).then(|| config.leaf_period() * UNCOUNTED_LEAF_PERIODS),
            routes: Routes::default(),
            label: Label::FARTHEST,
            counted_at: Timestamp::ZERO,
            distance: Label::FARTHEST,
            sound_parent: None,
            orphaned_since: None,
        }
    }

    /// After a restart: routes no newer than `heartbeat` are rejected, because they may lead through this drone.
    pub(super) const fn resume(&mut self, heartbeat: u32) {
        self.distance = Label { heartbeat, cost: 0 };
    }

    /// Forgets the route to the master before.
    pub(super) fn start_epoch(&mut self) {
        self.routes = Routes::default();
        (self.label, self.distance) = (Label::FARTHEST, Label::FARTHEST);
        (self.sound_parent, self.orphaned_since) = (None, None);
    }

    pub(super) const fn routes(&self) -> &Routes {
        &self.routes
    }

    pub(super) const fn parent(&self) -> Option<NodeId> {
        self.routes.parent
    }

    /// Expected transmissions to the master, in [`ETX_UNIT`]s; 0 without a route.
    pub(super) fn cost(&self) -> u16 {
        self.routes.hops.map_or(0, |_| self.label.cost)
    }

    /// By how many heartbeats the route is older than `heartbeat`.
    pub(super) fn lag(&self, heartbeat: u32) -> u32 {
        match self.routes.hops {
            Some(1..) => heartbeat.saturating_sub(self.label.heartbeat),
            _ => 0,
        }
    }

    /// Heartbeat sequence of the route.
    #[cfg(test)]
    pub(super) const fn label_heartbeat(&self) -> u32 {
        self.label.heartbeat
    }

    /// Since when there is no route; `None` on the master.
    pub(super) const fn orphaned_since(&self) -> Option<Timestamp> {
        self.orphaned_since
    }

    /// Restarts the time without a route.
    pub(super) fn reset_timeouts(&mut self, now: Timestamp) {
        self.orphaned_since = self.orphaned_since.map(|_| now);
    }

    /// When the parent becomes stale, so that it is probed; `None` without a parent.
    pub(super) fn stale_at(&self, links: &LinkTable) -> Option<Timestamp> {
        match self.sound_parent {
            Some(parent) => Some(parent.stale_at),
            None => Some(self.parent_stale_at(links.get(self.routes.parent?)?)),
        }
    }

    /// When the parent becomes stale: after silence, or when its reports have left out this drone, which it may not hear.
    fn parent_stale_at(&self, parent: &Neighbour) -> Timestamp {
        let silent_at = parent.stale_at(self.heartbeat_period);
        match self.uncounted_max {
            Some(max) if !parent.report.counts_own => silent_at.min(self.counted_at + max),
            _ => silent_at,
        }
    }

    /// The parent's link has changed, but not its route.
    pub(super) fn refresh_parent(&mut self, links: &LinkTable) {
        if self.sound_parent.is_some() {
            self.sound_parent = self.check_parent(links);
        }
    }

    /// The parent, unless it is unreachable, one-way or without route.
    fn check_parent(&self, links: &LinkTable) -> Option<SoundParent> {
        let link = links.get(self.routes.parent?)?;
        let is_sound =
            link.hearing().is_symmetric() && link.is_reachable() && link.has_route_past(self.own);
        is_sound.then(|| SoundParent {
            stale_at: self.parent_stale_at(link),
        })
    }

    /// Whether the route stays as it is after a frame of `sender` whose own route did not change. It does if the parent
    /// is sound, and the sender is the parent or no better. A neighbour that becomes better without sending is
    /// considered at its next frame.
    pub(super) fn keeps_route(&self, now: Timestamp, sender: &Neighbour) -> bool {
        self.sound_parent.is_some_and(|parent| {
            let is_cheaper = || {
                let cost = self.cost_through(sender);
                cost.is_some_and(|cost| cost.saturating_add(HYSTERESIS) <= self.label.cost)
            };
            now <= parent.stale_at && (self.routes.parent == Some(sender.id) || !is_cheaper())
        })
    }

    /// The parent was heard. Announces the label that its newest heartbeat sequence gives.
    pub(super) fn follow_parent(&mut self, links: &LinkTable) {
        let Some(link) = self.routes.parent.and_then(|parent| links.get(parent)) else {
            return;
        };
        if link.report.counts_own {
            self.counted_at = link.heard_at;
        }
        if let Some(cost) = self.cost_through(link) {
            self.announce(Label {
                heartbeat: link.route_heartbeat(),
                cost,
            });
        }
    }

    fn announce(&mut self, label: Label) {
        self.label = label;
        if label.is_nearer_than(self.distance) {
            self.distance = label;
        }
    }

    /// Chooses the parent again: the feasible neighbour with the cheapest route, over links that are not poor if
    /// possible.
    ///
    /// The current parent stays unless another is cheaper by more than [`HYSTERESIS`]. A stale or unreachable parent is
    /// left if there is any other. A neighbour whose reports omit this drone is not chosen; if it is the current
    /// parent, it may only have restarted and stays until its link becomes one-way.
    pub(super) fn update(
        &mut self,
        now: Timestamp,
        context: RouteContext,
        links: &LinkTable,
    ) -> RouteChange {
        let mut routes = Routes {
            relay: links.has_children(),
            ..Routes::default()
        };
        if context.is_master {
            routes.hops = Some(0);
            self.orphaned_since = None;
            self.label = Label {
                heartbeat: context.heartbeat,
                cost: 0,
            };
        } else {
            let best = self.best(now, context, links);
            routes.parent = best.map(|link| link.id);
            routes.hops = best
                .and_then(|link| link.report.hops)
                .map(|hops| hops.saturating_add(1));
            routes.out_of_range = context
                .master
                .is_none_or(|master| links.get(master).is_none());
            match best {
                Some(link) => {
                    self.orphaned_since = None;
                    if let Some(cost) = self.cost_through(link) {
                        self.announce(Label {
                            heartbeat: link.route_heartbeat(),
                            cost,
                        });
                    }
                }
                None => {
                    self.orphaned_since.get_or_insert(now);
                }
            }
        }
        let change = RouteChange {
            routes: routes != self.routes,
            hops_or_parent: (routes.hops, routes.parent) != (self.routes.hops, self.routes.parent),
        };
        if routes.parent != self.routes.parent {
            self.counted_at = now;
        }
        if change.routes {
            self.routes = routes;
        }
        self.sound_parent = (self.check_parent(links)).filter(|it| now <= it.stale_at);
        change
    }

    /// Cost of the route through a neighbour; `None` if it has no route.
    fn cost_through(&self, link: &Neighbour) -> Option<u16> {
        if flaw::has(Flaw::RoutesByHops) {
            return Some(ETX_UNIT.saturating_mul(link.report.hops?.saturating_add(1)));
        }
        link.cost_through()
    }

    fn best<'a>(
        &self,
        now: Timestamp,
        context: RouteContext,
        links: &'a LinkTable,
    ) -> Option<&'a Neighbour> {
        let is_usable =
            |link: &Neighbour| link.hearing().is_symmetric() && link.has_route_past(self.own);
        let current = self.routes.parent.and_then(|parent| links.get(parent));
        let is_live =
            |link: &Neighbour| link.is_reachable() && !link.is_stale(now, self.heartbeat_period);
        let live_parent = (current.filter(|link| is_usable(link) && link.is_reachable()))
            .filter(|link| now <= self.parent_stale_at(link));
        let lost_this_drone =
            |link: &Neighbour| link.hearing().lost_this_drone() && !context.throttles_leaves;
        let is_feasible = |link: &Neighbour| {
            let label = Label {
                heartbeat: link.route_heartbeat(),
                cost: link.report.cost,
            };
            label.is_nearer_than(self.distance) || flaw::has(Flaw::SkipsFeasibilityCondition)
        };
        // A neighbour heard by chance is no better than a stale parent, which is probed first.
        let has_parent = current.is_some_and(|link| is_usable(link) && link.is_reachable());
        let by_hops = flaw::has(Flaw::RoutesByHops);
        let others = links.iter().filter(|link| {
            Some(link.id) != self.routes.parent
                && is_usable(link)
                && is_live(link)
                && !lost_this_drone(link)
                && is_feasible(link)
                && (link.quality.is_proven() || !has_parent || by_hops)
        });
        // Poor links last, then by cost. Neighbours other than the current parent pay the hysteresis.
        let rate = |link: &'a Neighbour, hysteresis: u16| {
            let cost = self.cost_through(link)?;
            let is_poor = link.quality.is_poor() && !by_hops;
            Some(((is_poor, cost.saturating_add(hysteresis), link.id), link))
        };
        let best = others
            .filter_map(|link| rate(link, if live_parent.is_some() { HYSTERESIS } else { 0 }))
            .chain(live_parent.and_then(|link| rate(link, 0)))
            .min_by_key(|(rate, _)| *rate);
        let best = best.map(|(_, link)| link);
        // A stale parent is a poor link is better than none; it is being probed.
        best.or_else(|| current.filter(|link| is_usable(link)))
    }
}

#[cfg(test)]
mod tests;
