//! Whether a vehicle that lands stands on the ground.

use std::time::Duration;

use crate::time::Timestamp;

/// How far the height of a vehicle on the ground may seem to change, in metres: the noise of its estimate.
const STILL_M: f64 = 0.3;
/// Downward acceleration that a vehicle in the air would follow, in m/s²: in the shortest time below, by three times
/// [`STILL_M`].
const PRESSED_MPS2: f64 = 3.5;
/// How long a vehicle must be still and pressed down where the ground should be.
const EXPECTED_FOR: Duration = Duration::from_millis(700);
/// The same above or below: the ground is not level.
const ELSEWHERE_FOR: Duration = Duration::from_secs(2);
/// The same anywhere, of a vehicle that is shaken: vibration makes a controller turn its motors faster than the throttle says, so
/// that one in the air may sink slowly, or not at all. It is as still as this only if its thrust is its weight to 0.5 %. Ours.
const SHAKEN_FOR: Duration = Duration::from_secs(10);
/// Age of the newest height up to which it says that the vehicle is still.
const HEIGHT_AGE_MAX: Duration = Duration::from_millis(300);

/// What is known of a vehicle that lands.
#[derive(Debug, Clone, Copy)]
pub(super) struct Descent {
    /// The acceleration downwards that its sticks give at least, in m/s².
    pub(super) down_mps2: f64,
    /// Its height, in metres.
    pub(super) height_m: f64,
    /// Age of the newest measured height.
    pub(super) height_age: Duration,
    /// Whether its reference has come to the ground.
    pub(super) is_expected: bool,
    /// Whether its motors tremble.
    pub(super) is_shaken: bool,
}

/// Looks for the ground: the vehicle is to go down, and doesn't.
#[derive(Debug, Default)]
pub(super) struct Touchdown {
    /// Since when it has been still where the ground should be, or now; and at which height it has been still.
    still: Option<(Timestamp, f64)>,
    pressed_since: Option<Timestamp>,
    is_shaken: bool,
}

impl Touchdown {
    /// Whether the vehicle is pressed down, and may stand on the ground.
    pub(super) const fn is_pressed(&self) -> bool {
        self.pressed_since.is_some()
    }

    /// How long a vehicle that lands has been still where the ground should be.
    pub(super) fn still_for(&self, now: Timestamp) -> Duration {
        (self.still).map_or(Duration::ZERO, |(since, _)| now.since(since))
    }

    /// Whether the vehicle stands on the ground. `None`: it doesn't land, or nothing is known of it.
    pub(super) fn look(&mut self, now: Timestamp, descent: Option<Descent>) -> bool {
        let Some(descent) = descent.filter(|it| it.height_age <= HEIGHT_AGE_MAX) else {
            *self = Self::default();
            return false;
        };
        if std::mem::replace(&mut self.is_shaken, descent.is_shaken) != descent.is_shaken {
            self.pressed_since = None;
        }
        let is_near = |height_m: f64| (height_m - descent.height_m).abs() < STILL_M;
        match self.still.filter(|&(_, height_m)| is_near(height_m)) {
            Some((_, height_m)) if !descent.is_expected => self.still = Some((now, height_m)),
            Some(_) => {}
            None => {
                self.still = Some((now, descent.height_m));
                self.pressed_since = None;
            }
        }
        if descent.down_mps2 < PRESSED_MPS2 {
            self.pressed_since = None;
            return false;
        }
        let lasts = match (descent.is_shaken, descent.is_expected) {
            (true, _) => SHAKEN_FOR,
            (false, true) => EXPECTED_FOR,
            (false, false) => ELSEWHERE_FOR,
        };
        now.since(*self.pressed_since.get_or_insert(now)) >= lasts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STANDING: Descent = Descent {
        down_mps2: 4.0,
        height_m: 0.1,
        height_age: Duration::from_millis(100),
        is_expected: true,
        is_shaken: false,
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
        let seems_to_move = |now: u64| Descent {
            height_m: if now % 200 < 100 { 0.2 } else { 0.0 },
            ..STANDING
        };
        assert_eq!(found_after(seems_to_move), Some(700));
    }

    #[test]
    fn a_shaken_vehicle_stands_only_if_it_is_still_for_ten_seconds() {
        let shaken = Descent {
            is_shaken: true,
            ..STANDING
        };
        let mut touchdown = Touchdown::default();
        let stands = |touchdown: &mut Touchdown, seconds: u64| {
            touchdown.look(Timestamp::from_nanos(seconds * 1_000_000_000), Some(shaken))
        };
        assert!((0..10).all(|seconds| !stands(&mut touchdown, seconds)));
        assert!(stands(&mut touchdown, 10));
    }

    #[test]
    fn what_pressed_a_shaken_vehicle_does_not_count_once_it_is_calm() {
        let mut touchdown = Touchdown::default();
        let mut stands = |milliseconds: u64, is_shaken| {
            let at = Timestamp::from_nanos(milliseconds * 1_000_000);
            touchdown.look(
                at,
                Some(Descent {
                    is_shaken,
                    ..STANDING
                }),
            )
        };
        assert!((0..90).all(|tenth| !stands(tenth * 100, true)));
        assert!(!stands(9_000, false) && !stands(9_600, false));
        assert!(stands(9_700, false));
    }

    #[test]
    fn a_vehicle_that_brakes_above_the_ground_is_not_still() {
        let mut touchdown = Touchdown::default();
        let brakes = Descent {
            down_mps2: 0.0,
            is_expected: false,
            ..STANDING
        };
        let at = |milliseconds: u64| Timestamp::from_nanos(milliseconds * 1_000_000);
        for now in [0, 1_000, 2_000] {
            touchdown.look(at(now), Some(brakes));
        }
        assert_eq!(touchdown.still_for(at(2_000)), Duration::ZERO);
        touchdown.look(at(2_020), Some(STANDING));
        assert_eq!(touchdown.still_for(at(2_500)), Duration::from_millis(500));
    }

    #[test]
    fn a_vehicle_that_moves_or_is_not_pressed_or_not_measured_does_not() {
        let sinks = |now: u64| Descent {
            height_m: 10.0 - 0.5 * now as f64 / 1_000.0,
            ..STANDING
        };
        assert_eq!(found_after(sinks), None);
        let hovers = Descent {
            down_mps2: 2.0,
            ..STANDING
        };
        assert_eq!(found_after(|_| hovers), None);
        let is_unseen = Descent {
            height_age: Duration::from_millis(400),
            ..STANDING
        };
        assert_eq!(found_after(|_| is_unseen), None);
        // It is pressed for half a second at a time.
        let stops = |now: u64| if now % 600 < 500 { STANDING } else { hovers };
        assert_eq!(found_after(stops), None);
    }
}
