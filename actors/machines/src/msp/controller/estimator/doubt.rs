//! Positions that the estimate is to begin with.

use std::time::Duration;

use super::axis::Axis;
use crate::time::Timestamp;

/// Positions in a row that agree with each other and count more than an estimate: sensors' outliers seldom agree.
const AGREEING: u32 = 3;
/// Largest difference of two positions that agree, in standard deviations of each axis.
const SIGMAS: f64 = 5.0;
/// Fastest motion along an axis between positions that agree, in m/s: a leg's speed.
const SPEED_MAX_MPS: f64 = 10.0;

/// Positions on some axes, in a row, that are near each other.
#[derive(Debug, Clone, Copy)]
pub(super) struct Doubt<const N: usize> {
    count: u32,
    sum_m: [f64; N],
    first: Seen<N>,
    last: Seen<N>,
    age: Duration,
}

/// A position in metres, and when the vehicle was there.
#[derive(Debug, Clone, Copy)]
struct Seen<const N: usize> {
    at: Timestamp,
    position_m: [f64; N],
    sigma_m: f64,
}

impl<const N: usize> Doubt<N> {
    /// Another position, with its standard deviation and age. It begins a new row if it is far from the last.
    fn of(
        before: Option<Self>,
        now: Timestamp,
        position_m: [f64; N],
        (sigma_m, age): (f64, Duration),
    ) -> Self {
        let last = Seen {
            at: Timestamp::ZERO + now.since(Timestamp::ZERO).saturating_sub(age),
            position_m,
            sigma_m,
        };
        match before {
            Some(doubt) if doubt.last.agrees_with(&last) => Self {
                count: doubt.count + 1,
                sum_m: std::array::from_fn(|axis| doubt.sum_m[axis] + position_m[axis]),
                last,
                age,
                ..doubt
            },
            _ => Self {
                count: 1,
                sum_m: position_m,
                first: last,
                last,
                age,
            },
        }
    }

    /// The motion that they tell, once they count. What differs by no more than errors do is at rest.
    fn axes(&self) -> Option<[Axis; N]> {
        let seconds = self.last.at.since(self.first.at).as_secs_f64();
        if self.count < AGREEING || seconds <= 0.0 {
            return None;
        }
        Some(std::array::from_fn(|axis| {
            let moved_m = self.last.position_m[axis] - self.first.position_m[axis];
            let sigma_m = self.last.sigma_m;
            if moved_m.abs() <= SIGMAS * sigma_m {
                let count = f64::from(self.count);
                return Axis::at(self.sum_m[axis] / count, sigma_m * sigma_m / count);
            }
            let since_m = moved_m / seconds * self.age.as_secs_f64();
            let here_m = self.last.position_m[axis] + since_m;
            Axis::moving(here_m, moved_m, seconds, sigma_m)
        }))
    }
}

impl<const N: usize> Seen<N> {
    fn agrees_with(&self, later: &Self) -> bool {
        let reach_m = SIGMAS * (self.sigma_m + later.sigma_m)
            + SPEED_MAX_MPS * later.at.since(self.at).as_secs_f64();
        let mut pairs = self.position_m.iter().zip(later.position_m);
        pairs.all(|(before, after)| (after - before).abs() <= reach_m)
    }
}

/// Takes in another position that does not agree with the estimate. Returns the motion to begin anew with, once some agree.
pub(super) fn begin<const N: usize>(
    doubt: &mut Option<Doubt<N>>,
    now: Timestamp,
    position_m: [f64; N],
    error: (f64, Duration),
) -> Option<[Axis; N]> {
    let grown = Doubt::of(doubt.take(), now, position_m, error);
    let axes = grown.axes();
    *doubt = axes.is_none().then_some(grown);
    axes
}
