//! How an aircraft responds to its sticks, from what a drone saw of a flight.

use muster_controller::GRAVITY_MPS2;

use super::TuneError;
use super::flight::{Commanded, Recording};
use super::signal::{Equations, Fit, Signal};

/// Largest delay that is tried, in steps of 10 ms.
const DELAY_MAX: u8 = 10;
/// Largest lag that is tried, in steps of 10 ms.
const LAG_MAX: u8 = 40;
/// What a thrust that grows with the square of the throttle gives, and how far from it a flight makes sense.
const THRUST_GAINS: std::ops::RangeInclusive<f64> = 0.4..=2.5;

/// How an aircraft responds to its sticks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Response {
    /// Throttle at which it hovers, 0 to 1.
    pub hover_throttle: f64,
    /// From a stick to the tilt: delay and first-order lag together, in seconds.
    pub attitude_lag_s: f64,
    /// Deceleration per horizontal velocity, in 1/s.
    pub drag_per_s: f64,
    /// Vertical acceleration for what the control asks for, which supposes that thrust grows with the square of the
    /// throttle.
    pub thrust_gain: f64,
    /// From the throttle to thrust, in seconds.
    pub thrust_lag_s: f64,
}

impl Response {
    /// The response of the aircraft that flew a test.
    pub(super) fn of(recording: &Recording) -> Result<Self, TuneError> {
        let hover_throttle = hover_throttle(recording).ok_or(TuneError::Unclear)?;
        let (delay_s, lag_s) = attitude_lag(recording);
        let drag = drag(recording, delay_s, lag_s).ok_or(TuneError::Unclear)?;
        let (thrust, thrust_lag_s) = thrust(recording, hover_throttle).ok_or(TuneError::Unclear)?;
        if !THRUST_GAINS.contains(&thrust.gain) {
            return Err(TuneError::Unclear);
        }
        Ok(Self {
            hover_throttle,
            attitude_lag_s: delay_s + lag_s,
            drag_per_s: drag.drag_per_s,
            thrust_gain: thrust.gain,
            thrust_lag_s,
        })
    }
}

/// The mean throttle of a hover, with the share of it that leaning takes.
fn hover_throttle(recording: &Recording) -> Option<f64> {
    let within = |it: &&Commanded| recording.hovers.contains(&it.at_s);
    let hovers: Vec<f64> = recording.commands.iter().filter(within).map(lift).collect();
    let count = hovers.len() as f64;
    (count > 0.0).then(|| (hovers.iter().sum::<f64>() / count).sqrt())
}

/// What the square of a throttle lifts with, at the tilt that is asked for with it.
fn lift(commanded: &Commanded) -> f64 {
    let [ahead, right] = commanded.tilt_rad;
    commanded.throttle * commanded.throttle * ahead.cos() * right.cos()
}

/// Delay and lag between the tilts that were asked for and those that were reported, in seconds.
fn attitude_lag(recording: &Recording) -> (f64, f64) {
    let asked = [0, 1].map(|axis| tilt(recording, axis));
    let mut best = (f64::INFINITY, (0.0, 0.0));
    for delay in 0..=DELAY_MAX {
        for lag in 0..=LAG_MAX {
            let (delay_s, lag_s) = (f64::from(delay) * 0.01, f64::from(lag) * 0.01);
            let lagged = asked.each_ref().map(|it| it.lagged(delay_s, lag_s));
            let error = tilt_error(recording, &lagged);
            if error < best.0 {
                best = (error, (delay_s, lag_s));
            }
        }
    }
    best.1
}

/// The tilts that were asked for about an axis.
fn tilt(recording: &Recording, axis: usize) -> Signal {
    let points = recording.commands.iter();
    let points = points.map(|it| (it.at_s, it.tilt_rad[axis]));
    Signal::held(points, &(0.0..recording.steps_up.end))
}

/// What remains of the reported tilts without these and a constant, summed over squares.
fn tilt_error(recording: &Recording, expected: &[Signal; 2]) -> f64 {
    let reported = recording.attitudes.iter();
    let reported = reported.filter(|it| recording.steps_sideways.contains(&it.at_s));
    let each = [0, 1].map(|axis| {
        let (mut count, mut sum, mut squares) = (0.0, 0.0, 0.0);
        for attitude in reported.clone() {
            let error = attitude.tilt_rad[axis] - expected[axis].at(attitude.at_s);
            (count, sum, squares) = (count + 1.0, sum + error, squares + error * error);
        }
        squares - sum * sum / f64::max(count, 1.0)
    });
    each.iter().sum()
}

/// The drag against the tilts that were asked for.
fn drag(recording: &Recording, delay_s: f64, lag_s: f64) -> Option<Fit> {
    let asked = [0, 1].map(|axis| {
        let lagged = tilt(recording, axis).lagged(delay_s, lag_s);
        lagged.map(|rad| GRAVITY_MPS2 * rad.tan())
    });
    // Nobody turns in this test.
    let (sin, cos) = recording.attitudes.first()?.yaw_rad.sin_cos();
    let [ahead, right] = &asked;
    let axes = [ahead.plus(right, cos, -sin), ahead.plus(right, sin, cos)];
    let mut equations = Equations::default();
    for (places, acceleration) in recording.places.iter().zip(&axes) {
        equations.add(places, acceleration, &recording.steps_sideways);
    }
    equations.solve()
}

/// The vertical acceleration against what the throttle asked for, and the lag in seconds that fits best.
fn thrust(recording: &Recording, hover_throttle: f64) -> Option<(Fit, f64)> {
    let points = recording.commands.iter().map(|it| {
        let share = lift(it) / (hover_throttle * hover_throttle);
        (it.at_s, GRAVITY_MPS2 * (share - 1.0))
    });
    let asked = Signal::held(points, &(0.0..recording.steps_up.end));
    let fits = (0..=LAG_MAX).filter_map(|lag| {
        let lag_s = f64::from(lag) * 0.01;
        let mut equations = Equations::default();
        let lagged = asked.lagged(0.0, lag_s);
        equations.add(&recording.places[2], &lagged, &recording.steps_up);
        equations.solve().map(|fit| (fit, lag_s))
    });
    fits.min_by(|(one, _), (other, _)| one.left_m2.total_cmp(&other.left_m2))
}
