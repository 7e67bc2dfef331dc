//! Whether the drone can go on, told from its telemetry: its battery, its position, its fence.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use super::fence::Fence;
use crate::msp::Telemetry;
use crate::time::Timestamp;

/// For how long a position may be missing before the drone stops: PX4's default of `COM_POS_FS_DELAY`.
const POSITION_MISSED_MAX: Duration = Duration::from_secs(1);
/// How often a vehicle is looked at that is about to reach its fence.
pub(super) const LOOK_EVERY: Duration = Duration::from_millis(100);
/// How much farther out than when it was stopped a vehicle may be found before that counts as another breach, in metres.
const SLACK_M: f64 = 0.5;

/// From when on a drone can't go on.
#[derive(Debug, Clone, PartialEq)]
pub struct Failsafe {
    /// How long a drone holds that does not know where it is, before it comes down.
    pub position_hold: Duration,
    /// Up to which charge a battery is low, as a share of a full one.
    pub battery_low: f64,
    /// Up to which it is all but empty.
    pub battery_critical: f64,
    /// Where it may fly.
    pub fence: Option<Arc<Fence>>,
}

/// Why a drone can't go on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Failure {
    /// Its battery is low.
    BatteryLow,
    /// It is about to leave its fence.
    Geofence,
    /// It has not known for too long where it is.
    PositionLost,
    /// Its battery is all but empty.
    BatteryCritical,
}

/// What a look at the telemetry says.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Findings {
    /// What has failed and was not told yet.
    pub(super) failures: Vec<Failure>,
    /// Whether it has one again.
    pub(super) is_found: bool,
}

/// What is known of the drone's fitness.
#[derive(Debug, Default)]
pub(super) struct Watch {
    told: BTreeSet<Failure>,
    is_lost: bool,
    /// How far beyond where it is stopped the vehicle was when it was stopped last, in metres.
    beyond_m: Option<f64>,
    next_look: Option<Timestamp>,
}

impl Watch {
    /// When the telemetry is to be asked for, if it does not come before.
    pub(super) const fn next_look(&self) -> Option<Timestamp> {
        self.next_look
    }

    /// The telemetry has been asked for.
    pub(super) const fn looked(&mut self) {
        self.next_look = None;
    }

    /// Whether the drone holds because it does not know where it is.
    pub(super) const fn is_lost(&self) -> bool {
        self.is_lost
    }

    /// The mission may not know any more what it was told.
    pub(super) fn tell_again(&mut self) {
        self.told.clear();
    }

    /// Judges what the vehicle says of itself, which flies or `takes_off`; `speed_mps` is the highest that it flies at.
    pub(super) fn judge(
        &mut self,
        now: Timestamp,
        telemetry: &Telemetry,
        failsafe: &Failsafe,
        (takes_off, speed_mps): (bool, f64),
    ) -> Findings {
        let mut verdict = Findings::default();
        self.next_look = None;
        verdict.failures.extend(self.battery(telemetry, failsafe));
        if !telemetry.landing && (telemetry.armed || takes_off) {
            self.position(now, telemetry, failsafe, &mut verdict);
        }
        if !telemetry.armed || telemetry.landing {
            return verdict;
        }
        if let Some(fence) = &failsafe.fence
            && !self.is_lost
            && self.breaches(now, telemetry, fence, speed_mps)
        {
            verdict.failures.push(Failure::Geofence);
        }
        verdict
    }

    fn battery(&mut self, telemetry: &Telemetry, failsafe: &Failsafe) -> Option<Failure> {
        let failure = if telemetry.charge <= failsafe.battery_critical {
            Failure::BatteryCritical
        } else if telemetry.charge <= failsafe.battery_low {
            Failure::BatteryLow
        } else {
            return None;
        };
        self.told.insert(failure).then_some(failure)
    }

    fn position(
        &mut self,
        now: Timestamp,
        telemetry: &Telemetry,
        failsafe: &Failsafe,
        verdict: &mut Findings,
    ) {
        let lost_for = telemetry.position_lost_for;
        let is_lost = lost_for.is_some_and(|it| it >= POSITION_MISSED_MAX);
        let was_lost = std::mem::replace(&mut self.is_lost, is_lost);
        verdict.is_found = was_lost && !self.is_lost;
        let Some(lost_for) = lost_for else { return };
        let land_after = POSITION_MISSED_MAX + failsafe.position_hold;
        if lost_for >= land_after {
            if self.told.insert(Failure::PositionLost) {
                verdict.failures.push(Failure::PositionLost);
            }
        } else if self.is_lost {
            self.look_after(now, land_after.saturating_sub(lost_for));
        } else {
            self.look_after(now, POSITION_MISSED_MAX.saturating_sub(lost_for));
        }
    }

    /// Whether the vehicle would leave its fence unless it is stopped now.
    fn breaches(
        &mut self,
        now: Timestamp,
        telemetry: &Telemetry,
        fence: &Fence,
        speed_mps: f64,
    ) -> bool {
        let room_m =
            fence.stopping_room_m(telemetry.position, telemetry.stop) - Fence::margin_m(speed_mps);
        let looks_away_s = room_m.max(0.0) / (2.0 * speed_mps);
        self.look_after(now, LOOK_EVERY.max(Duration::from_secs_f64(looks_away_s)));
        let beyond_m = -room_m;
        if beyond_m < 0.0 {
            self.beyond_m = None;
            return false;
        }
        let is_another = self
            .beyond_m
            .is_none_or(|before| beyond_m > before + SLACK_M);
        if is_another {
            self.beyond_m = Some(beyond_m);
        }
        is_another
    }

    fn look_after(&mut self, now: Timestamp, pause: Duration) {
        let due = now + pause;
        self.next_look = Some(self.next_look.map_or(due, |look| look.min(due)));
    }
}

#[cfg(test)]
mod tests;
