//! When a drone sends its heartbeat: each time the master's heartbeat sequence rises, or every n-th time.

use std::time::Duration;

use super::Config;
use crate::routing::shared::SharedState;
use crate::time::Timestamp;

/// Shortest heartbeat period of a leaf, however short the master's is. No route depends on a leaf, and each frame costs
/// all receivers a signature check.
const LEAF_PERIOD_MIN: Duration = Duration::from_millis(100);
/// Drones that receive the same heartbeat forward it within a random time, so that they do not collide. It grows by
/// this much with each neighbour, for parents and for leaves. Others depend on parents, so these come first.
const SPREAD: Duration = Duration::from_millis(1);
const LEAF_SPREAD: Duration = Duration::from_millis(3);
/// Upper bound of that time, as a share of the heartbeat period, for parents and for leaves.
const SPREAD_SHARE: u32 = 8;
const LEAF_SPREAD_SHARE: u32 = 4;
/// Lower bound of that time.
const SPREAD_MIN: Duration = Duration::from_millis(2);

/// While drones change positions, a master with lossy links halves its heartbeat period, but not below this, so that
/// routes follow (as Trickle does after a change, RFC 6206).
const FAST_PERIOD_MIN: Duration = Duration::from_millis(250);

/// Schedules the next heartbeat.
#[derive(Debug)]
pub(super) struct HeartbeatTimer {
    period: Duration,
    /// See [`Config::landing_period`].
    landing_period: Duration,
    /// On the master: whether drones change positions.
    is_fast: bool,
    /// `None` before there is a leader, and after the last frame.
    next: Option<Timestamp>,
    /// A leaf forwards every n-th heartbeat.
    leaf_interval: u32,
    /// The last forwarded heartbeat sequence.
    forwarded: u32,
}

/// The drones that send at the same time, and this drone's role among them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Contention {
    /// Whether this drone is a parent.
    pub(super) has_children: bool,
    /// Number of neighbours.
    pub(super) neighbours: usize,
}

impl Config {
    /// Longest pause between two heartbeats of a drone that is not landing. A master's is shorter.
    #[must_use]
    pub fn silence_max(&self) -> Duration {
        let leaf_period = self.leaf_period();
        leaf_period * 5 / 4 + leaf_period / 8
    }

    /// Number of heartbeats after which a leaf forwards one.
    fn leaf_interval(&self) -> u32 {
        let heartbeats = LEAF_PERIOD_MIN
            .as_nanos()
            .div_ceil(self.heartbeat_period.as_nanos().max(1));
        u32::try_from(heartbeats).unwrap_or(u32::MAX).max(1)
    }

    /// Heartbeat period of a leaf.
    pub(super) fn leaf_period(&self) -> Duration {
        self.heartbeat_period * self.leaf_interval()
    }
}

impl HeartbeatTimer {
    pub(super) fn new(config: &Config) -> Self {
        Self {
            period: config.heartbeat_period,
            landing_period: config.landing_period,
            is_fast: false,
            next: None,
            leaf_interval: config.leaf_interval(),
            forwarded: 0,
        }
    }

    pub(super) const fn deadline(&self) -> Option<Timestamp> {
        self.next
    }

    /// Schedules the next heartbeat at `at`, replacing the time before.
    pub(super) const fn schedule_at(&mut self, at: Timestamp) {
        self.next = Some(at);
    }

    /// Sends no more heartbeats.
    pub(super) const fn stop(&mut self) {
        self.next = None;
    }

    /// On the master: whether drones change positions.
    pub(super) const fn set_fast(&mut self, is_fast: bool) {
        self.is_fast = is_fast;
    }

    /// The leader has changed.
    pub(super) fn start_epoch(&mut self, now: Timestamp) {
        self.forwarded = 0;
        self.is_fast = false;
        self.next.get_or_insert(now + self.period);
    }

    /// Brings the next heartbeat forward, to forward a sequence.
    pub(super) fn schedule_soon(
        &mut self,
        shared: &mut SharedState,
        now: Timestamp,
        contention: Contention,
    ) {
        let (spread, share) = if contention.has_children || shared.is_master() {
            (SPREAD, SPREAD_SHARE)
        } else {
            (LEAF_SPREAD, LEAF_SPREAD_SHARE)
        };
        let speakers = u32::try_from(contention.neighbours).unwrap_or(u32::MAX);
        let most = (self.period / share).max(SPREAD_MIN);
        let within = spread
            .saturating_mul(speakers.saturating_add(1))
            .clamp(SPREAD_MIN, most);
        self.schedule_within(shared, now, within);
    }

    /// Brings the next heartbeat forward for a new neighbour. All drones may have come into range at once, so the
    /// random time covers them all.
    pub(super) fn schedule_for_new_neighbour(&mut self, shared: &mut SharedState, now: Timestamp) {
        let most = (self.period / LEAF_SPREAD_SHARE).max(SPREAD_MIN);
        let within = (SPREAD * 2).saturating_mul(shared.drones).min(most);
        self.schedule_within(shared, now, within);
    }

    /// Brings the next heartbeat forward to between an eighth and a quarter of a period from now.
    pub(super) fn schedule_later(&mut self, shared: &mut SharedState, now: Timestamp) {
        let eighth = self.period / 8;
        let at = now + eighth + shared.jitter(eighth);
        self.next = self.next.map(|due| due.min(at));
    }

    fn schedule_within(&mut self, shared: &mut SharedState, now: Timestamp, within: Duration) {
        let at = now + shared.jitter(within);
        self.next = self.next.map(|due| due.min(at));
    }

    /// Schedules the next heartbeat after one was sent at `now`. A received heartbeat brings it forward.
    pub(super) fn record_sent(
        &mut self,
        shared: &mut SharedState,
        now: Timestamp,
        (has_children, has_lossy_links): (bool, bool),
        is_settled_to_land: bool,
    ) {
        self.forwarded = shared.durable.heartbeats.master;
        let pause = if is_settled_to_land {
            self.landing_period
        } else if shared.is_master() && self.is_fast && has_lossy_links {
            (self.period / 2).max(FAST_PERIOD_MIN.min(self.period))
        } else if shared.is_master() {
            self.period
        } else {
            let heartbeats = if self.is_throttled(has_children) {
                self.leaf_interval
            } else {
                1
            };
            let period = self.period * heartbeats;
            period * 5 / 4 + shared.jitter(period / 8)
        };
        self.next = Some(now + pause);
    }

    /// Whether the period is so short that leaves do not forward each heartbeat.
    pub(super) const fn throttles_leaves(&self) -> bool {
        self.leaf_interval > 1
    }

    /// Whether this drone is a leaf that does not forward each heartbeat.
    const fn is_throttled(&self, has_children: bool) -> bool {
        self.throttles_leaves() && !has_children
    }

    /// Whether this drone forwards the current heartbeat sequence.
    pub(super) fn is_forward_due(&self, shared: &SharedState, has_children: bool) -> bool {
        let heartbeats = shared
            .durable
            .heartbeats
            .master
            .saturating_sub(self.forwarded);
        heartbeats >= self.leaf_interval || !self.is_throttled(has_children)
    }
}

#[cfg(test)]
mod tests;
