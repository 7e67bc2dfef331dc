//! Shards of a list of runs.

use std::fmt;
use std::str::FromStr;

/// A shard of a list of runs: every n-th run.
///
/// So each shard has an equal share of each combination, slow or fast.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Shard {
    /// Counted from 1.
    index: u64,
    of: u64,
}

impl Shard {
    /// The only shard of an undivided list.
    pub const WHOLE: Self = Self { index: 1, of: 1 };

    /// Maximum number of shards. A merge opens one file per shard.
    pub const MAX: u64 = 1_000;

    /// Index, from 1.
    #[must_use]
    pub const fn index(self) -> u64 {
        self.index
    }

    /// Number of shards.
    #[must_use]
    pub const fn of(self) -> u64 {
        self.of
    }

    /// All shards of the same division, in order.
    pub fn all(self) -> impl Iterator<Item = Self> {
        let of = self.of;
        (1..=of).map(move |index| Self { index, of })
    }

    /// Its runs of a list of `runs`, in ascending order.
    pub fn runs(self, runs: u64) -> impl Iterator<Item = u64> {
        let step = usize::try_from(self.of).expect("at most Shard::MAX");
        (self.index - 1..runs).step_by(step)
    }

    /// Number of its runs in a list of `runs`.
    #[must_use]
    pub const fn number(self, runs: u64) -> u64 {
        (runs + self.of - self.index) / self.of
    }

    /// Index of a run among its own runs; `None` if the run belongs to another shard.
    #[must_use]
    pub const fn place(self, run: u64) -> Option<u64> {
        if run % self.of == self.index - 1 {
            Some(run / self.of)
        } else {
            None
        }
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.of)
    }
}

impl FromStr for Shard {
    type Err = String;

    /// Parses `i/n`, with i from 1.
    fn from_str(text: &str) -> Result<Self, String> {
        let number = |text: &str| text.parse::<u64>().ok();
        let parsed = text
            .split_once('/')
            .and_then(|(index, of)| Some((number(index)?, number(of)?)));
        match parsed {
            Some((index, of)) if (1..=of).contains(&index) && of <= Self::MAX => {
                Ok(Self { index, of })
            }
            _ => Err(format!(
                "`{text}` is not a shard; accepted: i/n with i from 1 to n and n from 1 to {}, as in 2/3",
                Self::MAX
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn shard_index_is_from_1_to_the_number_of_shards() {
        assert_eq!("2/3".parse(), Ok(Shard { index: 2, of: 3 }));
        for text in [
            "", "1", "0/3", "4/3", "0/0", "1/0", "-1/3", "1/2/3", "a/b", "1/1001",
        ] {
            assert!(text.parse::<Shard>().is_err(), "{text}");
        }
    }

    proptest! {
        #[test]
        fn shards_are_disjoint_and_cover_the_list(runs in 0_u64..500, of in 1_u64..40) {
            let shards: Vec<_> = Shard { index: 1, of }.all().collect();
            let mut all: Vec<u64> = shards.iter().flat_map(|shard| shard.runs(runs)).collect();
            all.sort_unstable();
            prop_assert_eq!(all, (0..runs).collect::<Vec<_>>());
        }

        #[test]
        fn shard_knows_its_runs_and_their_indices(runs in 0_u64..500, of in 1_u64..40) {
            for shard in (Shard { index: 1, of }).all() {
                let own: Vec<_> = shard.runs(runs).collect();
                prop_assert_eq!(own.len() as u64, shard.number(runs));
                for run in 0..runs {
                    let place = own.iter().position(|own| *own == run).map(|place| place as u64);
                    prop_assert_eq!(shard.place(run), place);
                }
            }
        }

        #[test]
        fn shard_sizes_differ_by_at_most_one(runs in 0_u64..500, of in 1_u64..40) {
            let sizes: Vec<_> = Shard { index: 1, of }.all().map(|shard| shard.number(runs)).collect();
            prop_assert!(sizes.iter().max().unwrap() - sizes.iter().min().unwrap() <= 1);
        }
    }
}
