//! Which parts of the space of poses have particles.

/// Counts distinct keys, in a table that is emptied without being written.
#[derive(Debug, Clone, Default)]
pub(super) struct Bins {
    slots: Vec<(u32, u64)>,
    round: u32,
    count: usize,
}

impl Bins {
    /// Empties the table, for up to `most` keys.
    pub(super) fn clear(&mut self, most: usize) {
        let size = (2 * most).next_power_of_two();
        if self.slots.len() < size || self.round == u32::MAX {
            self.slots = vec![(0, 0); size];
            self.round = 0;
        }
        self.round += 1;
        self.count = 0;
    }

    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// The key's slot. More keys than were announced have no end.
    pub(super) fn insert(&mut self, key: u64) -> usize {
        let mask = self.slots.len() - 1;
        // Fibonacci hashing, D. Knuth, The Art of Computer Programming, volume 3, section 6.4.
        let mut at = (key.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32) as usize & mask;
        loop {
            let (round, taken) = self.slots[at];
            if round != self.round {
                self.slots[at] = (self.round, key);
                self.count += 1;
                return at;
            }
            if taken == key {
                return at;
            }
            at = (at + 1) & mask;
        }
    }

    pub(super) fn size(&self) -> usize {
        self.slots.len()
    }
}

/// Particles needed so that, with the quantile `z`, the distribution over `bins` bins is within `error` of the true one.
///
/// Source: D. Fox, "KLD-sampling: adaptive particle filters", 2001, equation 7.
pub(super) fn kld_size(bins: usize, error: f64, z: f64) -> usize {
    if bins < 2 {
        return 1;
    }
    let freedom = (bins - 1) as f64;
    let part = 2.0 / (9.0 * freedom);
    let root = 1.0 - part + libm::sqrt(part) * z;
    libm::ceil(freedom / (2.0 * error) * root * root * root) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn particles_follow_the_quantiles_of_the_chi_squared_distribution() {
        // The 0.99 quantiles of 1, 9 and 99 degrees of freedom, over twice the error.
        for (bins, quantile) in [(2, 6.635), (10, 21.666), (100, 134.642)] {
            let exact = quantile / (2.0 * 0.05);
            let wanted = kld_size(bins, 0.05, 2.326) as f64;
            assert!((wanted - exact).abs() <= 1.0, "{bins}: {wanted}, {exact}");
        }
        assert_eq!(kld_size(1, 0.05, 2.326), 1);
    }
}
