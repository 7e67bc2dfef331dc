//! Poses that the estimate is to begin with.

use std::time::Duration;

use super::axis::Axis;
use crate::time::Timestamp;

/// Poses in a row that agree with each other and count more than an estimate: sensors' outliers seldom agree.
const POSES: u32 = 3;
/// Largest difference of two poses that agree, in standard deviations of each axis.
const SIGMAS: f64 = 5.0;
/// Fastest motion along an axis between poses that agree, in m/s: a leg's speed.
const SPEED_MAX_MPS: f64 = 10.0;

/// Poses in a row that are near each other.
#[derive(Debug, Clone, Copy)]
pub(super) struct Doubt {
    poses: u32,
    /// Sum of their places.
    sum: [f64; 3],
    first: Seen,
    last: Seen,
    age: Duration,
}

/// A place north, east and up, in metres, when the vehicle was there.
#[derive(Debug, Clone, Copy)]
struct Seen {
    at: Timestamp,
    place: [f64; 3],
    sigma_m: f64,
}

impl Doubt {
    /// Another pose, with its standard deviation and age. It begins a new row if it is far from the last.
    pub(super) fn of(
        before: Option<Self>,
        now: Timestamp,
        place: [f64; 3],
        (sigma_m, age): (f64, Duration),
    ) -> Self {
        let last = Seen {
            at: Timestamp::ZERO + now.since(Timestamp::ZERO).saturating_sub(age),
            place,
            sigma_m,
        };
        match before {
            Some(doubt) if doubt.last.agrees_with(&last) => Self {
                poses: doubt.poses + 1,
                sum: std::array::from_fn(|axis| doubt.sum[axis] + place[axis]),
                last,
                age,
                ..doubt
            },
            _ => Self {
                poses: 1,
                sum: place,
                first: last,
                last,
                age,
            },
        }
    }

    /// The motion that the poses tell, once they count. What differs by no more than errors do is at rest.
    pub(super) fn axes(&self) -> Option<[Axis; 3]> {
        let seconds = self.last.at.since(self.first.at).as_secs_f64();
        if self.poses < POSES || seconds <= 0.0 {
            return None;
        }
        Some(std::array::from_fn(|axis| {
            let moved_m = self.last.place[axis] - self.first.place[axis];
            let sigma_m = self.last.sigma_m;
            if moved_m.abs() <= SIGMAS * sigma_m {
                let poses = f64::from(self.poses);
                return Axis::at(self.sum[axis] / poses, sigma_m * sigma_m / poses);
            }
            let since_m = moved_m / seconds * self.age.as_secs_f64();
            let here_m = self.last.place[axis] + since_m;
            Axis::moving(here_m, moved_m, seconds, sigma_m)
        }))
    }
}

impl Seen {
    fn agrees_with(&self, later: &Self) -> bool {
        let reach_m = SIGMAS * (self.sigma_m + later.sigma_m)
            + SPEED_MAX_MPS * later.at.since(self.at).as_secs_f64();
        let mut pairs = self.place.iter().zip(later.place);
        pairs.all(|(before, after)| (after - before).abs() <= reach_m)
    }
}
