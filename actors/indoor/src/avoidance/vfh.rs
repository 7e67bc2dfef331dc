//! The Vector Field Histogram as the indoor thesis gives it.

use super::grid::{CELL_M, REACH, SIDE, offset_m};
use super::sectors::{SECTORS, SectorSet, apart, bearing_of, sector_of};
use super::{Avoider, Limits, Situation, Steering};
use crate::frames::wrapped_rad;

/// Sectors on each side that the smoothing spreads over (indoor thesis).
const SMOOTHING: i32 = 5;
/// Sectors from which a valley is wide (indoor thesis).
pub(super) const WIDE: usize = 18;
/// a of m = c²(a − b·d). With [`FALL`] the magnitude is c² at the drone and 0 at the window's corners.
const RISE: f64 = 1.0;
/// Sum of the weights of the smoothing: (l+1)²/(2l+1), 3.27.
const GAIN: f64 = ((SMOOTHING + 1) * (SMOOTHING + 1)) as f64 / (2 * SMOOTHING + 1) as f64;
/// Obstacle density of a sector, before smoothing, from which it is blocked: two cells that were hit twice, half-way to the
/// window's edge.
const THRESHOLD: f64 = 50.0;
/// Density, before smoothing, at which the drone flies slowest: a wall of certain cells across a sector.
const DENSE: f64 = 600.0;
/// Lowest speed while there is a way, as a share of the highest.
const SPEED_MIN: f64 = 0.1;

/// The Vector Field Histogram.
///
/// As in the indoor thesis and Borenstein and Koren (1991), but for one thing: the goal is taken if it lies in a wide
/// valley at least half of the wide valley's width from its borders.
#[derive(Debug, Clone)]
pub struct Vfh {
    limits: Limits,
    /// Sector, and a − b·d, for each cell.
    table: Vec<(u8, f64)>,
}

impl Vfh {
    /// For a drone with these limits. The radius is not used: VFH takes the drone for a point.
    #[must_use]
    pub fn new(limits: Limits) -> Self {
        let distance_max_m = std::f64::consts::SQRT_2 * REACH as f64 * CELL_M;
        let fall = RISE / distance_max_m;
        let entry = |index| {
            let (x_m, y_m) = offset_m(index);
            let distance_m = libm::hypot(x_m, y_m);
            let sector = sector_of(libm::atan2(y_m, x_m));
            (sector as u8, (RISE - fall * distance_m).max(0.0))
        };
        Self {
            limits,
            table: (0..SIDE * SIDE).map(entry).collect(),
        }
    }

    /// The polar obstacle densities, smoothed.
    fn densities(&self, situation: &Situation<'_>) -> [f64; SECTORS] {
        let mut densities = [0.0; SECTORS];
        for (index, certainty) in situation.grid.occupied() {
            let (sector, weight) = self.table[index];
            let certainty = f64::from(certainty);
            densities[usize::from(sector)] += certainty * certainty * weight;
        }
        smoothed(&densities)
    }
}

/// h'ₖ = Σ hₖ₊ₙ (l + 1 − |n|) / (2l + 1) for n from −l to l.
fn smoothed(densities: &[f64; SECTORS]) -> [f64; SECTORS] {
    std::array::from_fn(|sector| {
        let weighted = (-SMOOTHING..=SMOOTHING).map(|n| {
            let other = (sector as i32 + n).rem_euclid(SECTORS as i32) as usize;
            densities[other] * f64::from(SMOOTHING + 1 - n.abs())
        });
        weighted.sum::<f64>() / f64::from(2 * SMOOTHING + 1)
    })
}

/// The middle of a narrow valley; in a wide one the goal, at least half of [`WIDE`] from the borders.
fn aim((first, length): (usize, usize), goal: usize) -> f64 {
    let first = first as f64;
    if length == SECTORS {
        return goal as f64;
    }
    if length <= WIDE {
        return first + (length - 1) as f64 / 2.0;
    }
    let margin = WIDE as f64 / 2.0;
    let into = (goal as f64 - first).rem_euclid(SECTORS as f64);
    let last = (length - 1) as f64;
    let into = if into <= last {
        into.clamp(margin, last - margin)
    } else if into - last < SECTORS as f64 - into {
        last - margin
    } else {
        margin
    };
    first + into
}

/// The sectors that smoothed densities block.
fn blocked(densities: &[f64; SECTORS]) -> SectorSet {
    let dense = |sector: &usize| densities[*sector] >= THRESHOLD * GAIN;
    (0..SECTORS).filter(dense).collect()
}

impl Avoider for Vfh {
    fn steer(&mut self, situation: &Situation<'_>) -> Option<Steering> {
        let densities = self.densities(situation);
        let blocked = blocked(&densities).union(situation.blind);
        let goal = sector_of(situation.goal_rad);
        let nearest = blocked.openings().into_iter().min_by(|a, b| {
            let away = |(first, length): (usize, usize)| {
                let sectors = (first..first + length).map(|it| apart(it as f64, goal as f64));
                sectors.fold(f64::INFINITY, f64::min)
            };
            away(*a).total_cmp(&away(*b))
        })?;
        let course_rad = if nearest.1 == SECTORS {
            situation.goal_rad
        } else {
            bearing_of(aim(nearest, goal))
        };
        let ahead = densities[sector_of(situation.course_rad)] / (DENSE * GAIN);
        let speed = (1.0 - ahead.min(1.0))
            * (1.0 - (situation.turn_rate_rps.abs() / self.limits.turn_rate_max_rps).min(1.0));
        let speed = speed.max(SPEED_MIN) * self.limits.speed_max_mps;
        Some(Steering {
            course_rad: wrapped_rad(course_rad),
            speed_mps: speed.min(situation.goal_m),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_threshold_knows_the_gain_of_the_smoothing() {
        let level = |density: f64| blocked(&smoothed(&[density; SECTORS]));
        assert_eq!(level(0.99 * THRESHOLD), SectorSet::NONE);
        assert_eq!(level(1.01 * THRESHOLD), SectorSet::ALL);
        assert!((GAIN - 36.0 / 11.0).abs() < 1e-12);
    }

    #[test]
    fn wide_valleys_are_entered_half_their_width_from_the_border() {
        assert!((aim((10, 10), 0) - 14.5).abs() < 1e-9);
        assert!((aim((10, 40), 5) - 19.0).abs() < 1e-9);
        assert!((aim((10, 40), 30) - 30.0).abs() < 1e-9);
        assert!((aim((10, 40), 60) - 40.0).abs() < 1e-9);
        assert!((aim((60, 40), 3) - 75.0).abs() < 1e-9);
    }
}
