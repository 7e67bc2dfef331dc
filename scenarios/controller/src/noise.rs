//! Random numbers that are a function of seed, stream and index, so that no draw depends on which draws came before it.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Normal numbers by index. Access in order costs least.
#[derive(Debug, Clone)]
pub(crate) struct Noise<const N: usize> {
    rng: ChaCha8Rng,
    /// Index that the generator yields next.
    next: u64,
}

impl<const N: usize> Noise<N> {
    /// Words of 32 bits that a draw of `N` numbers takes.
    const WORDS: u128 = 2 * N as u128;

    pub(crate) fn new(seed: u64, stream: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(stream);
        Self { rng, next: 0 }
    }

    /// `N` independent numbers with mean 0 and standard deviation 1.
    ///
    /// Each is the sum of four uniform numbers (Irwin–Hall): within ±3.46, and without a logarithm.
    #[inline]
    pub(crate) fn at(&mut self, index: u64) -> [f64; N] {
        if index != self.next {
            self.rng.set_word_pos(u128::from(index) * Self::WORDS);
        }
        self.next = index + 1;
        std::array::from_fn(|_| standardised(self.rng.next_u64()))
    }
}

#[inline]
fn standardised(bits: u64) -> f64 {
    // Four uniform numbers of 16 bits have a standard deviation of 65,536 / √3 together.
    const SCALE: f64 = 1.732_050_807_568_877_2 / 65_536.0;
    const MEAN: f64 = 2.0 * 65_535.0;
    let sum = (bits & 0xffff) + (bits >> 16 & 0xffff) + (bits >> 32 & 0xffff) + (bits >> 48);
    #[expect(clippy::cast_precision_loss, reason = "below 2^18")]
    let sum = sum as f64;
    (sum - MEAN) * SCALE
}

/// `N` errors that drift: standard deviation 1 at any time, uncorrelated after two knots.
#[derive(Debug, Clone)]
pub(crate) struct Drift<const N: usize> {
    noise: Noise<N>,
    /// Steps between independent values.
    knot_steps: u64,
    /// The last knot that was used, with its values and the next knot's.
    segment: (u64, [f64; N], [f64; N]),
}

impl<const N: usize> Drift<N> {
    pub(crate) fn new(seed: u64, stream: u64, knot_steps: u64) -> Self {
        let mut noise = Noise::new(seed, stream);
        let segment = (0, noise.at(0), noise.at(1));
        Self {
            noise,
            knot_steps,
            segment,
        }
    }

    /// The errors at a step.
    pub(crate) fn at(&mut self, step: u64) -> [f64; N] {
        let knot = step / self.knot_steps;
        if self.segment.0 != knot {
            self.segment = (knot, self.noise.at(knot), self.noise.at(knot + 1));
        }
        #[expect(clippy::cast_precision_loss, reason = "both are below 2^53")]
        let share = (step % self.knot_steps) as f64 / self.knot_steps as f64;
        let (_, from, to) = &self.segment;
        let norm = libm::sqrt((1.0 - share) * (1.0 - share) + share * share);
        std::array::from_fn(|axis| (from[axis] * (1.0 - share) + to[axis] * share) / norm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moments(values: &[f64]) -> (f64, f64) {
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let variance = values.iter().map(|it| (it - mean).powi(2)).sum::<f64>() / count;
        (mean, variance.sqrt())
    }

    #[test]
    fn numbers_have_mean_zero_and_deviation_one() {
        let mut noise = Noise::<2>::new(1, 0);
        let values: Vec<_> = (0..50_000).flat_map(|index| noise.at(index)).collect();
        let (mean, deviation) = moments(&values);
        assert!(mean.abs() < 0.01, "{mean}");
        assert!((deviation - 1.0).abs() < 0.01, "{deviation}");
    }

    #[test]
    fn order_of_access_changes_no_number() {
        let mut forward = Noise::<3>::new(7, 2);
        let mut backward = Noise::<3>::new(7, 2);
        let there: Vec<_> = (0..100).map(|index| forward.at(index)).collect();
        let mut back: Vec<_> = (0..100).rev().map(|index| backward.at(index)).collect();
        back.reverse();
        assert_eq!(there, back);
        for (seed, stream) in [(7, 3), (8, 2)] {
            let [other, ..] = Noise::<3>::new(seed, stream).at(0);
            assert!((there[0][0] - other).abs() > 1e-9);
        }
    }

    #[test]
    fn drift_is_continuous_with_deviation_one() {
        let mut drift = Drift::<1>::new(3, 0, 100);
        let values: Vec<_> = (0..500_000).map(|step| drift.at(step)[0]).collect();
        let (mean, deviation) = moments(&values);
        assert!(mean.abs() < 0.1, "{mean}");
        assert!((deviation - 1.0).abs() < 0.05, "{deviation}");
        let jump = values.windows(2).map(|pair| (pair[1] - pair[0]).abs());
        assert!(jump.fold(0.0, f64::max) < 0.1);
    }
}
