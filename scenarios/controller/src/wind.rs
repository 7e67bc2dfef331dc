//! Wind: a constant velocity and gusts.

use nalgebra::Vector3;

use crate::noise::Noise;

/// Wind at all heights.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Wind {
    /// Mean velocity of the air, in m/s north, east and down.
    pub mean_mps: Vector3<f64>,
    /// Standard deviation of gusts along each level axis, in m/s. Near the ground, vertical ones are weaker.
    pub gusts_mps: f64,
}

/// Airspeed that counts at least, in m/s, so that gusts end in calm air, too.
const AIRSPEED_MIN_MPS: f64 = 3.0;
/// Heights between which gusts depend on it, in feet (MIL-F-8785C, 3.7.3.4).
const HEIGHTS_FT: [f64; 2] = [10.0, 1_000.0];
/// A foot in metres.
const FOOT_M: f64 = 0.3048;

/// How gusts are at a height.
#[derive(Debug, Clone, Copy)]
struct Scale {
    /// Their length along a level axis, and along the vertical one, in metres.
    lengths_m: [f64; 2],
    /// Standard deviation along the vertical axis, as a multiple of that along a level one.
    vertical_share: f64,
}

impl Scale {
    /// At a height above the ground (MIL-F-8785C, 3.7.3.4).
    fn at(height_m: f64) -> Self {
        let [low, high] = HEIGHTS_FT;
        let height_ft = (height_m / FOOT_M).clamp(low, high);
        let base = 0.177 + 0.000_823 * height_ft;
        Self {
            lengths_m: [height_ft / libm::pow(base, 1.2), height_ft].map(|it| it * FOOT_M),
            vertical_share: libm::pow(base, 0.4),
        }
    }
}

/// Gusts with the longitudinal spectrum of Dryden (MIL-F-8785C, 3.7.1.2) on all three axes: the state of a first-order filter
/// of white noise. The form for the other two axes has a second order, which is left out.
#[derive(Debug, Clone)]
pub(crate) struct Gusts {
    noise: Noise<3>,
    /// Each axis relative to its standard deviation.
    state: Vector3<f64>,
}

impl Gusts {
    pub(crate) fn new(seed: u64, stream: u64) -> Self {
        Self {
            noise: Noise::new(seed, stream),
            state: Vector3::zeros(),
        }
    }

    /// Moves on by `step_s` seconds at an airspeed and a height above the ground; yields the velocity of the air.
    pub(crate) fn step(
        &mut self,
        wind: &Wind,
        step: u64,
        (airspeed_mps, height_m): (f64, f64),
        step_s: f64,
    ) -> Vector3<f64> {
        if wind.gusts_mps <= 0.0 {
            return wind.mean_mps;
        }
        let scale = Scale::at(height_m);
        let [level_m, vertical_m] = scale.lengths_m;
        let distance_m = airspeed_mps.max(AIRSPEED_MIN_MPS) * step_s;
        let shares = Vector3::new(level_m, level_m, vertical_m).map(|length| distance_m / length);
        let driven = shares.map(|share| libm::sqrt(2.0 * share));
        let noise = Vector3::from(self.noise.at(step));
        self.state += noise.component_mul(&driven) - self.state.component_mul(&shares);
        let deviations = Vector3::new(1.0, 1.0, scale.vertical_share) * wind.gusts_mps;
        wind.mean_mps + self.state.component_mul(&deviations)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gusts_have_the_stated_deviations() {
        let wind = Wind {
            mean_mps: Vector3::new(5.0, 0.0, 0.0),
            gusts_mps: 1.5,
        };
        let mut gusts = Gusts::new(1, 0);
        let count = 500_000;
        let (mut sum, mut squares) = (Vector3::zeros(), Vector3::zeros());
        for step in 0..count {
            let air = gusts.step(&wind, step, (10.0, 2.0), 1e-2);
            sum += air;
            squares += air.component_mul(&air);
        }
        let mean = sum / count as f64;
        let deviation = (squares / count as f64 - mean.component_mul(&mean)).map(f64::sqrt);
        assert!((mean - wind.mean_mps).norm() < 0.1, "{mean}");
        // 0.185 to the power of 0.4 is 0.51.
        assert!(
            (deviation - Vector3::new(1.5, 1.5, 0.76)).norm() < 0.1,
            "{deviation}"
        );
    }

    #[test]
    fn gusts_are_shorter_and_vertical_ones_weaker_near_the_ground() {
        let [low, high] = [0.0, 400.0].map(Scale::at);
        assert!((low.lengths_m[0] - 23.0).abs() < 0.5, "{low:?}");
        assert!((low.lengths_m[1] - 3.05).abs() < 0.01, "{low:?}");
        assert!((high.lengths_m[0] - 304.8).abs() < 0.5, "{high:?}");
        assert!((high.vertical_share - 1.0).abs() < 1e-3, "{high:?}");
    }
}
