//! Signals every 10 ms, and least squares over short windows.

use std::ops::Range;

use nalgebra::{DMatrix, DVector, Matrix2, Vector2};

/// From one value of a signal to the next, in seconds.
const STEP_S: f64 = 0.01;
/// Length of a window, in seconds: the two steps of a movement there and back fit into it nearly, and drifts do not.
const WINDOW_S: f64 = 5.0;
/// Fewest places in a window, which has three unknowns of its own.
const PLACES_MIN: usize = 10;

/// A signal that is known every 10 ms.
#[derive(Debug, Clone)]
pub(super) struct Signal {
    start_s: f64,
    values: Vec<f64>,
}

impl Signal {
    /// Of values that hold from their time to that of the next one, in order; 0 before the first.
    pub(super) fn held(points: impl Iterator<Item = (f64, f64)>, span: &Range<f64>) -> Self {
        let mut points = points.peekable();
        let mut held = 0.0;
        let mut values = Vec::new();
        let mut at_s = span.start;
        while at_s < span.end {
            while let Some((_, value)) = points.next_if(|(from_s, _)| *from_s <= at_s) {
                held = value;
            }
            values.push(held);
            at_s += STEP_S;
        }
        let start_s = span.start;
        Self { start_s, values }
    }

    /// The signal later, and through a first-order lag.
    pub(super) fn lagged(&self, delay_s: f64, lag_s: f64) -> Self {
        let share = match lag_s > 0.0 {
            true => 1.0 - (-STEP_S / lag_s).exp(),
            false => 1.0,
        };
        let mut value = self.values.first().copied().unwrap_or_default();
        let values = self.values.iter().map(|goal| {
            value += (goal - value) * share;
            value
        });
        Self {
            start_s: self.start_s + delay_s,
            values: values.collect(),
        }
    }

    pub(super) fn map(&self, value: impl Fn(f64) -> f64) -> Self {
        Self {
            start_s: self.start_s,
            values: self.values.iter().map(|it| value(*it)).collect(),
        }
    }

    /// This signal and another of the same times, each with its share.
    pub(super) fn plus(&self, other: &Self, own_share: f64, others_share: f64) -> Self {
        let pairs = self.values.iter().zip(&other.values);
        let values = pairs.map(|(own, others)| own * own_share + others * others_share);
        Self {
            start_s: self.start_s,
            values: values.collect(),
        }
    }

    /// Its value at a time; the first or last beyond its ends.
    pub(super) fn at(&self, at_s: f64) -> f64 {
        let last = self.values.len().saturating_sub(1);
        let index = ((at_s - self.start_s) / STEP_S).max(0.0) as usize;
        self.values
            .get(index.min(last))
            .copied()
            .unwrap_or_default()
    }
}

/// How a place follows from an acceleration: `gain` times it, less a drag.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fit {
    pub(super) gain: f64,
    pub(super) drag_per_s: f64,
    /// What it leaves, summed over squares, in m².
    pub(super) left_m2: f64,
}

/// Normal equations of gain and drag. What a window starts with (place, velocity, a constant acceleration: wind, a wrong hover
/// throttle) is eliminated window by window.
#[derive(Debug, Default)]
pub(super) struct Equations {
    squares: Matrix2<f64>,
    products: Vector2<f64>,
    places_m2: f64,
}

impl Equations {
    /// Adds the places of an axis, each with its time, in a span.
    pub(super) fn add(&mut self, places: &[(f64, f64)], acceleration: &Signal, span: &Range<f64>) {
        let mut from_s = span.start;
        while from_s < span.end {
            let window = from_s..(from_s + WINDOW_S).min(span.end);
            let within: Vec<_> = places
                .iter()
                .copied()
                .filter(|(at_s, _)| window.contains(at_s))
                .collect();
            if within.len() >= PLACES_MIN {
                self.add_window(&within, acceleration);
            }
            from_s = window.end;
        }
    }

    fn add_window(&mut self, places: &[(f64, f64)], acceleration: &Signal) {
        let count = places.len();
        let start_s = places[0].0;
        let own = DMatrix::from_fn(count, 3, |row, power| {
            let since_s = places[row].0 - start_s;
            [1.0, since_s, since_s * since_s][power]
        });
        let own = own.qr().q();
        let rest = |it: DVector<f64>| &it - &own * (own.transpose() * &it);
        let place = DVector::from_iterator(count, places.iter().map(|it| it.1));
        let drag = DVector::from_vec(integral(places));
        let place_twice = DVector::from_vec(twice_integrated(places, acceleration));
        let [place, by_gain, by_drag] = [place, place_twice, -drag].map(rest);
        let columns = [&by_gain, &by_drag];
        self.squares += Matrix2::from_fn(|row, column| columns[row].dot(columns[column]));
        self.products += Vector2::from_fn(|row, _| columns[row].dot(&place));
        self.places_m2 += place.norm_squared();
    }

    /// The best gain and drag. `None` if the flight does not tell them.
    pub(super) fn solve(&self) -> Option<Fit> {
        let best = self.squares.try_inverse()? * self.products;
        Some(Fit {
            gain: best.x,
            drag_per_s: best.y,
            left_m2: self.places_m2 - best.dot(&self.products),
        })
    }
}

/// The integral of the places over time, at each of them.
fn integral(places: &[(f64, f64)]) -> Vec<f64> {
    let mut sum = 0.0;
    let mut before = places[0];
    let each = places.iter().map(|&(at_s, place_m)| {
        sum += (at_s - before.0) * (place_m + before.1) / 2.0;
        before = (at_s, place_m);
        sum
    });
    each.collect()
}

/// An acceleration integrated twice from the first place on, at each of them.
fn twice_integrated(places: &[(f64, f64)], acceleration: &Signal) -> Vec<f64> {
    let (mut at_s, mut velocity, mut place) = (places[0].0, 0.0, 0.0);
    let each = places.iter().map(|&(until_s, _)| {
        while at_s < until_s {
            let step_s = STEP_S.min(until_s - at_s);
            place += velocity * step_s;
            velocity += acceleration.at(at_s) * step_s;
            at_s += step_s;
        }
        place
    });
    each.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gain_and_drag_of_a_known_motion_are_found_beneath_a_wind() {
        let (gain, drag_per_s, wind_mps2) = (0.8, 0.5, 0.3);
        let span = 0.0..20.0;
        let push = |at_s: f64| {
            if ((at_s / 2.0) as u64).is_multiple_of(2) {
                1.5
            } else {
                -1.5
            }
        };
        let pushes = (0..2_000).map(|step| f64::from(step) * STEP_S);
        let acceleration = Signal::held(pushes.map(|at_s| (at_s, push(at_s))), &span);
        let (mut velocity, mut place) = (0.2, 4.0);
        let mut places = Vec::new();
        for step in 0..20_000_u32 {
            let at_s = f64::from(step) * 1e-3;
            if step % 100 == 0 {
                places.push((at_s, place));
            }
            velocity += 1e-3 * (gain * acceleration.at(at_s) + wind_mps2 - drag_per_s * velocity);
            place += 1e-3 * velocity;
        }
        let mut equations = Equations::default();
        equations.add(&places, &acceleration, &span);
        let fit = equations.solve().unwrap();
        assert!((fit.gain - gain).abs() < 0.02, "{fit:?}");
        assert!((fit.drag_per_s - drag_per_s).abs() < 0.03, "{fit:?}");
    }

    #[test]
    fn flight_without_acceleration_gives_no_response() {
        let places: Vec<_> = (0..100).map(|step| (f64::from(step) / 10.0, 0.0)).collect();
        let still = Signal::held(std::iter::empty(), &(0.0..10.0));
        let mut equations = Equations::default();
        equations.add(&places, &still, &(0.0..10.0));
        assert!(equations.solve().is_none());
    }

    #[test]
    fn lagged_signal_reaches_63_percent_after_its_delay_and_lag() {
        let step = Signal::held([(1.0, 1.0)].into_iter(), &(0.0..3.0));
        let lagged = step.lagged(0.05, 0.1);
        assert!(lagged.at(1.04).abs() < 1e-9);
        assert!(
            (lagged.at(1.15) - 0.632).abs() < 0.05,
            "{}",
            lagged.at(1.15)
        );
    }
}
