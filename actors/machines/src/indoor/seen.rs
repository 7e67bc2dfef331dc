//! What was seen of a floor.

use serde::{Deserialize, Serialize};

/// A set of targets: squares of a map's floor, by number.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Seen {
    bits: Vec<u64>,
    len: usize,
}

impl Seen {
    /// None of `targets` targets.
    #[must_use]
    pub fn none(targets: usize) -> Self {
        Self {
            bits: vec![0; targets.div_ceil(64)],
            len: 0,
        }
    }

    /// Whether it is a set of some of `targets` targets. One from another map's checkpoint may not be.
    #[must_use]
    pub fn is_of(&self, targets: usize) -> bool {
        self.bits.len() == targets.div_ceil(64)
    }

    /// Number of targets in it.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.len
    }

    /// Whether no target is in it.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Whether a target is in it.
    #[must_use]
    pub fn contains(&self, target: usize) -> bool {
        self.bits[target / 64] >> (target % 64) & 1 == 1
    }

    /// Adds a target.
    pub fn insert(&mut self, target: usize) {
        let bit = 1 << (target % 64);
        let word = &mut self.bits[target / 64];
        self.len += usize::from(*word & bit == 0);
        *word |= bit;
    }

    /// The set, 64 targets a word, the first of them the lowest bit.
    #[must_use]
    pub fn words(&self) -> &[u64] {
        &self.bits
    }

    /// Adds the targets of a word, at its place among [`Self::words`].
    pub fn add_word(&mut self, place: usize, word: u64) {
        let have = &mut self.bits[place];
        self.len += (word & !*have).count_ones() as usize;
        *have |= word;
    }

    /// Empties the set.
    pub fn clear(&mut self) {
        self.bits.fill(0);
        self.len = 0;
    }

    /// Adds all of another set of the same targets.
    pub fn add(&mut self, other: &Self) {
        for (word, more) in self.bits.iter_mut().zip(&other.bits) {
            *word |= more;
        }
        self.len = self
            .bits
            .iter()
            .map(|word| word.count_ones() as usize)
            .sum();
    }

    /// How many of another set of the same targets are not in this one.
    #[must_use]
    pub fn missing(&self, other: &Self) -> usize {
        let pairs = self.bits.iter().zip(&other.bits);
        pairs
            .map(|(have, want)| (want & !have).count_ones() as usize)
            .sum()
    }

    /// The targets of another set that are not in this one, in order.
    pub fn missing_of<'a>(&'a self, other: &'a Self) -> impl Iterator<Item = usize> + 'a {
        let all = 0..other.bits.len() * 64;
        all.filter(|target| other.contains(*target) && !self.contains(*target))
    }
}
