//! Limits of the stage `tethered`. All are ours: a first flight in a net or on a line, within reach of a pilot.

use muster_msp::{Channel, Sticks};

use super::config::Gains;
use super::control::{Reference, deflection};
use crate::geometry::{Ned, Velocity};
use crate::msp::Setpoint;

/// Largest height, in metres above home.
pub const TETHER_HEIGHT_MAX_M: f64 = 2.0;
/// Largest horizontal distance from where the vehicle took off, in metres.
pub const TETHER_RADIUS_MAX_M: f64 = 3.0;
/// Largest tilt: 10°, in radians.
pub const TETHER_TILT_MAX_RAD: f64 = 0.174_532_925;
/// Largest throttle as a multiple of the configured hover throttle: 4.3 m/s² upwards.
pub const TETHER_THROTTLE_MAX: f64 = 1.2;

/// Gains of a vehicle that leans no further than its tether allows.
pub(super) const fn gains(gains: Gains) -> Gains {
    Gains {
        tilt_max_rad: gains.tilt_max_rad.min(TETHER_TILT_MAX_RAD),
        ..gains
    }
}

/// The nearest place within reach of `start`, where the vehicle took off; while that is not known only the height is bounded.
fn within(start: Option<Ned>, place: Ned) -> Ned {
    let start = start.unwrap_or(place);
    let away = (place - start).0.xy().cap_magnitude(TETHER_RADIUS_MAX_M);
    let altitude_m = place.altitude_m().min(TETHER_HEIGHT_MAX_M);
    Ned::new(start.0.x + away.x, start.0.y + away.y, -altitude_m)
}

/// A setpoint within reach.
pub(super) fn setpoint(start: Option<Ned>, setpoint: Setpoint) -> Setpoint {
    let mut capped = setpoint;
    match &mut capped {
        Setpoint::Leg { to, .. } | Setpoint::Track { to, .. } => *to = within(start, *to),
        Setpoint::Hold { altitude_m, .. } => *altitude_m = altitude_m.min(TETHER_HEIGHT_MAX_M),
    }
    capped
}

/// A reference within reach: at its edge the vehicle is to stand still.
pub(super) fn reference(start: Option<Ned>, reference: Reference) -> Reference {
    let position = within(start, reference.position);
    let beyond = (reference.position - position).0;
    let mut capped = Reference {
        position,
        ..reference
    };
    let Velocity(velocity) = &mut capped.velocity;
    for motion in [velocity, &mut capped.acceleration] {
        if beyond.xy().norm() > 0.0 {
            (motion.x, motion.y) = (0.0, 0.0);
        }
        if beyond.z < 0.0 {
            motion.z = 0.0;
        }
    }
    capped
}

/// Sticks that neither lean nor climb beyond the limits.
pub(super) fn sticks(sticks: Sticks, gains: &Gains) -> Sticks {
    let lean_us = 500.0 * deflection(TETHER_TILT_MAX_RAD);
    let throttle_us = 1_000.0 * (TETHER_THROTTLE_MAX * gains.hover_throttle);
    Sticks {
        roll: clamp(sticks.roll, 1_500.0 - lean_us, 1_500.0 + lean_us),
        pitch: clamp(sticks.pitch, 1_500.0 - lean_us, 1_500.0 + lean_us),
        throttle: clamp(sticks.throttle, 1_000.0, 1_000.0 + throttle_us),
        yaw: Channel::CENTRE,
    }
}

/// The channel, or the nearest whole value within the limits.
fn clamp(channel: Channel, low_us: f64, high_us: f64) -> Channel {
    let (low, high) = (libm::ceil(low_us) as u16, libm::floor(high_us) as u16);
    let us = channel.us().max(low).min(high);
    Channel::new(us).unwrap_or(channel)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn full_sticks_are_capped_and_small_ones_are_left() {
        let full = |at| Sticks {
            roll: at,
            pitch: at,
            throttle: at,
            yaw: Channel::CENTRE,
        };
        let gains = Gains::QUADCOPTER;
        let us = |it: Sticks| [it.roll.us(), it.pitch.us(), it.throttle.us()];
        let high = sticks(full(Channel::HIGH), &gains);
        assert_eq!(us(high), [1_688, 1_688, 1_360]);
        let low = sticks(full(Channel::LOW), &gains);
        assert_eq!(us(low), [1_312, 1_312, 1_000]);
        assert_eq!(sticks(Sticks::IDLE, &gains), Sticks::IDLE);
    }

    #[test]
    fn reference_stands_still_at_the_edge_and_moves_freely_within() {
        let start = Some(Ned::new(10.0, 0.0, 0.0));
        let moving = |position| Reference {
            position,
            velocity: Velocity::new(1.0, 1.0, -1.0),
            acceleration: Vector3::new(1.0, 1.0, -1.0),
        };
        let inside = reference(start, moving(Ned::new(12.0, 0.0, -1.0)));
        assert_eq!(inside.position, Ned::new(12.0, 0.0, -1.0));
        assert_eq!(inside.velocity, Velocity::new(1.0, 1.0, -1.0));
        let far = reference(start, moving(Ned::new(20.0, 0.0, -1.0)));
        assert_eq!(far.position, Ned::new(13.0, 0.0, -1.0));
        assert_eq!(far.velocity, Velocity::new(0.0, 0.0, -1.0));
        let high = reference(start, moving(Ned::new(10.0, 0.0, -3.0)));
        assert_eq!(high.position, Ned::new(10.0, 0.0, -2.0));
        assert_eq!(high.acceleration, Vector3::new(1.0, 1.0, 0.0));
        let unbound = reference(None, moving(Ned::new(50.0, 0.0, -3.0)));
        assert_eq!(unbound.position, Ned::new(50.0, 0.0, -2.0));
        assert_eq!(unbound.velocity, Velocity::new(1.0, 1.0, 0.0));
    }
}
