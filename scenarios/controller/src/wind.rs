//! Wind: a constant velocity and gusts.

use nalgebra::Vector3;

use crate::noise::Noise;

/// Wind at all heights.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Wind {
    /// Mean velocity of the air, in m/s north, east and down.
    pub mean_mps: Vector3<f64>,
    /// Standard deviation of gusts along each axis, in m/s.
    pub gusts_mps: f64,
}

/// Length of gusts, in metres. MIL-F-8785C has 50 to 300 m for flight below 100 m.
const GUST_LENGTH_M: f64 = 100.0;

/// Airspeed that counts at least, in m/s, so that gusts end in calm air, too.
const AIRSPEED_MIN_MPS: f64 = 3.0;

/// Gusts with the longitudinal spectrum of Dryden (MIL-F-8785C, 3.7.1.2) on all three axes: the state of a first-order filter
/// of white noise. The form for the other two axes has a second order, which is left out.
#[derive(Debug, Clone)]
pub(crate) struct Gusts {
    noise: Noise<3>,
    state: Vector3<f64>,
}

impl Gusts {
    pub(crate) fn new(seed: u64, stream: u64) -> Self {
        Self {
            noise: Noise::new(seed, stream),
            state: Vector3::zeros(),
        }
    }

    /// Moves on by `step_s` seconds at an airspeed; yields the velocity of the air.
    pub(crate) fn step(
        &mut self,
        wind: &Wind,
        step: u64,
        airspeed_mps: f64,
        step_s: f64,
    ) -> Vector3<f64> {
        if wind.gusts_mps <= 0.0 {
            return wind.mean_mps;
        }
        let share = airspeed_mps.max(AIRSPEED_MIN_MPS) * step_s / GUST_LENGTH_M;
        let driven = wind.gusts_mps * libm::sqrt(2.0 * share);
        self.state += Vector3::from(self.noise.at(step)) * driven - self.state * share;
        wind.mean_mps + self.state
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gusts_have_the_stated_deviation() {
        let wind = Wind {
            mean_mps: Vector3::new(5.0, 0.0, 0.0),
            gusts_mps: 1.5,
        };
        let mut gusts = Gusts::new(1, 0);
        let count = 2_000_000;
        let (mut sum, mut squares) = (0.0, 0.0);
        for step in 0..count {
            let north = gusts.step(&wind, step, 10.0, 1e-2).x;
            sum += north;
            squares += north * north;
        }
        let mean = sum / count as f64;
        let deviation = (squares / count as f64 - mean * mean).sqrt();
        assert!((mean - 5.0).abs() < 0.1, "{mean}");
        assert!((deviation - 1.5).abs() < 0.1, "{deviation}");
    }
}
