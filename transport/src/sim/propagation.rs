use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::gamma::upper_regularised;

/// Propagation model: the delivery probability by distance.
///
/// It is drawn for each frame and receiver: a frame lasts a quarter of a millisecond and aircraft move, so the next frame
/// meets another fade. (The thesis's ancestor project draws once per second and pair. Its mean losses are the same, but come
/// in bursts of a second.)
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Propagation {
    /// Every frame within the range is delivered, none beyond; nothing is drawn.
    Range {
        /// Range in metres.
        range_m: f64,
    },
    /// Loss of the ancestor project's 802.11a model: 5.335e-7·d² + 3.395e-5·d with d in metres. 5 % at 275 m, 50 % at 937 m,
    /// 100 % at 1,338 m.
    Ieee80211a {
        /// Range limit in metres; nothing is delivered beyond.
        range_m: f64,
    },
    /// Log-distance path loss (exponent 2.0727, at 5.18 GHz) with Nakagami fading. The delivery probability is
    /// Q(m, m·(d / range)^2.0727) with the regularised upper incomplete gamma function Q. With a range of 299.9 m it agrees
    /// with ns-3.37 at 16 dBm and −82 dBm (802.11a, 6 Mb/s) within 0.012.
    Nakagami {
        /// Range without fading, in metres.
        range_m: f64,
        /// Shape m of the fading: 1 is Rayleigh fading without line of sight; larger values fade less.
        shape: f64,
    },
}

/// Path loss exponent of the reference simulations.
const EXPONENT: f64 = 2.0727;
/// Radios with a lower delivery probability count as out of reach.
const DELIVERY_MIN: f64 = 1e-4;
/// Distance at which the 802.11a model loses everything: the positive root of 5.335e-7·d² + 3.395e-5·d − 1.
const IEEE80211A_REACH_M: f64 = 1_337.65;
/// Number of steps of a tabulated curve; linear interpolation between them has an error below 1e-5.
const STEPS: u16 = 1_024;

impl Propagation {
    /// Delivery probability over a distance in metres, 0 to 1.
    #[must_use]
    pub fn delivery(self, distance_m: f64) -> f64 {
        match self {
            Self::Range { range_m } | Self::Ieee80211a { range_m } if distance_m > range_m => 0.0,
            Self::Range { .. } => 1.0,
            Self::Ieee80211a { .. } => (1.0 - ieee80211a_loss(distance_m)).max(0.0),
            Self::Nakagami { range_m, shape } => {
                let mean = libm::pow(distance_m / range_m, EXPONENT);
                upper_regularised(shape, shape * mean)
            }
        }
    }

    /// The configured range, in metres. With fading, some frames are delivered beyond it.
    #[must_use]
    pub const fn range_m(self) -> f64 {
        match self {
            Self::Range { range_m }
            | Self::Ieee80211a { range_m }
            | Self::Nakagami { range_m, .. } => range_m,
        }
    }

    /// Largest distance at which frames are delivered, in metres.
    fn reach_m(self) -> f64 {
        match self {
            Self::Range { range_m } => range_m,
            Self::Ieee80211a { range_m } => range_m.min(IEEE80211A_REACH_M),
            Self::Nakagami { range_m, .. } => {
                let (mut inside_m, mut outside_m) = (0.0, range_m);
                while self.delivery(outside_m) > DELIVERY_MIN {
                    inside_m = outside_m;
                    outside_m *= 2.0;
                }
                while outside_m - inside_m > 1e-3 * range_m {
                    let middle_m = f64::midpoint(inside_m, outside_m);
                    if self.delivery(middle_m) > DELIVERY_MIN {
                        inside_m = middle_m;
                    } else {
                        outside_m = middle_m;
                    }
                }
                outside_m
            }
        }
    }
}

fn ieee80211a_loss(distance_m: f64) -> f64 {
    distance_m * (5.335e-7 * distance_m + 3.395e-5)
}

/// A propagation model prepared for many draws.
#[derive(Debug)]
pub(super) struct Curve {
    propagation: Propagation,
    reach_m: f64,
    /// Delivery at equal steps up to the reach; empty for models that are cheap to compute.
    table: Vec<f64>,
}

impl Curve {
    pub(super) fn new(propagation: Propagation) -> Self {
        let reach_m = propagation.reach_m();
        let table = match propagation {
            Propagation::Range { .. } | Propagation::Ieee80211a { .. } => Vec::new(),
            Propagation::Nakagami { .. } => (0..=STEPS)
                .map(|step| propagation.delivery(reach_m * f64::from(step) / f64::from(STEPS)))
                .collect(),
        };
        Self {
            propagation,
            reach_m,
            table,
        }
    }

    /// Largest distance at which frames are delivered, in metres.
    pub(super) const fn reach_m(&self) -> f64 {
        self.reach_m
    }

    /// Whether every frame within the reach is delivered, so that nothing is drawn.
    pub(super) const fn is_certain(&self) -> bool {
        matches!(self.propagation, Propagation::Range { .. })
    }

    /// Draws whether a frame is delivered over a distance within the reach.
    pub(super) fn draw_delivery(&self, distance_m: f64, rng: &mut ChaCha8Rng) -> bool {
        rng.random::<f64>() < self.delivery(distance_m)
    }

    /// Delivery probability over a distance within the reach, 0 to 1.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a distance is not negative, and the cast saturates"
    )]
    pub(super) fn delivery(&self, distance_m: f64) -> f64 {
        let position = distance_m / self.reach_m * f64::from(STEPS);
        let step = position as usize;
        match self.table.get(step..step + 2) {
            Some(ends) => ends[0] + (ends[1] - ends[0]) * (position - position.floor()),
            None => self.propagation.delivery(distance_m),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const RAYLEIGH: Propagation = Propagation::Nakagami {
        range_m: 299.9,
        shape: 1.0,
    };

    #[test]
    fn fixed_range_delivers_all_or_nothing() {
        let range = Propagation::Range { range_m: 300.0 };
        assert!(range.delivery(0.0) >= 1.0 && range.delivery(300.0) >= 1.0);
        assert!(range.delivery(300.001) <= 0.0);
    }

    #[test]
    fn ieee80211a_curve_matches_its_formula() {
        let curve = Propagation::Ieee80211a { range_m: 2_000.0 };
        // By hand: 5.335e-7 · 300² + 3.395e-5 · 300 = 0.0582.
        assert!((curve.delivery(300.0) - 0.9418).abs() < 1e-9);
        assert!(curve.delivery(1_337.6) > 0.0);
        assert!(curve.delivery(1_337.7) <= 0.0);
        let cut = Propagation::Ieee80211a { range_m: 300.0 };
        assert!(cut.delivery(300.1) <= 0.0);
    }

    #[test]
    fn large_shape_approaches_a_fixed_range() {
        let steady = Propagation::Nakagami {
            range_m: 299.9,
            shape: 100.0,
        };
        assert!(steady.delivery(200.0) > 0.999);
        assert!(steady.delivery(450.0) < 0.001);
    }

    #[test]
    fn delivery_beyond_the_reach_is_negligible() {
        let reach_m = Curve::new(RAYLEIGH).reach_m();
        assert!((870.0..880.0).contains(&reach_m), "{reach_m}");
        assert!(RAYLEIGH.delivery(reach_m) <= DELIVERY_MIN);
    }

    proptest! {
        #[test]
        fn table_matches_the_curve(shape in 0.5..20.0_f64, share in 0.0..1.0_f64) {
            let propagation = Propagation::Nakagami { range_m: 300.0, shape };
            let curve = Curve::new(propagation);
            let distance_m = share * curve.reach_m();
            let error = curve.delivery(distance_m) - propagation.delivery(distance_m);
            prop_assert!(error.abs() < 1e-4, "{error} at {distance_m} m");
        }

        #[test]
        fn delivery_never_rises_with_distance(
            shape in 0.5..20.0_f64, range_m in 10.0..1_000.0_f64, near_m in 0.0..2_000.0_f64, more_m in 0.0..500.0_f64,
        ) {
            for propagation in [
                Propagation::Range { range_m },
                Propagation::Ieee80211a { range_m },
                Propagation::Nakagami { range_m, shape },
            ] {
                let (near, far) = (propagation.delivery(near_m), propagation.delivery(near_m + more_m));
                prop_assert!((0.0..=1.0).contains(&near));
                prop_assert!(far <= near + 1e-12);
            }
        }
    }
}
