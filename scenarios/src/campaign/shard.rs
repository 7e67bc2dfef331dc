use std::fmt;
use std::str::FromStr;

/// One of the disjoint parts that a list of runs is spread over: every n-th run.
///
/// Taking every n-th rather than a stretch gives each part its share of every combination, slow ones and fast ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Shard {
    /// From 1.
    index: u64,
    of: u64,
}

impl Shard {
    /// The only part of an undivided list.
    pub const WHOLE: Self = Self { index: 1, of: 1 };

    /// The most parts; to be merged, a file of each is open.
    pub const MAX: u64 = 1_000;

    /// Which part it is, from 1.
    #[must_use]
    pub const fn index(self) -> u64 {
        self.index
    }

    /// How many parts there are.
    #[must_use]
    pub const fn of(self) -> u64 {
        self.of
    }

    /// All parts that this is one of, in order.
    pub fn all(self) -> impl Iterator<Item = Self> {
        let of = self.of;
        (1..=of).map(move |index| Self { index, of })
    }

    /// Its runs of a list of `runs`, rising.
    pub fn runs(self, runs: u64) -> impl Iterator<Item = u64> {
        let apart = usize::try_from(self.of).expect("at most Shard::MAX");
        (self.index - 1..runs).step_by(apart)
    }

    /// How many of a list of `runs` are its own.
    #[must_use]
    pub const fn number(self, runs: u64) -> u64 {
        (runs + self.of - self.index) / self.of
    }

    /// At which place among its own runs a run stands; nothing if it is another part's.
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

    /// From `i/n`, counted from 1.
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
                "`{text}` is no part; use i/n with i from 1 to n and n at most {}, as in 2/3",
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
    fn a_part_is_counted_from_one_and_is_one_of_the_parts() {
        assert_eq!("2/3".parse(), Ok(Shard { index: 2, of: 3 }));
        for text in [
            "", "1", "0/3", "4/3", "0/0", "1/0", "-1/3", "1/2/3", "a/b", "1/1001",
        ] {
            assert!(text.parse::<Shard>().is_err(), "{text}");
        }
    }

    proptest! {
        #[test]
        fn parts_are_disjoint_and_cover_the_list(runs in 0_u64..500, of in 1_u64..40) {
            let parts: Vec<_> = Shard { index: 1, of }.all().collect();
            let mut all: Vec<u64> = parts.iter().flat_map(|part| part.runs(runs)).collect();
            all.sort_unstable();
            prop_assert_eq!(all, (0..runs).collect::<Vec<_>>());
        }

        #[test]
        fn a_part_knows_its_own_runs_and_their_places(runs in 0_u64..500, of in 1_u64..40) {
            for part in (Shard { index: 1, of }).all() {
                let own: Vec<_> = part.runs(runs).collect();
                prop_assert_eq!(own.len() as u64, part.number(runs));
                for run in 0..runs {
                    let place = own.iter().position(|own| *own == run).map(|place| place as u64);
                    prop_assert_eq!(part.place(run), place);
                }
            }
        }

        #[test]
        fn parts_differ_by_one_run_at_most(runs in 0_u64..500, of in 1_u64..40) {
            let sizes: Vec<_> = Shard { index: 1, of }.all().map(|part| part.number(runs)).collect();
            prop_assert!(sizes.iter().max().unwrap() - sizes.iter().min().unwrap() <= 1);
        }
    }
}
