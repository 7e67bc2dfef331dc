//! The Kalman filter of one axis.

/// Innovations beyond this many standard deviations are rejected.
const GATE: f64 = 5.0;

/// Position and velocity along one axis, and their covariance.
#[derive(Debug, Clone, Copy)]
pub(super) struct Axis {
    pub(super) position_m: f64,
    pub(super) velocity_mps: f64,
    /// Variance of the position, covariance, variance of the velocity.
    covariance: [f64; 3],
}

/// What an accepted measurement changed on an axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct Correction {
    /// By how much the position changed, in metres.
    pub(super) by_m: f64,
    /// What the measurement differed by from the prediction, in standard deviations of the difference.
    pub(super) normalised: f64,
}

impl Correction {
    const NONE: Self = Self {
        by_m: 0.0,
        normalised: 0.0,
    };
}

impl Axis {
    /// At rest, as far as is known: within 1 m/s.
    pub(super) const fn at(position_m: f64, variance_m2: f64) -> Self {
        Self {
            position_m,
            velocity_mps: 0.0,
            covariance: [variance_m2, 0.0, 1.0],
        }
    }

    /// Where positions `seconds` apart say that it is, each with a standard deviation.
    pub(super) const fn moving(position_m: f64, moved_m: f64, seconds: f64, sigma_m: f64) -> Self {
        let variance_m2 = sigma_m * sigma_m;
        Self {
            position_m,
            velocity_mps: moved_m / seconds,
            covariance: [
                variance_m2,
                variance_m2 / seconds,
                2.0 * variance_m2 / (seconds * seconds),
            ],
        }
    }

    /// Standard deviation of the position, in metres.
    pub(super) fn sigma_m(&self) -> f64 {
        libm::sqrt(self.covariance[0])
    }

    pub(super) fn predict(&mut self, seconds: f64, acceleration_mps2: f64, noise_mps2: f64) {
        self.position_m += (self.velocity_mps + acceleration_mps2 * seconds / 2.0) * seconds;
        self.velocity_mps += acceleration_mps2 * seconds;
        let [pp, pv, vv] = self.covariance;
        let noise = noise_mps2 * noise_mps2;
        self.covariance = [
            pp + 2.0 * pv * seconds
                + vv * seconds * seconds
                + noise * seconds * seconds * seconds / 3.0,
            pv + vv * seconds + noise * seconds * seconds / 2.0,
            vv + noise * seconds,
        ];
    }

    /// Takes in a measured position. `None`, and changes nothing, if it is too far away.
    pub(super) fn measure_position(&mut self, measured_m: f64, sigma_m: f64) -> Option<Correction> {
        let innovation_m = measured_m - self.position_m;
        correct([self], [innovation_m], sigma_m).map(|[it]| it)
    }

    /// Takes in a measured velocity. `None`, and changes nothing, if it is too far away.
    pub(super) fn measure_velocity(
        &mut self,
        measured_mps: f64,
        sigma_mps: f64,
    ) -> Option<Correction> {
        let [pp, pv, vv] = self.covariance;
        let variance = vv + sigma_mps * sigma_mps;
        let innovation = measured_mps - self.velocity_mps;
        let normalised = normalised_if_near(innovation, variance)?;
        let (gain_p, gain_v) = (pv / variance, vv / variance);
        self.position_m += gain_p * innovation;
        self.velocity_mps += gain_v * innovation;
        self.covariance = [pp - gain_p * pv, pv - gain_p * vv, vv - gain_v * vv];
        Some(Correction {
            by_m: gain_p * innovation,
            normalised,
        })
    }

    /// Corrects the motion by what a measured position differs from the prediction. Returns by how much the position changes.
    fn correct(&mut self, innovation_m: f64, sigma_m: f64) -> f64 {
        let [pp, pv, vv] = self.covariance;
        let variance = pp + sigma_m * sigma_m;
        let (gain_p, gain_v) = (pp / variance, pv / variance);
        self.position_m += gain_p * innovation_m;
        self.velocity_mps += gain_v * innovation_m;
        self.covariance = [pp - gain_p * pp, pv - gain_p * pv, vv - gain_v * pv];
        gain_p * innovation_m
    }
}

/// An innovation in its standard deviations. `None` if it is too large, or not a number.
fn normalised_if_near(innovation: f64, variance: f64) -> Option<f64> {
    let normalised = innovation / libm::sqrt(variance);
    (normalised.abs() <= GATE).then_some(normalised)
}

/// Corrects axes by what one measurement of their positions differs from the predictions. `None`, and changes nothing, if the
/// measurement is too far away on any axis.
pub(super) fn correct<const N: usize>(
    axes: [&mut Axis; N],
    innovations_m: [f64; N],
    sigma_m: f64,
) -> Option<[Correction; N]> {
    let mut corrections = [Correction::NONE; N];
    let pairs = axes.iter().zip(innovations_m);
    for ((axis, innovation_m), correction) in pairs.zip(&mut corrections) {
        let variance = axis.covariance[0] + sigma_m * sigma_m;
        correction.normalised = normalised_if_near(innovation_m, variance)?;
    }
    let pairs = axes.into_iter().zip(innovations_m);
    for ((axis, innovation_m), correction) in pairs.zip(&mut corrections) {
        correction.by_m = axis.correct(innovation_m, sigma_m);
    }
    Some(corrections)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_measurement_that_is_no_number_or_far_away_changes_nothing() {
        let mut axis = Axis::at(1.0, 0.01);
        for measured in [f64::NAN, f64::INFINITY, 9.0] {
            assert!(axis.measure_position(measured, 0.1).is_none());
            assert!(axis.measure_velocity(measured, 0.1).is_none());
            assert!((axis.position_m - 1.0).abs() + axis.velocity_mps.abs() <= 0.0);
        }
        let near = axis.measure_position(1.1, 0.1).map(|it| it.normalised);
        assert!(near.is_some_and(|it| (it - 0.5_f64.sqrt()).abs() < 1e-9));
    }
}
