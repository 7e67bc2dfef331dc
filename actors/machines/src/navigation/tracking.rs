//! Follows a moving place, and returns to it.

use std::collections::VecDeque;
use std::time::Duration;

use super::{Goal, Navigation, Progress};
use crate::geometry::{Ned, Velocity};
use crate::msp::{FlightCommand, Setpoint, Telemetry};
use crate::time::Timestamp;

/// Multiple of [`Goal::Track`]'s `hold` after which a tracked place expires.
const TRACK_EXPIRY_HOLDS: u32 = 2;

/// Distance over ground below which a drone is above or below its place, in metres: half of the default separation.
const ABOVE_M: f64 = 2.5;

/// Difference in height below which two places are level, in metres.
const LEVEL_M: f64 = 1.0;

/// Whether two altitudes differ by less than [`LEVEL_M`].
fn are_level(one_m: f64, other_m: f64) -> bool {
    (one_m - other_m).abs() < LEVEL_M
}

impl Navigation {
    /// Tracks a moving place, which needs no legs. A drone that has left its place returns there at its hold altitude, if that is
    /// another one: it climbs or descends to it first.
    pub(super) fn track(
        &mut self,
        now: Timestamp,
        goal: Goal,
        (to, velocity, hold): (Ned, Velocity, Duration),
    ) {
        let returns_at_m = self.returns_at_m();
        self.durable.goal = Some(goal);
        self.track_expires_at = Some(now + hold * TRACK_EXPIRY_HOLDS);
        let hold_altitude_m = goal.hold_altitude_m().unwrap_or(to.altitude_m());
        match returns_at_m {
            Some(at_m) if !are_level(hold_altitude_m, to.altitude_m()) => {
                let progress = if are_level(at_m, hold_altitude_m) {
                    self.durable.progress.clone()
                } else {
                    Progress::Planning
                };
                self.set_progress(progress);
                self.command(FlightCommand::Report);
            }
            _ => {
                self.set_progress(Progress::Flying(VecDeque::new()));
                self.fly_along(now, (to, velocity, hold));
            }
        }
    }

    /// Altitude in metres above home at which a drone that has left a tracked place returns there. `None` if it has not.
    fn returns_at_m(&self) -> Option<f64> {
        match (self.durable.goal, &self.durable.progress) {
            (Some(Goal::Track { .. }), Progress::Flying(corners)) => {
                corners.front().map(|corner| corner.altitude_m())
            }
            _ => None,
        }
    }

    /// Leaves a tracked place that is not known any more: comes to rest, and climbs or descends to the hold altitude.
    pub(super) fn leave_track(&mut self, now: Timestamp, telemetry: &Telemetry) {
        let altitude_m = self.hold_altitude_m(now, telemetry);
        self.hold(now, telemetry, altitude_m);
        self.returns = false;
        let away = telemetry.stop.at_altitude(altitude_m);
        self.set_progress(Progress::Flying([away].into()));
    }

    /// Reports the way to a tracked place. A drone that has left it waits until it rests at its hold altitude, and flies level from
    /// there until it is above or below its place.
    pub(super) fn monitor_track(&mut self, now: Timestamp, telemetry: &Telemetry) {
        let place = telemetry.position;
        if let Some(altitude_m) = self.returns_at_m()
            && let Some(Goal::Track {
                to, velocity, hold, ..
            }) = self.durable.goal
            && self.track_expires_at.is_some()
        {
            let is_there = place.horizontal_distance_m(to) < ABOVE_M
                || are_level(place.altitude_m(), to.altitude_m());
            let rests_at_altitude = telemetry.at_rest && are_level(place.altitude_m(), altitude_m);
            self.returns |= rests_at_altitude;
            if is_there {
                self.set_progress(Progress::Flying(VecDeque::new()));
                self.fly_along(now, (to, velocity, hold));
            } else if self.returns {
                let level = Velocity::new(velocity.0.x, velocity.0.y, 0.0);
                self.fly_along(now, (to.at_altitude(altitude_m), level, hold));
            } else if telemetry.at_rest {
                self.hold(now, telemetry, altitude_m);
            }
        }
        (self.deconfliction).announce_joining(now, place, &mut self.outbox);
    }

    fn fly_along(&mut self, now: Timestamp, (to, velocity, hold): (Ned, Velocity, Duration)) {
        (self.deconfliction).announce_track(now, (to, velocity, hold), &mut self.outbox);
        self.command(FlightCommand::Fly(Setpoint::Track {
            to,
            velocity,
            speed_mps: self.config.speed_mps,
            acceleration_mps2: self.config.acceleration_mps2,
            hold,
        }));
    }

    /// After a restart a tracked place expires, too, as if its last velocity had been heard now.
    pub(super) fn resume_tracking(&mut self, now: Timestamp) {
        if std::mem::take(&mut self.is_restored)
            && let Some(Goal::Track { hold, .. }) = self.durable.goal
        {
            let expires_at = now + hold * TRACK_EXPIRY_HOLDS;
            self.track_expires_at.get_or_insert(expires_at);
        }
    }
}
