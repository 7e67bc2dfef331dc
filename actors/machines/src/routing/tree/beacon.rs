//! When a drone says what it knows though nothing has changed: with each of the master's heartbeats, or each few.

use std::time::Duration;

use super::Config;
use crate::routing::core::Core;
use crate::time::Timestamp;

/// A drone that is nobody's parent passes heartbeats on no more often than this, however quick they are: nobody needs it
/// for its route, and each frame costs all that hear it a signature.
const LEAF_PAUSE: Duration = Duration::from_millis(100);
/// How many beacons a drone that has been going to land for its time to live leaves out, less one.
const LANDING_BEACONS: u32 = 4;
/// Drones that heard the same heartbeat pass it on within so long for each neighbour that does so too, so that they do not
/// all speak at one instant: parents, and leaves, whose word nobody waits for.
const SPREAD: Duration = Duration::from_millis(1);
const LEAF_SPREAD: Duration = Duration::from_millis(3);
/// The share of a beacon that this takes at most, for parents and for leaves.
const SPREAD_SHARE: u32 = 8;
const LEAF_SPREAD_SHARE: u32 = 4;
/// Nor less than this.
const SPREAD_MIN: Duration = Duration::from_millis(2);

/// While drones change places their links do, too: where links lose frames, the master's heartbeat then goes out twice as often,
/// but no more often than this, so that routes follow (as Trickle does where something has changed, RFC 6206).
const QUICK_MIN: Duration = Duration::from_millis(250);

/// When the next beacon is due.
#[derive(Debug)]
pub(super) struct Beacon {
    period: Duration,
    /// Whether drones change places, as far as this one as master knows.
    is_quick: bool,
    /// `None` before there is a leader, and after the last word.
    next: Option<Timestamp>,
    /// Each how many heartbeats a drone passes on that is nobody's parent.
    heartbeats_a_turn: u32,
    /// The heartbeat sequence that this drone passed on last.
    passed_on: u32,
}

/// What a drone is to those that hear it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Audience {
    /// Whether it is somebody's parent.
    pub(super) has_children: bool,
    /// How many it hears, which speak at the same time.
    pub(super) neighbours: usize,
}

impl Config {
    /// The longest that a drone keeps silent that is not landing; a master speaks sooner.
    #[must_use]
    pub fn turn(&self) -> Duration {
        let pace = self.pace();
        pace * 5 / 4 + pace / 8
    }

    /// How many heartbeats it takes until a drone that is nobody's parent passes one on.
    fn heartbeats_a_turn(&self) -> u32 {
        let heartbeats = LEAF_PAUSE
            .as_nanos()
            .div_ceil(self.beacon.as_nanos().max(1));
        u32::try_from(heartbeats).unwrap_or(u32::MAX).max(1)
    }

    /// How often a drone speaks at least that is nobody's parent.
    pub(super) fn pace(&self) -> Duration {
        self.beacon * self.heartbeats_a_turn()
    }

    /// How long news takes to a neighbour whether or not it gets there at the first try, the way through the air
    /// apart: each repair makes up for a loss, and of two in five lost frames the mean is less than one repair.
    #[must_use]
    pub fn hop(&self) -> Duration {
        self.repair * 2
    }
}

impl Beacon {
    pub(super) fn new(config: &Config) -> Self {
        Self {
            period: config.beacon,
            is_quick: false,
            next: None,
            heartbeats_a_turn: config.heartbeats_a_turn(),
            passed_on: 0,
        }
    }

    pub(super) const fn deadline(&self) -> Option<Timestamp> {
        self.next
    }

    /// The next beacon is due at `at`, whatever it was before.
    pub(super) const fn set(&mut self, at: Timestamp) {
        self.next = Some(at);
    }

    /// Nothing is said any more.
    pub(super) const fn stop(&mut self) {
        self.next = None;
    }

    /// As master: drones begin to change places, or are done.
    pub(super) const fn quicken(&mut self, is_quick: bool) {
        self.is_quick = is_quick;
    }

    /// Another drone leads.
    pub(super) fn begin_epoch(&mut self, now: Timestamp) {
        self.passed_on = 0;
        self.is_quick = false;
        self.next.get_or_insert(now + self.period);
    }

    /// Brings the next beacon forward.
    pub(super) fn soon(&mut self, core: &mut Core, now: Timestamp, audience: Audience) {
        let (spread, share) = if audience.has_children || core.is_master() {
            (SPREAD, SPREAD_SHARE)
        } else {
            (LEAF_SPREAD, LEAF_SPREAD_SHARE)
        };
        let speakers = u32::try_from(audience.neighbours).unwrap_or(u32::MAX);
        let most = (self.period / share).max(SPREAD_MIN);
        let within = spread
            .saturating_mul(speakers.saturating_add(1))
            .clamp(SPREAD_MIN, most);
        self.within(core, now, within);
    }

    /// Brings the next beacon forward for a neighbour that was not known: all that are near may hear each other for the
    /// first time, so they share as much time as all drones would take.
    pub(super) fn for_new_neighbour(&mut self, core: &mut Core, now: Timestamp) {
        let most = (self.period / LEAF_SPREAD_SHARE).max(SPREAD_MIN);
        let within = (SPREAD * 2).saturating_mul(core.drones).min(most);
        self.within(core, now, within);
    }

    /// Brings the next beacon forward to some time within the first quarter of a period, unless it is due before.
    pub(super) fn in_a_while(&mut self, core: &mut Core, now: Timestamp) {
        let eighth = self.period / 8;
        let at = now + eighth + core.jitter(eighth);
        self.next = self.next.map(|due| due.min(at));
    }

    fn within(&mut self, core: &mut Core, now: Timestamp, within: Duration) {
        let at = now + core.jitter(within);
        self.next = self.next.map(|due| due.min(at));
    }

    /// Takes in that a beacon is said by `now` and sets the next; a drone that hears a heartbeat passes it on before.
    pub(super) fn said(
        &mut self,
        core: &mut Core,
        now: Timestamp,
        (has_children, has_lossy_links): (bool, bool),
        is_settled_to_land: bool,
    ) {
        self.passed_on = core.durable.heartbeats.master;
        let pause = if is_settled_to_land {
            self.period * LANDING_BEACONS
        } else if core.is_master() && self.is_quick && has_lossy_links {
            (self.period / 2).max(QUICK_MIN.min(self.period))
        } else if core.is_master() {
            self.period
        } else {
            let heartbeats = if self.speaks_seldom(has_children) {
                self.heartbeats_a_turn
            } else {
                1
            };
            let pace = self.period * heartbeats;
            pace * 5 / 4 + core.jitter(pace / 8)
        };
        self.next = Some(now + pause);
    }

    /// Whether beacons are so quick that a drone that is nobody's parent does not pass on each heartbeat.
    pub(super) const fn are_quick(&self) -> bool {
        self.heartbeats_a_turn > 1
    }

    /// Whether this drone need not pass on each heartbeat, as nobody takes it for its parent.
    const fn speaks_seldom(&self, has_children: bool) -> bool {
        self.are_quick() && !has_children
    }

    /// Whether it is this drone's turn to pass a heartbeat on.
    pub(super) fn is_its_turn(&self, core: &Core, has_children: bool) -> bool {
        let heartbeats = core
            .durable
            .heartbeats
            .master
            .saturating_sub(self.passed_on);
        heartbeats >= self.heartbeats_a_turn || !self.speaks_seldom(has_children)
    }
}

#[cfg(test)]
mod tests;
