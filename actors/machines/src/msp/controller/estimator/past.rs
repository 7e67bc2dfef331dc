//! Where a vehicle was a moment ago.

use std::collections::VecDeque;
use std::time::Duration;

use super::AGE_MAX;
use crate::time::Timestamp;

/// From one noted position to the next.
const PAST_STEP: Duration = Duration::from_millis(10);

/// Where the vehicle was a moment ago, as it is known now. A measurement that took time is compared with it.
#[derive(Debug, Default)]
pub(super) struct Past {
    /// Oldest first; north, east and up, in metres.
    positions: VecDeque<(Timestamp, [f64; 3])>,
}

impl Past {
    pub(super) fn note(&mut self, now: Timestamp, position: [f64; 3]) {
        let last = self.positions.back().map(|(at, _)| *at);
        if last.is_some_and(|last| now.since(last) < PAST_STEP) {
            return;
        }
        while self
            .positions
            .front()
            .is_some_and(|(at, _)| now.since(*at) > AGE_MAX)
        {
            self.positions.pop_front();
        }
        self.positions.push_back((now, position));
    }

    /// The position `age` ago, between the two that are noted around it. `None` if none is.
    pub(super) fn before(&self, now: Timestamp, age: Duration) -> Option<[f64; 3]> {
        let after = self
            .positions
            .partition_point(|(at, _)| now.since(*at) > age);
        let (later, to) = self.positions.get(after).or(self.positions.back())?;
        let Some((earlier, from)) = after.checked_sub(1).and_then(|it| self.positions.get(it))
        else {
            return Some(*to);
        };
        let span_s = later.since(*earlier).as_secs_f64();
        let passed_s = now.since(*earlier).saturating_sub(age).as_secs_f64();
        let share = if span_s > 0.0 {
            (passed_s / span_s).min(1.0)
        } else {
            1.0
        };
        Some(std::array::from_fn(|axis| {
            from[axis] + (to[axis] - from[axis]) * share
        }))
    }

    /// Moves the first axes of all positions.
    pub(super) fn shift(&mut self, by_m: &[f64]) {
        for (_, position) in &mut self.positions {
            for (axis, by_m) in position.iter_mut().zip(by_m) {
                *axis += by_m;
            }
        }
    }
}
