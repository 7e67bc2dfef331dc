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

impl Navigation {
    /// Tracks a moving place, which needs no legs. A drone that has left its place returns there by its hold altitude.
    pub(super) fn track(&mut self, now: Timestamp, goal: Goal, place: (Ned, Velocity, Duration)) {
        let has_left = self.returns_at_m().is_some();
        self.durable.goal = Some(goal);
        self.track_expires_at = Some(now + place.2 * TRACK_EXPIRY_HOLDS);
        if has_left {
            self.set_progress(self.durable.progress.clone());
            self.command(FlightCommand::Report);
        } else {
            self.set_progress(Progress::Flying(VecDeque::new()));
            self.fly_along(now, place);
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
        let away = telemetry.stop.at_altitude(altitude_m);
        self.set_progress(Progress::Flying([away].into()));
    }

    /// Reports the way to a tracked place. A drone that has left it flies level at its hold altitude, above or below the others,
    /// until it is above or below its place.
    pub(super) fn monitor_track(&mut self, now: Timestamp, telemetry: &Telemetry) {
        let position = telemetry.position;
        if let Some(altitude_m) = self.returns_at_m()
            && let Some(Goal::Track {
                to, velocity, hold, ..
            }) = self.durable.goal
            && self.track_expires_at.is_some()
        {
            let is_there = position.horizontal_distance_m(to) < ABOVE_M
                || position.vertical_distance_m(to) < LEVEL_M;
            if is_there {
                self.set_progress(Progress::Flying(VecDeque::new()));
                self.fly_along(now, (to, velocity, hold));
            } else if (position.altitude_m() - altitude_m).abs() < LEVEL_M {
                self.fly_along(now, (to.at_altitude(altitude_m), velocity, hold));
            }
        }
        (self.deconfliction).announce_joining(now, position, &mut self.outbox);
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
