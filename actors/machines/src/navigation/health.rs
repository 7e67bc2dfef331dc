//! Health of the vehicle from its telemetry: battery, position, fence.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use super::fence::Fence;
use crate::msp::Telemetry;
use crate::time::Timestamp;

/// Time without a position before the drone stops: PX4's default of `COM_POS_FS_DELAY`.
const POSITION_TIMEOUT: Duration = Duration::from_secs(1);
/// Interval of fence checks near the fence.
pub(super) const CHECK_INTERVAL: Duration = Duration::from_millis(100);
/// Distance beyond the last stop that counts as another breach, in metres.
const BREACH_STEP_M: f64 = 0.5;

/// Limits of the failsafe.
#[derive(Debug, Clone, PartialEq)]
pub struct Failsafe {
    /// Time to hold without a position before landing.
    pub position_hold: Duration,
    /// Charge at or below which the battery is low, as a fraction of a full one.
    pub battery_low: f64,
    /// Charge at or below which the battery is critical.
    pub battery_critical: f64,
    /// Geofence, if there is one.
    pub fence: Option<Arc<Fence>>,
}

/// Failure of a drone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Failure {
    /// Low battery.
    BatteryLow,
    /// About to leave the fence.
    Geofence,
    /// No position for too long.
    PositionLost,
    /// Critical battery.
    BatteryCritical,
}

/// Result of a check of the telemetry.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct HealthReport {
    /// Failures not reported yet.
    pub(super) failures: Vec<Failure>,
    /// Whether the position is known again.
    pub(super) position_regained: bool,
}

/// Health of the drone.
#[derive(Debug, Default)]
pub(super) struct HealthMonitor {
    reported: BTreeSet<Failure>,
    is_position_lost: bool,
    /// Distance beyond the fence margin at the last breach, in metres.
    beyond_m: Option<f64>,
    next_check: Option<Timestamp>,
}

impl HealthMonitor {
    /// Time at which telemetry is needed, if none arrives before.
    pub(super) const fn next_check(&self) -> Option<Timestamp> {
        self.next_check
    }

    /// Telemetry has been requested.
    pub(super) const fn checked(&mut self) {
        self.next_check = None;
    }

    /// Whether the drone holds because its position is lost.
    pub(super) const fn is_position_lost(&self) -> bool {
        self.is_position_lost
    }

    /// Reports all failures again: the mission may have lost them.
    pub(super) fn clear_reported(&mut self) {
        self.reported.clear();
    }

    /// Checks the telemetry of a vehicle that flies or `takes_off`, with its highest speed `speed_mps`.
    pub(super) fn check(
        &mut self,
        now: Timestamp,
        telemetry: &Telemetry,
        failsafe: &Failsafe,
        (takes_off, speed_mps): (bool, f64),
    ) -> HealthReport {
        let mut report = HealthReport::default();
        self.next_check = None;
        report.failures.extend(self.battery(telemetry, failsafe));
        if !telemetry.landing && (telemetry.armed || takes_off) {
            self.position(now, telemetry, failsafe, &mut report);
        }
        if !telemetry.armed || telemetry.landing {
            return report;
        }
        if let Some(fence) = &failsafe.fence
            && !self.is_position_lost
            && self.breaches(now, telemetry, fence, speed_mps)
        {
            report.failures.push(Failure::Geofence);
        }
        report
    }

    fn battery(&mut self, telemetry: &Telemetry, failsafe: &Failsafe) -> Option<Failure> {
        let failure = if telemetry.charge <= failsafe.battery_critical {
            Failure::BatteryCritical
        } else if telemetry.charge <= failsafe.battery_low {
            Failure::BatteryLow
        } else {
            return None;
        };
        self.reported.insert(failure).then_some(failure)
    }

    fn position(
        &mut self,
        now: Timestamp,
        telemetry: &Telemetry,
        failsafe: &Failsafe,
        report: &mut HealthReport,
    ) {
        let lost_for = telemetry.position_lost_for;
        // The link counts anew after its restart: a lost position stays lost until it is known.
        let is_lost = |it| it >= POSITION_TIMEOUT || self.is_position_lost;
        let is_position_lost = lost_for.is_some_and(is_lost);
        let was_lost = std::mem::replace(&mut self.is_position_lost, is_position_lost);
        report.position_regained = was_lost && !self.is_position_lost;
        let Some(lost_for) = lost_for else { return };
        let land_after = POSITION_TIMEOUT + failsafe.position_hold;
        if lost_for >= land_after {
            if self.reported.insert(Failure::PositionLost) {
                report.failures.push(Failure::PositionLost);
            }
        } else if self.is_position_lost {
            self.check_after(now, land_after.saturating_sub(lost_for));
        } else {
            self.check_after(now, POSITION_TIMEOUT.saturating_sub(lost_for));
        }
    }

    /// Whether the vehicle would leave its fence unless it stops now.
    fn breaches(
        &mut self,
        now: Timestamp,
        telemetry: &Telemetry,
        fence: &Fence,
        speed_mps: f64,
    ) -> bool {
        let margin_m = fence.stopping_clearance_m(telemetry.position, telemetry.stop)
            - Fence::margin_m(speed_mps);
        let next_check_s = margin_m.max(0.0) / (2.0 * speed_mps);
        self.check_after(
            now,
            CHECK_INTERVAL.max(Duration::from_secs_f64(next_check_s)),
        );
        let beyond_m = -margin_m;
        if beyond_m < 0.0 {
            self.beyond_m = None;
            return false;
        }
        let is_another = self
            .beyond_m
            .is_none_or(|before| beyond_m > before + BREACH_STEP_M);
        if is_another {
            self.beyond_m = Some(beyond_m);
        }
        is_another
    }

    fn check_after(&mut self, now: Timestamp, pause: Duration) {
        let due = now + pause;
        self.next_check = Some(self.next_check.map_or(due, |at| at.min(due)));
    }
}

#[cfg(test)]
mod tests;
