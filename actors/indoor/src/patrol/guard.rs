//! The last guard before a velocity leaves: no motion that no sonar looks along, none faster than the room ahead allows.

use std::time::Duration;

use muster_machines::indoor::Velocity;

use crate::frames::wrapped_rad;
use crate::reading::{Echo, Mounting};

/// Distance from the drone's centre that it stops before an echo, in metres.
const STOP_M: f64 = 0.2;
/// Time that an echo may be old, and the velocity may need to take effect.
const DELAY: Duration = Duration::from_millis(250);

/// Latest reading of one sonar, while it is valid and the sonar works.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Watch {
    pub(super) mounting: Mounting,
    pub(super) echo: Echo,
}

impl Watch {
    /// Angle between a direction of the body frame and the cone; 0 inside.
    fn side_angle_rad(&self, direction_rad: f64) -> f64 {
        let from_axis = wrapped_rad(direction_rad - self.mounting.bearing_rad).abs();
        (from_axis - self.mounting.aperture_rad / 2.0).max(0.0)
    }
}

/// Whether a working sonar looks along a direction of the body frame.
pub(super) fn is_watched(watches: &[Watch], direction_rad: f64) -> bool {
    watches
        .iter()
        .any(|watch| watch.side_angle_rad(direction_rad) <= 0.0)
}

/// The velocity, slowed so that the drone can stop [`STOP_M`] before everything that a sonar hears, and zero in directions that
/// no sonar watches. Turns stay.
pub(super) fn guarded(wanted: Velocity, watches: &[Watch], braking_mps2: f64) -> Velocity {
    let speed_mps = wanted.speed_mps();
    if speed_mps <= 0.0 {
        return wanted;
    }
    let direction_rad = libm::atan2(wanted.left_mps, wanted.forward_mps);
    let mut allowed_mps = if is_watched(watches, direction_rad) {
        speed_mps
    } else {
        0.0
    };
    for watch in watches {
        let Echo::At(range_m) = watch.echo else {
            continue;
        };
        // The echo may come from anywhere in the cone: from where the drone gets closer fastest.
        let closing = libm::cos(watch.side_angle_rad(direction_rad));
        if closing > 0.0 {
            allowed_mps = allowed_mps.min(closing_mps(range_m - STOP_M, braking_mps2) / closing);
        }
    }
    let share = allowed_mps / speed_mps;
    Velocity {
        forward_mps: wanted.forward_mps * share,
        left_mps: wanted.left_mps * share,
        ..wanted
    }
}

/// The highest speed from which the drone stops within `room_m` metres: v·t + v²/(2a) = room.
fn closing_mps(room_m: f64, braking_mps2: f64) -> f64 {
    if room_m <= 0.0 {
        return 0.0;
    }
    let lag_mps = braking_mps2 * DELAY.as_secs_f64();
    libm::sqrt(lag_mps * lag_mps + 2.0 * braking_mps2 * room_m) - lag_mps
}

#[cfg(test)]
mod tests {
    use super::super::thesis_sonars;
    use super::*;

    fn watches(echoes: [Echo; 5]) -> Vec<Watch> {
        let pairs = thesis_sonars().into_iter().zip(echoes);
        pairs
            .map(|(mounting, echo)| Watch { mounting, echo })
            .collect()
    }

    fn forward(speed_mps: f64) -> Velocity {
        Velocity {
            forward_mps: speed_mps,
            ..Velocity::default()
        }
    }

    #[test]
    fn free_directions_keep_their_speed() {
        let free = watches([Echo::Silence; 5]);
        assert_eq!(guarded(forward(0.5), &free, 1.0), forward(0.5));
    }

    #[test]
    fn the_drone_stops_before_what_is_ahead() {
        let mut echoes = [Echo::Silence; 5];
        let mut before = 0.5;
        for range_m in [2.0, 0.6, 0.4, 0.25, 0.2] {
            echoes[2] = Echo::At(range_m);
            let speed = guarded(forward(0.5), &watches(echoes), 1.0).forward_mps;
            let stops_m = speed * DELAY.as_secs_f64() + speed * speed / 2.0;
            assert!(
                speed <= before && stops_m <= (range_m - STOP_M).max(0.0) + 1e-9,
                "{range_m}"
            );
            before = speed;
        }
        assert!(before.abs() < 1e-12);
    }

    #[test]
    fn walls_beside_slow_less_than_walls_ahead() {
        let mut echoes = [Echo::Silence; 5];
        echoes[0] = Echo::At(0.4);
        let beside = guarded(forward(0.5), &watches(echoes), 1.0).forward_mps;
        assert!(beside > 0.4, "{beside}");
    }

    #[test]
    fn nothing_moves_into_a_blind_sector() {
        let mut seen = watches([Echo::Silence; 5]);
        let backwards = forward(-0.5);
        assert!(guarded(backwards, &seen, 1.0).speed_mps() < 1e-12);
        seen.remove(2);
        assert!(guarded(forward(0.5), &seen, 1.0).speed_mps() < 1e-12);
        let left = Velocity {
            left_mps: 0.5,
            ..Velocity::default()
        };
        assert_eq!(guarded(left, &seen, 1.0), left);
    }
}
