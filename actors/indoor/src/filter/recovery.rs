//! Whether the readings still fit the place, and how many particles are to look elsewhere.

use super::config::{Config, RecoveryAlpha};

/// The long average counts up to this fit: in the Málaga data half of true poses have less, so less is no sign of a wrong one.
const LONG_MAX: f64 = 0.97;

/// A slow and a fast average of how well the readings fit.
///
/// Source: augmented MCL; S. Thrun, W. Burgard, D. Fox, *Probabilistic Robotics*, 2005, table 8.3. Deviation: the fit is that of
/// the best pose and has a scale of its own, so that a filter that never fitted looks elsewhere, too.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Recovery {
    averages: Option<(f64, f64)>,
    fit: Option<f64>,
}

impl Recovery {
    /// Few readings tell little, so averages follow them slower.
    pub(super) fn observe(&mut self, fit: f64, readings: usize, config: &Config) {
        let weight = (readings as f64 / config.observations).min(1.0);
        let before = self.fit.unwrap_or(fit);
        self.fit = Some(before + weight * (fit - before));
        self.averages = config.recovery_alpha.map(|alpha| {
            let RecoveryAlpha { slow, fast } = alpha;
            let (long, short) = self.averages.unwrap_or((fit, fit));
            (
                long + weight * slow * (fit - long),
                short + weight * fast * (fit - short),
            )
        });
    }

    /// The share of particles that are to be drawn from anywhere; none while the readings fit as they did, or better than
    /// [`LONG_MAX`] and `fit_found`.
    pub(super) fn elsewhere(&self, fit_found: f64) -> f64 {
        let (long, short) = self.averages.unwrap_or((1.0, 1.0));
        (1.0 - short / long.min(LONG_MAX).max(fit_found)).max(0.0)
    }

    /// The fit of about the last `config.observations` readings; 0 before the first.
    pub(super) fn fit(&self) -> f64 {
        self.fit.unwrap_or(0.0)
    }
}
