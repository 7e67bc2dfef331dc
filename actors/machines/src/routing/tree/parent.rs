//! Which neighbour leads to the master: the route with the fewest expected transmissions, without loops.
//!
//! Each drone announces its route's label: the master's heartbeat sequence that came with the route, and its cost. A label
//! is nearer than another if its sequence is newer or, of two equal sequences, its cost is lower. A drone keeps the nearest
//! label that it ever announced, its distance, and takes a parent only if what that announces is nearer (the feasibility
//! condition of EIGRP and Babel, RFC 8966, 2.4).
//!
//! **No loops.** Along a route distances get nearer at each hop. A drone that takes a parent then announces the parent's
//! sequence at a higher cost, so its distance is farther than the parent's announcement, which is no nearer than the
//! parent's distance. What changes later keeps that: the parent's distance only gets nearer, and the drone's own follows
//! nothing but the parent's announcements. A loop would be nearer than itself. A drone that restarted has forgotten its
//! distance and takes none but newer sequences than it remembers; what it may close in spite of that opens with the next
//! heartbeat, which comes from the master only.

use std::time::Duration;

use super::link::Link;
use super::link_table::LinkTable;
use crate::flaw::{self, Flaw};
use crate::identity::NodeId;
use crate::routing::{ETX_UNIT, Routes};
use crate::time::Timestamp;

/// By how much another route must be cheaper to be taken, so that routes do not flap: half the threshold of MRHOF
/// (RFC 6719, section 5: 1.5 expected transmissions), whose links are measured over longer.
const HYSTERESIS: u16 = ETX_UNIT * 3 / 4;

/// The route to the master.
///
/// Invariant: no label was ever announced, in this leader epoch, that is nearer than `distance`.
#[derive(Debug)]
pub(super) struct ParentSelection {
    own: NodeId,
    beacon: Duration,
    routes: Routes,
    label: Label,
    distance: Label,
    /// The parent, as long as nothing but its silence speaks against it and it was not stale when it was chosen.
    good_parent: Option<GoodParent>,
    /// Since when there is no route.
    orphaned_since: Option<Timestamp>,
}

/// How near to the master a route is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Label {
    heartbeat: u32,
    cost: u16,
}

impl Label {
    /// Of a drone that has never had a route.
    const FARTHEST: Self = Self {
        heartbeat: 0,
        cost: u16::MAX,
    };

    const fn is_nearer_than(self, other: Self) -> bool {
        self.heartbeat > other.heartbeat
            || self.heartbeat == other.heartbeat && self.cost < other.cost
    }
}

/// A parent that there is no reason to leave, so that its link need not be looked at each time.
#[derive(Debug, Clone, Copy)]
struct GoodParent {
    /// From when on it is stale, unless it is heard.
    stale_at: Timestamp,
}

/// What an update of the route has changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Moved {
    /// Something that can be seen from outside.
    pub(super) routes: bool,
    /// The parent, or how far the master is.
    pub(super) hops_or_parent: bool,
}

/// Who this drone is in its swarm, as far as its route depends on that.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    pub(super) is_master: bool,
    /// The current leader.
    pub(super) master: Option<NodeId>,
    /// The newest heartbeat sequence that was heard of.
    pub(super) heartbeat: u32,
    /// Whether beacons are so quick that most neighbours are left out for a moment under a new master, as few have spoken.
    pub(super) are_beacons_quick: bool,
}

impl ParentSelection {
    pub(super) fn new(own: NodeId, beacon: Duration) -> Self {
        Self {
            own,
            beacon,
            routes: Routes::default(),
            label: Label::FARTHEST,
            distance: Label::FARTHEST,
            good_parent: None,
            orphaned_since: None,
        }
    }

    /// After a restart: nothing as old as `heartbeat` is taken for a route, for it may lead through this drone.
    pub(super) const fn resume(&mut self, heartbeat: u32) {
        self.distance = Label { heartbeat, cost: 0 };
    }

    /// Forgets the route to another master.
    pub(super) fn begin_epoch(&mut self) {
        *self = Self::new(self.own, self.beacon);
    }

    pub(super) const fn routes(&self) -> &Routes {
        &self.routes
    }

    pub(super) const fn parent(&self) -> Option<NodeId> {
        self.routes.parent
    }

    /// Expected transmissions to the master; 0 without a route.
    pub(super) fn cost(&self) -> u16 {
        self.routes.hops.map_or(0, |_| self.label.cost)
    }

    /// By how much the heartbeat sequence of the route is older than `heartbeat`.
    pub(super) fn lag(&self, heartbeat: u32) -> u32 {
        match self.routes.hops {
            Some(1..) => heartbeat.saturating_sub(self.label.heartbeat),
            _ => 0,
        }
    }

    /// The heartbeat sequence that came with the route.
    #[cfg(test)]
    pub(super) const fn label_heartbeat(&self) -> u32 {
        self.label.heartbeat
    }

    /// Since when there is no route, unless this drone leads.
    pub(super) const fn orphaned_since(&self) -> Option<Timestamp> {
        self.orphaned_since
    }

    /// The time without a route begins anew.
    pub(super) fn forgive(&mut self, now: Timestamp) {
        self.orphaned_since = self.orphaned_since.map(|_| now);
    }

    /// When the parent is silent for so long that it is to be probed.
    pub(super) fn stale_at(&self, links: &LinkTable) -> Option<Timestamp> {
        match self.good_parent {
            Some(parent) => Some(parent.stale_at),
            None => Some(links.get(self.routes.parent?)?.stale_at(self.beacon)),
        }
    }

    /// Something about the parent's link has changed, and its route has not.
    pub(super) fn look_at_parent_again(&mut self, links: &LinkTable) {
        if self.good_parent.is_some() {
            self.good_parent = self.look_at_parent(links);
        }
    }

    /// The parent, unless something speaks against it, or it is out of reach.
    fn look_at_parent(&self, links: &LinkTable) -> Option<GoodParent> {
        let link = links.get(self.routes.parent?)?;
        let is_sound = link.symmetric && link.is_reachable() && link.has_route_past(self.own);
        is_sound.then(|| GoodParent {
            stale_at: link.stale_at(self.beacon),
        })
    }

    /// Whether a neighbour that has just spoken, whose own route is what it was, leaves this drone's as it is: it is the
    /// parent or no better than that, and the parent is as good as when it was chosen. A neighbour that is better by now
    /// without having spoken is taken when it speaks next.
    pub(super) fn keeps_route(&self, now: Timestamp, sender: &Link) -> bool {
        self.good_parent.is_some_and(|parent| {
            let is_cheaper = || {
                let cost = self.cost_through(sender);
                cost.is_some_and(|cost| cost.saturating_add(HYSTERESIS) <= self.label.cost)
            };
            now <= parent.stale_at && (self.routes.parent == Some(sender.id) || !is_cheaper())
        })
    }

    /// The parent has announced a newer heartbeat sequence and nothing else.
    pub(super) fn follow_parent(&mut self, links: &LinkTable) {
        if let Some(link) = self.routes.parent.and_then(|parent| links.get(parent))
            && let Some(cost) = self.cost_through(link)
        {
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

    /// Chooses the parent anew: of the neighbours whose route can't lead through this drone the one with the cheapest
    /// route over links that are not poor; the one it has, unless another is cheaper by more than [`HYSTERESIS`]. Nor does
    /// it take one that leaves it out of those that it hears, though it may only have restarted: the parent that it has it
    /// keeps for a beacon then. A parent that is silent or out of reach it leaves if there is any other.
    pub(super) fn update(&mut self, now: Timestamp, place: Place, links: &LinkTable) -> Moved {
        let mut routes = Routes {
            relay: links.has_children(),
            ..Routes::default()
        };
        if place.is_master {
            routes.hops = Some(0);
            self.orphaned_since = None;
            self.label = Label {
                heartbeat: place.heartbeat,
                cost: 0,
            };
        } else {
            let best = self.best(now, place, links);
            routes.parent = best.map(|link| link.id);
            routes.hops = best
                .and_then(|link| link.said.hops)
                .map(|hops| hops.saturating_add(1));
            routes.out_of_range = place
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
        let moved = Moved {
            routes: routes != self.routes,
            hops_or_parent: (routes.hops, routes.parent) != (self.routes.hops, self.routes.parent),
        };
        if moved.routes {
            self.routes = routes;
        }
        self.good_parent = (self.look_at_parent(links)).filter(|it| now <= it.stale_at);
        moved
    }

    /// What the route costs through a neighbour; `None` if that has none.
    fn cost_through(&self, link: &Link) -> Option<u16> {
        if flaw::has(Flaw::RoutesByHops) {
            return Some(ETX_UNIT.saturating_mul(link.said.hops?.saturating_add(1)));
        }
        link.cost_through()
    }

    fn best<'a>(&self, now: Timestamp, place: Place, links: &'a LinkTable) -> Option<&'a Link> {
        let leads_on = |link: &Link| link.symmetric && link.has_route_past(self.own);
        let current = self.routes.parent.and_then(|parent| links.get(parent));
        let is_at_hand = |link: &Link| link.is_reachable() && !link.is_stale(now, self.beacon);
        let kept = current.filter(|link| leads_on(link) && is_at_hand(link));
        let is_left_out_by = |link: &Link| link.leaves_out() && !place.are_beacons_quick;
        let is_feasible = |link: &Link| {
            let label = Label {
                heartbeat: link.route_heartbeat(),
                cost: link.said.cost,
            };
            label.is_nearer_than(self.distance) || flaw::has(Flaw::TakesFartherParents)
        };
        // One that may have been heard by chance is no better than a parent that is silent: that is probed first.
        let has_parent = current.is_some_and(|link| leads_on(link) && link.is_reachable());
        let by_hops = flaw::has(Flaw::RoutesByHops);
        let others = links.iter().filter(|link| {
            Some(link.id) != self.routes.parent
                && leads_on(link)
                && is_at_hand(link)
                && !is_left_out_by(link)
                && is_feasible(link)
                && (link.quality.is_proven() || !has_parent || by_hops)
        });
        // Poor links last, then by cost; what is not taken for the first time has its hysteresis.
        let rated = |link: &'a Link, hysteresis: u16| {
            let cost = self.cost_through(link)?;
            let is_poor = link.quality.is_poor() && !by_hops;
            Some(((is_poor, cost.saturating_add(hysteresis), link.id), link))
        };
        let best = others
            .filter_map(|link| rated(link, if kept.is_some() { HYSTERESIS } else { 0 }))
            .chain(kept.and_then(|link| rated(link, 0)))
            .min_by_key(|(rate, _)| *rate);
        let best = best.map(|(_, link)| link);
        // A silent parent is better than none: it is being probed.
        best.or_else(|| current.filter(|link| leads_on(link)))
    }
}

#[cfg(test)]
mod tests;
