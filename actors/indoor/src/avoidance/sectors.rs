//! The sectors of a polar histogram.

use std::f64::consts::TAU;

/// Sectors of a polar histogram: 5° each (indoor thesis, Polar Histogram).
pub const SECTORS: usize = 72;
/// Width of a sector, in radians.
pub const SECTOR_RAD: f64 = TAU / SECTORS as f64;

/// The sector of a bearing in radians: k = ⌊β/α⌋, both in radians (indoor thesis).
#[must_use]
pub fn sector_of(bearing_rad: f64) -> usize {
    let positive = bearing_rad.rem_euclid(TAU);
    ((positive / SECTOR_RAD).floor() as usize).min(SECTORS - 1)
}

/// The bearing of the middle of a sector, in radians. Fractions of sectors are accepted.
#[must_use]
pub(super) fn bearing_of(sector: f64) -> f64 {
    crate::frames::wrapped_rad((sector + 0.5) * SECTOR_RAD)
}

/// Number of sectors between two, the shorter way round; fractions count.
#[must_use]
pub(super) fn apart(a: f64, b: f64) -> f64 {
    let all = SECTORS as f64;
    let apart = (a - b).rem_euclid(all);
    apart.min(all - apart)
}

/// A set of sectors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SectorSet(u128);

impl SectorSet {
    /// No sector.
    pub const NONE: Self = Self(0);
    /// All sectors.
    pub const ALL: Self = Self((1 << SECTORS) - 1);

    /// Adds a sector.
    pub const fn insert(&mut self, sector: usize) {
        self.0 |= 1 << (sector % SECTORS);
    }

    /// Whether it has a sector.
    #[must_use]
    pub const fn contains(self, sector: usize) -> bool {
        self.0 >> (sector % SECTORS) & 1 == 1
    }

    /// Number of its sectors.
    #[must_use]
    pub const fn len(self) -> usize {
        self.0.count_ones() as usize
    }

    /// Whether it has no sector.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The sectors of either.
    #[must_use]
    pub const fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Runs of consecutive sectors that are not in the set: the first sector and the length, round the circle.
    pub(super) fn openings(self) -> Vec<(usize, usize)> {
        let Some(first_blocked) = (0..SECTORS).find(|sector| self.contains(*sector)) else {
            return vec![(0, SECTORS)];
        };
        let mut openings: Vec<(usize, usize)> = Vec::new();
        for sector in first_blocked + 1..first_blocked + SECTORS {
            if self.contains(sector) {
                continue;
            }
            match openings.last_mut() {
                Some((first, length)) if *first + *length == sector => *length += 1,
                _ => openings.push((sector, 1)),
            }
        }
        openings
    }
}

impl FromIterator<usize> for SectorSet {
    fn from_iter<I: IntoIterator<Item = usize>>(sectors: I) -> Self {
        let mut set = Self::NONE;
        sectors.into_iter().for_each(|sector| set.insert(sector));
        set
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A defect of the indoor thesis's code: radians divided by degrees put every bearing into one of two sectors.
    #[test]
    fn radians_divided_by_degrees_are_not_sectors() {
        for degrees in 0..360 {
            let bearing = f64::from(degrees).to_radians() + 1e-9;
            assert_eq!(sector_of(bearing), degrees as usize / 5, "{degrees}°");
            assert_eq!(sector_of(bearing - TAU), degrees as usize / 5, "{degrees}°");
        }
    }

    #[test]
    fn openings_run_round_the_circle() {
        let blocked: SectorSet = (3..70).collect();
        assert_eq!(blocked.openings(), [(70, 5)]);
        assert_eq!(SectorSet::NONE.openings(), [(0, SECTORS)]);
        assert_eq!(SectorSet::ALL.openings(), []);
        let two: SectorSet = [0, 10].into_iter().collect();
        assert_eq!(two.openings(), [(1, 9), (11, 61)]);
    }
}
