use super::Failsafe;
use crate::geometry::Ned;
use crate::motion::Leg;
use crate::msp::Setpoint;
use crate::traffic;

/// Configuration of a navigation.
#[derive(Debug, Clone, PartialEq)]
pub struct Config {
    /// Maximum ground speed, in m/s.
    pub speed_mps: f64,
    /// Maximum climb rate, in m/s.
    pub climb_mps: f64,
    /// Maximum descent rate, in m/s.
    pub descent_mps: f64,
    /// Acceleration along a leg, in m/s².
    pub acceleration_mps2: f64,
    /// Limits of the failsafe.
    pub failsafe: Failsafe,
    /// Deconfliction with drones that announce their intents; `None` to ignore them.
    pub avoid: Option<traffic::Config>,
}

impl Config {
    /// Leg at the maximum speed in its direction.
    pub(super) fn leg(&self, from: Ned, to: Ned) -> Setpoint {
        Setpoint::Leg {
            to,
            speed_mps: self.leg_mps(from, to),
            acceleration_mps2: self.acceleration_mps2,
        }
    }

    /// Speeds along a leg that is flown from rest to rest.
    #[must_use]
    pub fn profile(&self, from: Ned, to: Ned) -> Leg {
        let length_m = (to - from).0.norm();
        Leg::new(length_m, self.leg_mps(from, to), self.acceleration_mps2)
    }

    /// Maximum speed in the direction of a leg, in m/s.
    fn leg_mps(&self, from: Ned, to: Ned) -> f64 {
        let path = to - from;
        let length_m = path.0.norm();
        let over_ground = from.horizontal_distance_m(to) / length_m;
        let climbing = path.altitude_m() / length_m;
        let vertical_mps = if climbing > 0.0 {
            self.climb_mps
        } else {
            self.descent_mps
        };
        // A zero fraction divides to infinity, which `min` ignores.
        if length_m > 0.0 {
            (self.speed_mps / over_ground).min(vertical_mps / climbing.abs())
        } else {
            self.speed_mps
        }
    }

    /// Comes to rest at this altitude, in metres above home.
    pub(super) const fn hold(&self, altitude_m: f64) -> Setpoint {
        Setpoint::Hold {
            altitude_m,
            vertical_mps: self.climb_mps.min(self.descent_mps),
            acceleration_mps2: self.acceleration_mps2,
        }
    }
}
