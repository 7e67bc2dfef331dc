//! Supervises the parent: a drone probes a silent parent, more often over a lossy link. The master counts as silent
//! only if the parent answers no probe and no neighbour has heard a newer heartbeat.
//!
//! Each drone supervises its own link only. Drones farther out learn of the loss from their own live parents. So no
//! drone waits as long as heartbeats may be lost over all hops together.

use std::time::Duration;

use super::Config;
use super::link::Neighbour;
use super::link_table::LinkTable;
use super::quality::{PROBES_MAX, STALE_HEARTBEATS_MAX};
use crate::identity::NodeId;
use crate::routing::shared::SharedState;
use crate::time::Timestamp;

/// Number of inquiries of a drone without a route whose neighbours have some. It inquires without limit if all depends
/// on one answer.
const INQUIRIES: u32 = 3;
/// Pause between two inquiries, as a fraction of the time without a route, so that inquiries get rarer.
const INQUIRY_BACK_OFF: u32 = 16;

/// Shortest duration of probing, in repair intervals, over a link with a loss of [`BURSTY`] or more, whose losses may
/// come in bursts: 300 ms at 8 ms per repair. Bursts of 20 ms on average last that long once in a few hundred thousand.
/// Less loss shortens it in proportion.
const BURST_REPAIRS: u32 = 37;
/// Loss from which on probing lasts for [`BURST_REPAIRS`].
const BURSTY: f64 = 0.06;

/// Probes of the parent, and inquiries without one.
///
/// Invariant: the next probe is due after the step that sent the last one.
#[derive(Debug, Default)]
pub(super) struct ParentProbe {
    probe: Option<Probe>,
    /// The last parent, if it answered no probe; inquiries ask it, too.
    dropped_parent: Option<NodeId>,
    /// Whether no other neighbour was heard when the parent was dropped, or none since a restart.
    is_isolated: bool,
    /// Number of inquiries since there is no route, and when the next is due.
    inquiries: Option<(u32, Timestamp)>,
}

#[derive(Debug, Clone, Copy)]
struct Probe {
    parent: NodeId,
    /// When the parent was last heard.
    heard_at: Timestamp,
    due: Timestamp,
    sent: u32,
}

/// A step in the supervision of the parent and the master.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ProbeStep {
    /// Probe the parent.
    Probe { is_first: bool },
    /// Drop a parent that has answered no probe.
    DropParent(NodeId),
    /// Ask all neighbours for a route.
    Inquire,
    /// Report the master as silent.
    ReportMasterSilent,
}

impl Config {
    /// Longest time from the last frame of a lost parent until the master is reported as silent: until the parent is
    /// stale and has not answered, the same again for another route that is lost, too, and until no neighbour has a
    /// newer heartbeat.
    #[must_use]
    pub fn detection_max(&self) -> Duration {
        self.probing_max() * 2 + self.route_timeout + self.heartbeat_period
    }

    /// Longest time until a lost parent is dropped.
    fn probing_max(&self) -> Duration {
        self.heartbeat_period * STALE_HEARTBEATS_MAX.into() + self.repair * 2 * PROBES_MAX
    }
}

impl ParentProbe {
    /// After a restart: neighbours have yet to be heard.
    pub(super) const fn resume(&mut self) {
        self.is_isolated = true;
    }

    /// Forgets all probes and inquiries.
    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }

    /// When the next step is due: with a parent the next probe, the first one when it is stale; without one the next
    /// inquiry or the report of a silent master.
    pub(super) fn deadline(
        &self,
        shared: &SharedState,
        links: &LinkTable,
        route: WatchedRoute,
        config: &Config,
    ) -> Option<Timestamp> {
        if shared.durable.landing.is_some() || shared.durable.stopped {
            return None;
        }
        let Some(parent) = route.parent else {
            let since = route
                .orphaned_since
                .filter(|_| !shared.is_master_silent())?;
            let master_silent_at = self.master_silent_at(since, shared.master(), links, config);
            let (asked, due) = self.inquiries.unwrap_or((0, since));
            let inquiry = (asked < self.inquiries_max(links)).then_some(due);
            return Some(inquiry.map_or(master_silent_at, |due| due.min(master_silent_at)));
        };
        match self.current(parent, links) {
            Some(probe) => Some(probe.due),
            None => route.stale_at,
        }
    }

    /// Number of inquiries without a route. Unlimited if only one neighbour is heard or has a route, or if the dropped
    /// parent may still live, because then all depends on one answer.
    fn inquiries_max(&self, links: &LinkTable) -> u32 {
        match links.with_routes().count() {
            _ if self.dropped_parent.is_some() || links.len() == 1 => u32::MAX,
            0 => 0,
            1 => u32::MAX,
            _ => INQUIRIES,
        }
    }

    /// When a drone without a route since `since` reports the master as silent: after the route timeout. It waits
    /// longer
    ///
    /// - for the next heartbeat, if it has symmetric neighbours, unless it dropped the master itself: they may have routes
    ///   that are not feasible, or may be about to find one;
    /// - for as long as its only neighbour may take to probe its own parent, if that has a route;
    /// - for as long as probing takes, if it hears no drone: it would lead none, and others may return.
    fn master_silent_at(
        &self,
        since: Timestamp,
        master: Option<NodeId>,
        links: &LinkTable,
        config: &Config,
    ) -> Timestamp {
        if self.is_isolated {
            return since + config.route_timeout + config.probing_max();
        }
        let heartbeats = if links.len() == 1 && links.with_routes().next().is_some() {
            STALE_HEARTBEATS_MAX
        } else {
            let dropped_master = self.dropped_parent.is_some() && self.dropped_parent == master;
            u16::from(!dropped_master && links.iter().any(|link| link.hearing().is_symmetric()))
        };
        since + config.route_timeout + config.heartbeat_period * heartbeats.into()
    }

    /// The last parent, if it answered no probe; inquiries ask it, too.
    pub(super) const fn dropped_parent(&self) -> Option<NodeId> {
        self.dropped_parent
    }

    /// The probe of the parent; `None` if that was heard since, or has changed.
    fn current(&self, parent: NodeId, links: &LinkTable) -> Option<Probe> {
        let probe = self.probe?;
        let heard_at = links.get(parent)?.heard_at;
        (probe.parent == parent && probe.heard_at == heard_at).then_some(probe)
    }

    /// Takes the step that is due.
    pub(super) fn step(
        &mut self,
        shared: &mut SharedState,
        links: &LinkTable,
        route: WatchedRoute,
        (now, config): (Timestamp, &Config),
    ) -> Option<ProbeStep> {
        let Some(parent) = route.parent else {
            let since = route.orphaned_since?;
            if now >= self.master_silent_at(since, shared.master(), links, config) {
                (self.inquiries, self.dropped_parent) = (None, None);
                return Some(ProbeStep::ReportMasterSilent);
            }
            let asked = self.inquiries.map_or(0, |it| it.0);
            let pause = config.repair.max(now.since(since) / INQUIRY_BACK_OFF);
            let pause = pause + shared.jitter(pause);
            self.inquiries = Some((asked + 1, now + pause));
            return Some(ProbeStep::Inquire);
        };
        (self.inquiries, self.dropped_parent, self.is_isolated) = (None, None, false);
        let link = links.get(parent)?;
        let sent = self.current(parent, links).map_or(0, |it| it.sent);
        let is_isolated = is_isolated_with(parent, links);
        let probes = if is_isolated {
            PROBES_MAX
        } else {
            link.quality.probes()
        };
        if sent >= probes {
            (self.probe, self.dropped_parent, self.is_isolated) = (None, Some(parent), is_isolated);
            return Some(ProbeStep::DropParent(parent));
        }
        let bursty = (link.quality.long_loss() / BURSTY).min(1.0);
        // Jitter makes the mean pause half as long again over a bursty link, and a quarter longer otherwise.
        let pause = (config.repair * BURST_REPAIRS * 2 / (3 * probes)).mul_f64(bursty);
        let pause = pause.max(config.repair);
        let jitter = pause.mul_f64(f64::midpoint(1.0, bursty));
        self.probe = Some(Probe {
            parent,
            heard_at: link.heard_at,
            due: now + pause + shared.jitter(jitter),
            sent: sent + 1,
        });
        Some(ProbeStep::Probe {
            is_first: sent == 0,
        })
    }
}

/// Whether a drone hears only its parent, apart from neighbours over poor or unproven links. If it drops that parent,
/// it leaves the swarm and would lead only itself, so it waits longer.
fn is_isolated_with(parent: NodeId, links: &LinkTable) -> bool {
    let is_company = |link: &Neighbour| link.quality.is_proven() && !link.quality.is_poor();
    !links
        .iter()
        .any(|link| link.id != parent && is_company(link))
}

/// The route that is supervised.
#[derive(Debug, Clone, Copy)]
pub(super) struct WatchedRoute {
    pub(super) parent: Option<NodeId>,
    pub(super) stale_at: Option<Timestamp>,
    pub(super) orphaned_since: Option<Timestamp>,
}

#[cfg(test)]
mod tests;
