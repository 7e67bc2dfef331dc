//! Whether a vehicle that lands stands on the ground.

use std::time::Duration;

use crate::time::Timestamp;

/// Vertical speed of a vehicle on the ground, in m/s.
pub(super) const STILL_MPS: f64 = 0.25;
/// Downward acceleration that a vehicle in the air would follow, in m/s²: in the shortest time below, to ten times
/// [`STILL_MPS`].
const PRESSED_MPS2: f64 = 3.5;
/// How long a vehicle that is pressed down must be still where the ground should be.
const EXPECTED_FOR: Duration = Duration::from_millis(700);
/// The same above or below: the ground is not level.
const ELSEWHERE_FOR: Duration = Duration::from_secs(2);
/// Age of the newest height up to which it says that the vehicle is still.
const HEIGHT_AGE_MAX: Duration = Duration::from_millis(300);

/// What is known of a vehicle that lands.
#[derive(Debug, Clone, Copy)]
pub(super) struct Descent {
    /// The acceleration downwards that its sticks ask for, in m/s².
    pub(super) down_mps2: f64,
    /// Its vertical speed, in m/s.
    pub(super) speed_mps: f64,
    /// Age of the newest height.
    pub(super) height_age: Duration,
    /// Whether its reference has come to the ground.
    pub(super) is_expected: bool,
}

/// Looks for the ground: the vehicle is to go down, and doesn't.
#[derive(Debug, Default)]
pub(super) struct Touchdown {
    still_since: Option<Timestamp>,
}

impl Touchdown {
    /// Whether the vehicle may stand on the ground.
    pub(super) const fn is_suspected(&self) -> bool {
        self.still_since.is_some()
    }

    /// Whether the vehicle stands on the ground. `None`: it doesn't land, or nothing is known of it.
    pub(super) fn look(&mut self, now: Timestamp, descent: Option<Descent>) -> bool {
        let descent = descent.filter(|it| {
            it.down_mps2 > PRESSED_MPS2
                && it.speed_mps.abs() < STILL_MPS
                && it.height_age <= HEIGHT_AGE_MAX
        });
        let Some(descent) = descent else {
            self.still_since = None;
            return false;
        };
        let lasts = match descent.is_expected {
            true => EXPECTED_FOR,
            false => ELSEWHERE_FOR,
        };
        now.since(*self.still_since.get_or_insert(now)) >= lasts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STANDING: Descent = Descent {
        down_mps2: 4.0,
        speed_mps: 0.1,
        height_age: Duration::from_millis(100),
        is_expected: true,
    };

    /// Milliseconds until the ground is found; `None` within 5 s.
    fn found_after(descent: impl Fn(u64) -> Descent) -> Option<u64> {
        let mut touchdown = Touchdown::default();
        (0..5_000).step_by(20).find(|now| {
            let at = Timestamp::from_nanos(now * 1_000_000);
            touchdown.look(at, Some(descent(*now)))
        })
    }

    #[test]
    fn a_pressed_vehicle_that_is_still_stands() {
        assert_eq!(found_after(|_| STANDING), Some(700));
        let elsewhere = Descent {
            is_expected: false,
            ..STANDING
        };
        assert_eq!(found_after(|_| elsewhere), Some(2_000));
    }

    #[test]
    fn a_vehicle_that_moves_or_is_not_pressed_or_not_measured_does_not() {
        let sinks = Descent {
            speed_mps: 0.4,
            ..STANDING
        };
        let hovers = Descent {
            down_mps2: 2.0,
            ..STANDING
        };
        let is_unseen = Descent {
            height_age: Duration::from_millis(400),
            ..STANDING
        };
        for descent in [sinks, hovers, is_unseen] {
            assert_eq!(found_after(|_| descent), None, "{descent:?}");
        }
        // It is still for half a second at a time.
        let stops = |now: u64| if now % 600 < 500 { STANDING } else { sinks };
        assert_eq!(found_after(stops), None);
    }
}
