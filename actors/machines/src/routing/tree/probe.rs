//! Whether the parent is still there: a drone that has not heard it for a while probes it, the more often the more the
//! link loses. Only if it answers none of the probes, and nobody near has heard more of the master, the master is missed.
//!
//! Each drone watches its own link only. Drones farther out hear from their parents, which live, what has become of the
//! master; so nobody waits for as long as heartbeats may be lost over all hops together.

use std::time::Duration;

use super::Config;
use super::link::Link;
use super::link_table::LinkTable;
use super::quality::{PROBES_MAX, STALE_BEACONS_MAX};
use crate::identity::NodeId;
use crate::routing::core::Core;
use crate::time::Timestamp;

/// How often a drone without a route asks all that are near, before it misses the master; if some of them have a route, as far
/// as it knows. It asks on until then if all rests on one answer.
const INQUIRIES: u32 = 3;
/// A pause between two of them is this part of the time without a route, so that who waits for long asks ever more seldom.
const INQUIRY_BACK_OFF: u32 = 16;

/// For how many repairs a parent is probed at least over a link that loses [`BURSTY`] or more, for its losses may come in
/// bursts: 300 ms at 8 ms a repair, as bursts of 20 ms in the mean last once in a few hundred thousand times. Over one that loses
/// less, for a part of that.
const BURST_REPAIRS: u32 = 37;
/// See there.
const BURSTY: f64 = 0.06;

/// A parent that is being probed.
///
/// Invariant: the next probe is due after the step in which the last one was sent.
#[derive(Debug, Default)]
pub(super) struct ParentProbe {
    probe: Option<Probe>,
    /// The last parent, if it answered no probe: it is asked on.
    left: Option<NodeId>,
    /// Whether nobody else was heard then, or nobody yet since a restart.
    is_alone: bool,
    /// How often all that are near were asked since there is no route, and when they are asked next.
    inquiries: Option<(u32, Timestamp)>,
}

#[derive(Debug, Clone, Copy)]
struct Probe {
    parent: NodeId,
    /// When it was last heard.
    heard_at: Timestamp,
    due: Timestamp,
    sent: u32,
}

/// What a drone does that does not hear its parent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Step {
    /// Sends the first probe, or another one.
    Probe { is_first: bool },
    /// Leaves a parent that has answered none.
    Leave(NodeId),
    /// Asks all that are near.
    Inquire,
    /// Misses the master.
    Miss,
}

impl Config {
    /// How long a drone takes at most, from when it last heard a parent that is gone, until the master is missed: until
    /// the parent is probed, until it has not answered, both once more for another route that turns out to be gone too,
    /// and until nobody near has heard more of the master, nor hears its next heartbeat.
    #[must_use]
    pub fn detection(&self) -> Duration {
        self.probing_max() * 2 + self.patience + self.beacon
    }

    /// How long it takes at most until a parent that is gone is left.
    fn probing_max(&self) -> Duration {
        self.beacon * STALE_BEACONS_MAX.into() + self.repair * 2 * PROBES_MAX
    }
}

impl ParentProbe {
    /// After a restart: whoever is near has yet to be heard.
    pub(super) const fn resume(&mut self) {
        self.is_alone = true;
    }

    /// Whatever was found out counts no more.
    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }

    /// When the parent, heard last as `links` says, is probed next: `stale_at` for the first time; or when the next step is
    /// that a drone takes without a parent, since `orphaned_since`.
    pub(super) fn deadline(
        &self,
        core: &Core,
        links: &LinkTable,
        route: Route,
        config: &Config,
    ) -> Option<Timestamp> {
        if core.durable.landing.is_some() || core.durable.stopped {
            return None;
        }
        let Some(parent) = route.parent else {
            let since = route.orphaned_since.filter(|_| !core.misses_master())?;
            let missed_at = self.missed_at(since, links, config);
            let (asked, due) = self.inquiries.unwrap_or((0, since));
            let inquiry = (asked < self.inquiries_max(links)).then_some(due);
            return Some(inquiry.map_or(missed_at, |due| due.min(missed_at)));
        };
        match self.current(parent, links) {
            Some(probe) => Some(probe.due),
            None => route.stale_at,
        }
    }

    /// How often a drone without a route asks. All rests on one answer if one other only has a route, or is heard at all, and if
    /// the parent that answered no probe may be there.
    fn inquiries_max(&self, links: &LinkTable) -> u32 {
        match links.with_routes().count() {
            _ if self.left.is_some() || links.len() == 1 => u32::MAX,
            0 => 0,
            1 => u32::MAX,
            _ => INQUIRIES,
        }
    }

    /// When a drone misses the master that has no route since `since`. Where neighbours have one that it can't take, as it
    /// costs more than its own did under the same heartbeat, the next heartbeat brings it: unless the parent is gone, for
    /// then the master may be. And one that hears one other only is in no hurry: it waits for as long as that one may take
    /// until it probes its own parent. Nor is one that hears nobody, for it would lead nobody: whom it does not hear may be
    /// about to return.
    fn missed_at(&self, since: Timestamp, links: &LinkTable, config: &Config) -> Timestamp {
        if self.is_alone {
            return since + config.patience + config.probing_max();
        }
        let mut others = links.with_routes();
        let heartbeats = if links.len() == 1 && others.next().is_some() {
            STALE_BEACONS_MAX
        } else {
            u16::from(self.left.is_none() && others.any(|link| link.symmetric))
        };
        since + config.patience + config.beacon * heartbeats.into()
    }

    /// Whom a drone without a route asks, but for those whom it hears.
    pub(super) const fn left(&self) -> Option<NodeId> {
        self.left
    }

    /// Unless the parent has been heard since, or is another one by now.
    fn current(&self, parent: NodeId, links: &LinkTable) -> Option<Probe> {
        let probe = self.probe?;
        let heard_at = links.get(parent)?.heard_at;
        (probe.parent == parent && probe.heard_at == heard_at).then_some(probe)
    }

    /// Takes the next step, which is due.
    pub(super) fn step(
        &mut self,
        core: &mut Core,
        links: &LinkTable,
        route: Route,
        (now, config): (Timestamp, &Config),
    ) -> Option<Step> {
        let Some(parent) = route.parent else {
            let since = route.orphaned_since?;
            if now >= self.missed_at(since, links, config) {
                (self.inquiries, self.left) = (None, None);
                return Some(Step::Miss);
            }
            let asked = self.inquiries.map_or(0, |it| it.0);
            let pause = config.repair.max(now.since(since) / INQUIRY_BACK_OFF);
            let pause = pause + core.jitter(pause);
            self.inquiries = Some((asked + 1, now + pause));
            return Some(Step::Inquire);
        };
        (self.inquiries, self.left, self.is_alone) = (None, None, false);
        let link = links.get(parent)?;
        let sent = self.current(parent, links).map_or(0, |it| it.sent);
        let is_alone = is_alone_with(parent, links);
        let probes = if is_alone {
            PROBES_MAX
        } else {
            link.quality.probes()
        };
        if sent >= probes {
            (self.probe, self.left, self.is_alone) = (None, Some(parent), is_alone);
            return Some(Step::Leave(parent));
        }
        let bursty = (link.quality.long_loss() / BURSTY).min(1.0);
        // With its jitter a pause takes half as long again in the mean over a link that loses much, and else a quarter.
        let pause = (config.repair * BURST_REPAIRS * 2 / (3 * probes)).mul_f64(bursty);
        let pause = pause.max(config.repair);
        let jitter = pause.mul_f64(f64::midpoint(1.0, bursty));
        self.probe = Some(Probe {
            parent,
            heard_at: link.heard_at,
            due: now + pause + core.jitter(jitter),
            sent: sent + 1,
        });
        Some(Step::Probe {
            is_first: sent == 0,
        })
    }
}

/// Whether a drone hears nobody but its parent; those apart that it hears seldom, or has heard by chance. If it leaves that
/// one, it leaves the swarm, and would lead nobody but itself: it is in no hurry.
fn is_alone_with(parent: NodeId, links: &LinkTable) -> bool {
    let is_company = |link: &Link| link.quality.is_proven() && !link.quality.is_poor();
    !links
        .iter()
        .any(|link| link.id != parent && is_company(link))
}

/// The route that is watched.
#[derive(Debug, Clone, Copy)]
pub(super) struct Route {
    pub(super) parent: Option<NodeId>,
    pub(super) stale_at: Option<Timestamp>,
    pub(super) orphaned_since: Option<Timestamp>,
}

#[cfg(test)]
mod tests;
