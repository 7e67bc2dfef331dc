//! Whether the readings still fit the place, and how many particles are to look elsewhere.

use super::config::Config;

/// A slow and a fast average of how well the readings fit.
///
/// Source: augmented MCL; S. Thrun, W. Burgard, D. Fox, *Probabilistic Robotics*, 2005, table 8.3. Deviation: the fit is that of
/// the best pose and has a scale of its own, so that a filter that never fitted looks elsewhere, too.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Recovery {
    averages: Option<(f64, f64)>,
    fit: f64,
}

impl Recovery {
    /// Few readings tell little, so averages follow them slower.
    pub(super) fn observe(&mut self, fit: f64, readings: usize, config: &Config) {
        let weight = (readings as f64 / config.observations).min(1.0);
        let (slow, fast) = self.averages.unwrap_or((fit, fit));
        if self.averages.is_none() {
            self.fit = fit;
        }
        self.fit += weight * (fit - self.fit);
        self.averages = Some((
            slow + weight * config.recovery_alpha_slow * (fit - slow),
            fast + weight * config.recovery_alpha_fast * (fit - fast),
        ));
    }

    /// The share of particles that are to be drawn from anywhere; none while the readings fit as they did, or better than
    /// `fit_found`.
    pub(super) fn elsewhere(&self, fit_found: f64) -> f64 {
        let (slow, fast) = self.averages.unwrap_or((1.0, 1.0));
        (1.0 - fast / slow.max(fit_found)).max(0.0)
    }

    /// The fit of about the last `config.observations` readings.
    pub(super) fn fit(&self) -> f64 {
        self.fit
    }
}
