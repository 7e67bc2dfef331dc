//! Ranges of seeds.

use std::fmt;
use std::str::FromStr;

/// A non-empty range of seeds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Seeds {
    first: u64,
    /// Exclusive end.
    end: u64,
}

/// Highest seed of a scenario: TOML integers are signed 64-bit.
const SEED_MAX: u64 = i64::MAX as u64;

impl Seeds {
    /// Number of seeds.
    #[must_use]
    pub const fn number(self) -> u64 {
        self.end - self.first
    }

    /// The seed at index `place`, from 0.
    #[must_use]
    pub const fn at(self, place: u64) -> u64 {
        self.first + place
    }
}

impl fmt::Display for Seeds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}..{}", self.first, self.end)
    }
}

impl FromStr for Seeds {
    type Err = String;

    /// Parses `A..B` (without B) or `A..=B` (with B).
    fn from_str(text: &str) -> Result<Self, String> {
        let parsed = text.split_once("..").and_then(|(first, last)| {
            let first = first.parse::<u64>().ok()?;
            Some(match last.strip_prefix('=') {
                Some(last) => (first, last.parse::<u64>().ok()?.checked_add(1)?),
                None => (first, last.parse::<u64>().ok()?),
            })
        });
        match parsed {
            None => Err(format!(
                "`{text}` is not a range of seeds; accepted: A..B (without B) or A..=B (with B), as in 0..100"
            )),
            Some((first, end)) if first >= end => Err(format!(
                "`{text}` is an empty range; A..B excludes B: use {first}..={first} for seed {first} alone"
            )),
            Some((_, end)) if end - 1 > SEED_MAX => {
                Err(format!("`{text}` exceeds the highest seed, {SEED_MAX}"))
            }
            Some((first, end)) => Ok(Self { first, end }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seeds(text: &str) -> Vec<u64> {
        let seeds: Seeds = text.parse().unwrap();
        (0..seeds.number()).map(|place| seeds.at(place)).collect()
    }

    #[test]
    fn range_excludes_its_end_unless_inclusive() {
        assert_eq!(seeds("3..6"), [3, 4, 5]);
        assert_eq!(seeds("3..=6"), [3, 4, 5, 6]);
        assert_eq!(seeds("0..=0"), [0]);
    }

    #[test]
    fn inclusive_and_exclusive_notation_are_equal() {
        let parse = |text: &str| text.parse::<Seeds>().unwrap();
        assert_eq!(parse("3..=6"), parse("3..7"));
        assert_eq!(parse("3..=6").to_string(), "3..7");
    }

    #[test]
    fn invalid_and_empty_ranges_are_refused() {
        for text in [
            "",
            "5",
            "5..",
            "..5",
            "a..b",
            "-1..4",
            "1...4",
            "1.5..3",
            "5..5",
            "5..=4",
            "9..3",
            "0..9223372036854775809",
            "0..=18446744073709551615",
        ] {
            assert!(text.parse::<Seeds>().is_err(), "{text}");
        }
        assert!(
            "9223372036854775807..=9223372036854775807"
                .parse::<Seeds>()
                .is_ok()
        );
    }
}
