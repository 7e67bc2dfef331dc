//! Random numbers, fast and equal on all processors.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::Rng;

/// Bits that choose one of the table's quantiles.
const BITS: u32 = 12;

/// Normal numbers from a table.
///
/// The sum of two of 4,096 quantiles: 16 million values, up to 5 standard deviations. A tenth of the cost of a logarithm and
/// a sine.
#[derive(Debug, Clone)]
pub(super) struct Noise {
    quantiles: Vec<f32>,
    rng: ChaCha8Rng,
}

impl Noise {
    pub(super) fn new(rng: ChaCha8Rng) -> Self {
        let count = 1_u32 << BITS;
        let mut quantiles: Vec<f64> = (0..count)
            .map(|index| quantile((f64::from(index) + 0.5) / f64::from(count)))
            .collect();
        let squares: f64 = quantiles.iter().map(|it| it * it).sum();
        // Two of them together have variance 1.
        let scale = libm::sqrt(f64::from(count) / (2.0 * squares));
        quantiles.iter_mut().for_each(|it| *it *= scale);
        Self {
            quantiles: quantiles.into_iter().map(|it| it as f32).collect(),
            rng,
        }
    }

    /// A number with mean 0 and variance 1.
    #[inline]
    pub(super) fn normal(&mut self) -> f32 {
        let mask = (1 << BITS) - 1;
        let bits = self.rng.next_u32();
        self.quantiles[(bits & mask) as usize] + self.quantiles[(bits >> (32 - BITS)) as usize]
    }

    /// A number in [0, 1).
    #[inline]
    pub(super) fn uniform(&mut self) -> f32 {
        (self.rng.next_u32() >> 8) as f32 / (1 << 24) as f32
    }

    /// A whole number below `limit`.
    pub(super) fn below(&mut self, limit: usize) -> usize {
        ((u64::from(self.rng.next_u32()) * limit as u64) >> 32) as usize
    }
}

/// The value below which a share `p` of a standard normal distribution lies, by bisection; for tables only.
fn quantile(p: f64) -> f64 {
    let (mut low, mut high) = (-8.0, 8.0);
    for _ in 0..60 {
        let middle = (low + high) / 2.0;
        let below = 0.5 * libm::erfc(-middle / std::f64::consts::SQRT_2);
        if below < p {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

#[cfg(test)]
mod tests {
    use rand_chacha::rand_core::SeedableRng;

    use super::*;

    #[test]
    fn normal_numbers_have_the_moments_of_a_normal_distribution() {
        let mut noise = Noise::new(ChaCha8Rng::seed_from_u64(3));
        let count = 400_000;
        let drawn: Vec<f64> = (0..count).map(|_| f64::from(noise.normal())).collect();
        let moment =
            |power: i32| drawn.iter().map(|it| it.powi(power)).sum::<f64>() / f64::from(count);
        assert!(moment(1).abs() < 0.01);
        assert!((moment(2) - 1.0).abs() < 0.01);
        assert!(moment(3).abs() < 0.03);
        assert!((moment(4) - 3.0).abs() < 0.06);
        let beyond_two = drawn.iter().filter(|it| it.abs() > 2.0).count() as f64;
        assert!((beyond_two / f64::from(count) - 0.0455).abs() < 0.002);
    }
}
