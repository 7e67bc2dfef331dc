//! What a setpoint asks of the autopilot.

use std::time::Duration;

use super::vocabulary::Order;
use crate::geometry::{Ned, Velocity};
use crate::msp::Setpoint;
use crate::time::Timestamp;

/// From one target to the next: PX4 stops if it gets fewer than two a second (docs.px4.io, *Offboard Mode*).
const TARGET_PERIOD: Duration = Duration::from_millis(200);
/// Largest distance from its target of a vehicle at rest, in metres.
const REST_M: f64 = 0.6;
/// Largest speed of a vehicle at rest, in m/s.
const REST_MPS: f64 = 0.4;

/// A setpoint that is flown. Its target is due at once, and every [`TARGET_PERIOD`] from then on.
#[derive(Debug, Clone, Copy)]
pub(super) struct Course {
    pub(super) setpoint: Setpoint,
    since: Timestamp,
    /// Where the vehicle would have come to rest when it got the setpoint. `None` if it did not know where it was.
    from: Option<Ned>,
    /// When the next target is due.
    aims_at: Timestamp,
}

impl Course {
    pub(super) const fn new(now: Timestamp, setpoint: Setpoint, from: Option<Ned>) -> Self {
        Self {
            setpoint,
            since: now,
            from,
            aims_at: now,
        }
    }

    /// When to call [`Self::take_due_target`].
    pub(super) const fn aims_at(&self) -> Timestamp {
        self.aims_at
    }

    /// As [`Self::target`], if one is due.
    pub(super) fn take_due_target(&mut self, now: Timestamp) -> Option<(Ned, Velocity)> {
        if self.aims_at > now {
            return None;
        }
        self.aims_at = now + TARGET_PERIOD;
        self.target(now)
    }

    /// The position is known.
    pub(super) fn begin(&mut self, from: Ned) {
        self.from.get_or_insert(from);
    }

    /// Where the vehicle is to be, and the velocity of that place. `None` if that takes a position that isn't known.
    pub(super) fn target(&self, now: Timestamp) -> Option<(Ned, Velocity)> {
        match self.setpoint {
            Setpoint::Leg { to, .. } => Some((to, Velocity::ZERO)),
            Setpoint::Hold { altitude_m, .. } => {
                Some((self.from?.at_altitude(altitude_m), Velocity::ZERO))
            }
            Setpoint::Track {
                to, velocity, hold, ..
            } => {
                let elapsed = now.since(self.since);
                let moved = velocity.0 * elapsed.min(hold).as_secs_f64();
                let velocity = if elapsed < hold {
                    velocity
                } else {
                    Velocity::ZERO
                };
                Some((Ned(to.0 + moved), velocity))
            }
        }
    }

    /// End of the leg, if it is one.
    pub(super) const fn leg_end(&self) -> Option<Ned> {
        match self.setpoint {
            Setpoint::Leg { to, .. } => Some(to),
            Setpoint::Track { .. } | Setpoint::Hold { .. } => None,
        }
    }

    /// Acceleration at which it brakes, in m/s².
    pub(super) const fn acceleration_mps2(&self) -> f64 {
        match self.setpoint {
            Setpoint::Leg {
                acceleration_mps2, ..
            }
            | Setpoint::Track {
                acceleration_mps2, ..
            }
            | Setpoint::Hold {
                acceleration_mps2, ..
            } => acceleration_mps2,
        }
    }

    /// Its maximum speeds. A leg's is split into its parts over ground and vertical; a part shorter than a metre sets none, or
    /// the autopilot could not correct what it is off.
    pub(super) fn speed(&self) -> Order {
        let (over_ground_mps, vertical_mps) = match self.setpoint {
            Setpoint::Leg { to, speed_mps, .. } => match self.from {
                Some(from) if from != to => {
                    let part = |length_m: f64| match length_m {
                        1.0.. => speed_mps * length_m / from.distance_m(to),
                        _ => 0.0,
                    };
                    let over_ground_m = from.horizontal_distance_m(to);
                    (part(over_ground_m), part(from.vertical_distance_m(to)))
                }
                _ => (0.0, 0.0),
            },
            Setpoint::Track { speed_mps, .. } => (speed_mps, speed_mps),
            Setpoint::Hold { vertical_mps, .. } => (0.0, vertical_mps),
        };
        Order::Speed {
            over_ground_mps,
            vertical_mps,
        }
    }

    /// Whether a vehicle with this position and velocity has come to rest at the target.
    pub(super) fn is_reached(&self, now: Timestamp, (position, velocity): (Ned, Velocity)) -> bool {
        let target = self.target(now);
        is_slow(velocity) && target.is_some_and(|(to, _)| to.distance_m(position) < REST_M)
    }
}

/// Whether a vehicle with this velocity is at rest.
pub(super) fn is_slow(velocity: Velocity) -> bool {
    velocity.0.norm() < REST_MPS
}

/// Where a vehicle with this position and velocity comes to rest if it brakes now.
pub(super) fn stop((position, velocity): (Ned, Velocity), acceleration_mps2: f64) -> Ned {
    let seconds = velocity.0.norm() / acceleration_mps2;
    Ned(position.0 + velocity.0 * (seconds / 2.0))
}
