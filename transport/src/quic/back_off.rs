use std::time::Duration;

use rand::{Rng, RngExt};

/// Limits of the first and of the longest wait.
const FIRST: Duration = Duration::from_millis(100);
const LONGEST: Duration = Duration::from_secs(2);

/// Exponential back-off between attempts to connect. A random part of each wait avoids simultaneous reconnects.
#[derive(Debug, Clone, Copy)]
pub(super) struct BackOff {
    next: Duration,
}

impl BackOff {
    pub(super) const fn new() -> Self {
        Self { next: FIRST }
    }

    /// The next wait: between half of the current limit and all of it. Doubles the limit.
    pub(super) fn wait(&mut self, rng: &mut impl Rng) -> Duration {
        let longest = self.next;
        self.next = (longest * 2).min(LONGEST);
        longest.mul_f64(rng.random_range(0.5..=1.0))
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn waits_double_up_to_the_longest_and_differ_by_seed() {
        let waits = |seed| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let mut back_off = BackOff::new();
            (0..8).map(|_| back_off.wait(&mut rng)).collect::<Vec<_>>()
        };
        let (one, other) = (waits(1), waits(2));
        let mut longest = FIRST;
        for (one, other) in one.into_iter().zip(other) {
            assert_ne!(one, other);
            assert!(one >= longest / 2 && one <= longest, "{one:?}");
            longest = (longest * 2).min(LONGEST);
        }
        assert_eq!(longest, LONGEST);
    }
}
