//! VFH+: Ulrich and Borenstein, "VFH+: reliable obstacle avoidance for fast mobile robots", 1998.

use std::f64::consts::{FRAC_PI_2, PI};

use super::grid::{CELL_M, REACH, SIDE, offset_m};
use super::sectors::{SECTOR_RAD, SECTORS, SectorSet, apart, bearing_of, sector_of};
use super::vfh::WIDE;
use super::{Avoider, Limits, Situation, Steering};
use crate::frames::wrapped_rad;

/// Weights of the cost of a direction: away from the goal, from the present course, from the direction chosen before
/// (section 5 of the paper).
const COST: [f64; 3] = [5.0, 2.0, 2.0];
/// a of m = c²(a − b·d²). b follows, for a − b·d² is 1 at the middle of the window's edge (section 1).
const NEAR: f64 = 17.0;
/// Parts that magnitudes are counted in, so that sums are exact.
const PARTS: f64 = 16.0;
/// Density from which a free sector is blocked, in parts: an obstacle 0.6 m away that gave two echoes blocks, one echo doesn't.
const BLOCKED: i32 = 2_500;
/// Density below which a blocked sector is free again, in parts.
const FREE: i32 = 1_200;
/// Certainty from which a cell counts for the speed and the turns: two echoes.
const OBSTACLE: u8 = 6;
/// Distance from an obstacle's enlarged edge from which the speed isn't lowered, in metres.
const SLOWED_M: f64 = 0.8;
/// Lowest speed while there is a way, as a share of the highest.
const SPEED_MIN: f64 = 0.25;
/// Share of a sector that a border may be off by rounding.
const ROUNDING: f64 = 1e-9;

/// What one cell of the window adds to the histogram.
#[derive(Debug, Clone, Copy)]
struct Cover {
    /// a − b·d², in parts.
    weight: u16,
    /// Squared distance from the drone, in cells.
    squared: u16,
    /// First sector that the enlarged cell covers.
    first: u8,
    /// The sector after the last; may be beyond a full turn.
    end: u8,
}

/// Where one cell of the window is, from the drone.
#[derive(Debug, Clone, Copy)]
struct Cell {
    /// The sector of its bearing.
    sector: u8,
    /// In metres.
    distance_m: f32,
    /// Cosine and sine of its bearing.
    towards: (f32, f32),
}

/// VFH+. A call takes at most 30 µs, however the grid is filled.
#[derive(Debug, Clone)]
pub struct VfhPlus {
    limits: Limits,
    covers: Vec<Cover>,
    cells: Vec<Cell>,
    /// The binary histogram of the call before.
    blocked: SectorSet,
    /// The direction chosen before, as a sector.
    chosen: Option<f64>,
}

impl VfhPlus {
    /// For a drone with these limits.
    #[must_use]
    pub fn new(limits: Limits) -> Self {
        Self {
            limits,
            covers: (0..SIDE * SIDE)
                .map(|index| cover(index, limits.radius_m))
                .collect(),
            cells: (0..SIDE * SIDE).map(cell).collect(),
            blocked: SectorSet::NONE,
            chosen: None,
        }
    }

    /// The sectors that obstacles block, with hysteresis.
    fn update_binary(&mut self, situation: &Situation<'_>) {
        // Each cell adds its magnitude where its sectors begin and takes it away where they end.
        let mut changes = [0_i32; 2 * SECTORS + 1];
        // What lies behind the goal blocks no way to it: the goal itself is clear of walls by the radius.
        let reach_m = situation.goal_m + self.limits.radius_m;
        let reach_cells = reach_m / CELL_M;
        let beyond = (reach_cells * reach_cells).ceil() as u16;
        situation.grid.visit_near(reach_m, |index, certainty| {
            let cover = self.covers[index];
            let certainty = i32::from(certainty) * i32::from(cover.squared < beyond);
            let magnitude = certainty * certainty * i32::from(cover.weight);
            changes[usize::from(cover.first)] += magnitude;
            changes[usize::from(cover.end)] -= magnitude;
        });
        let mut density = 0;
        let mut densities = [0_i32; SECTORS];
        for (sector, change) in changes.iter().enumerate() {
            density += change;
            densities[sector % SECTORS] += density;
        }
        let was = self.blocked;
        self.blocked = (0..SECTORS)
            .filter(|sector| {
                let limit = if was.contains(*sector) { FREE } else { BLOCKED };
                densities[*sector] >= limit
            })
            .collect();
    }

    /// The sectors that the drone can't turn to at its speed without touching an enlarged obstacle (section 3). None at rest: it
    /// can start into any direction, also before a wall that it looks at.
    fn unreachable(&self, situation: &Situation<'_>) -> SectorSet {
        if situation.speed_mps <= 0.0 {
            return SectorSet::NONE;
        }
        let turn_m = situation.speed_mps / self.limits.turn_rate_max_rps;
        let clear_m = turn_m + self.limits.radius_m;
        let (sin, cos) = (
            libm::sin(situation.course_rad),
            libm::cos(situation.course_rad),
        );
        let reach_m = turn_m + clear_m;
        // Of each side: the cosine of how far the drone may turn.
        let mut turns = [-1.0_f64; 2];
        situation.grid.visit_near(reach_m, |index, certainty| {
            let cell = &self.cells[index];
            let (x, y) = (f64::from(cell.towards.0), f64::from(cell.towards.1));
            let (ahead, left) = (cos * x + sin * y, cos * y - sin * x);
            let distance_m = f64::from(cell.distance_m);
            let (ahead_m, lateral_m) = (ahead * distance_m, left.abs() * distance_m - turn_m);
            if certainty >= OBSTACLE
                && ahead_m * ahead_m + lateral_m * lateral_m < clear_m * clear_m
            {
                let turn = &mut turns[usize::from(left < 0.0)];
                *turn = turn.max(ahead);
            }
        });
        let [left, right] = turns.map(|cosine| libm::acos(cosine.min(1.0)));
        let is_out = |sector: &usize| {
            let off_course_rad = wrapped_rad(bearing_of(*sector as f64) - situation.course_rad);
            // The course itself is no turn.
            off_course_rad.abs() > SECTOR_RAD && (off_course_rad > left || -off_course_rad > right)
        };
        (0..SECTORS).filter(is_out).collect()
    }

    /// The cheapest direction among the candidates of all openings, as a sector.
    fn choose(&self, blocked: SectorSet, goal: f64, course: f64) -> Option<f64> {
        let cost = |it: f64| {
            let before = self.chosen.map_or(0.0, |chosen| apart(it, chosen));
            COST[0] * apart(it, goal) + COST[1] * apart(it, course) + COST[2] * before
        };
        let openings = blocked.openings();
        let candidates = openings
            .iter()
            .flat_map(|opening| candidates(*opening, goal));
        candidates.min_by(|a, b| cost(*a).total_cmp(&cost(*b)))
    }

    /// Distance of the nearest obstacle ahead, within half a wide valley, beyond the drone's radius, in metres; at most
    /// [`SLOWED_M`].
    fn room_ahead_m(&self, situation: &Situation<'_>, course_rad: f64) -> f64 {
        let course = sector_of(course_rad);
        let half = WIDE / 2;
        let ahead: SectorSet = (course + SECTORS - half..=course + SECTORS + half).collect();
        let mut nearest_m = (SLOWED_M + self.limits.radius_m) as f32;
        let reach_m = f64::from(nearest_m);
        situation.grid.visit_near(reach_m, |index, certainty| {
            let cell = &self.cells[index];
            if cell.distance_m < nearest_m
                && certainty >= OBSTACLE
                && ahead.contains(usize::from(cell.sector))
            {
                nearest_m = cell.distance_m;
            }
        });
        (f64::from(nearest_m) - self.limits.radius_m).max(0.0)
    }
}

/// Sectors that an obstacle in grid cell `index` blocks, enlarged by `radius_m`, and its weight. Within `radius_m` asin is
/// undefined: it blocks the half circle on its side.
fn cover(index: usize, radius_m: f64) -> Cover {
    let (x_m, y_m) = offset_m(index);
    let distance_m = libm::hypot(x_m, y_m);
    let edge_m = REACH as f64 * CELL_M;
    let fall = (NEAR - 1.0) / (edge_m * edge_m);
    let weight = NEAR - fall * distance_m * distance_m;
    let half_width = if distance_m <= radius_m {
        FRAC_PI_2
    } else {
        libm::asin(radius_m / distance_m)
    };
    // In sectors. A border between two sectors belongs to neither side, so that mirrored cells cover mirrored sectors.
    let from = (libm::atan2(y_m, x_m) - half_width) / SECTOR_RAD;
    let to = from + 2.0 * half_width / SECTOR_RAD;
    let (from, to) = ((from + ROUNDING).floor(), (to - ROUNDING).ceil());
    let first = from.rem_euclid(SECTORS as f64) as usize;
    let width = (to - from) as usize;
    let squared = distance_m * distance_m / (CELL_M * CELL_M);
    Cover {
        weight: (weight.max(0.0) * PARTS).round() as u16,
        squared: squared.round() as u16,
        first: first as u8,
        end: (first + width.max(1)) as u8,
    }
}

fn cell(index: usize) -> Cell {
    let (x_m, y_m) = offset_m(index);
    let bearing_rad = libm::atan2(y_m, x_m);
    Cell {
        sector: sector_of(bearing_rad) as u8,
        distance_m: libm::hypot(x_m, y_m) as f32,
        towards: (libm::cos(bearing_rad) as f32, libm::sin(bearing_rad) as f32),
    }
}

/// The directions that an opening offers: its middle, or near its borders; and the goal's if it lies inside.
///
/// In the paper the goal counts only half a wide opening away from the borders. Here obstacles are enlarged by all that the
/// drone needs, so it counts anywhere inside.
fn candidates((first, length): (usize, usize), goal: f64) -> impl Iterator<Item = f64> {
    let (first, last) = (first as f64, (first + length - 1) as f64);
    let into = (goal - first).rem_euclid(SECTORS as f64);
    let inside = into <= last - first || length == SECTORS;
    let margin = WIDE as f64 / 2.0;
    let borders = if length > WIDE {
        [Some(first + margin), Some(last - margin)]
    } else {
        [Some((first + last) / 2.0), None]
    };
    let all_free = length == SECTORS;
    let borders = if all_free { [None, None] } else { borders };
    borders.into_iter().flatten().chain(inside.then_some(goal))
}

impl Avoider for VfhPlus {
    fn steer(&mut self, situation: &Situation<'_>) -> Option<Steering> {
        self.update_binary(situation);
        let masked = self
            .blocked
            .union(self.unreachable(situation))
            .union(situation.blind);
        let fraction = |bearing_rad: f64| {
            let positive = bearing_rad.rem_euclid(2.0 * PI);
            positive / SECTOR_RAD - 0.5
        };
        let goal = fraction(situation.goal_rad);
        // Whether the goal lies inside an opening is asked of its whole sector.
        let goal_sector = sector_of(situation.goal_rad) as f64;
        self.chosen = self.choose(masked, goal_sector, fraction(situation.course_rad));
        let chosen = self.chosen?;
        let course_rad = if apart(chosen, goal_sector) < 1e-9 {
            bearing_of(goal)
        } else {
            bearing_of(chosen)
        };
        let room_m = self.room_ahead_m(situation, course_rad);
        let turning = (situation.turn_rate_rps.abs() / self.limits.turn_rate_max_rps).min(1.0);
        let share = (room_m / SLOWED_M).min(1.0) * (1.0 - turning);
        Some(Steering {
            course_rad,
            speed_mps: share.max(SPEED_MIN) * self.limits.speed_max_mps,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::CertaintyGrid;
    use super::super::tests::{LIMITS, situation};
    use super::*;

    #[test]
    fn every_bearing_within_the_enlarged_cell_is_covered() {
        for index in 0..SIDE * SIDE {
            let (x_m, y_m) = offset_m(index);
            let distance_m = libm::hypot(x_m, y_m);
            if distance_m <= LIMITS.radius_m {
                continue;
            }
            let Cover { first, end, .. } = cover(index, LIMITS.radius_m);
            let covered: SectorSet = (usize::from(first)..usize::from(end)).collect();
            let (bearing_rad, half_rad) = (
                libm::atan2(y_m, x_m),
                libm::asin(LIMITS.radius_m / distance_m),
            );
            for part in -20..=20 {
                // The border itself may be that of a sector.
                let share = 0.999_999 * f64::from(part) / 20.0;
                let sector = sector_of(bearing_rad + share * half_rad);
                assert!(covered.contains(sector), "{x_m}, {y_m}: {sector}");
            }
            let all = 2.0 * half_rad / SECTOR_RAD;
            assert!((covered.len() as f64) < all + 2.0, "{x_m}, {y_m}");
        }
    }

    #[test]
    fn mirrored_obstacles_give_mirrored_steering() {
        for (column, row) in (4..30).flat_map(|it| (1..30).map(move |row| (it, row))) {
            let steered = |side: f64| {
                let mut grid = CertaintyGrid::new((0.025, 0.025));
                let at = |cells: i32| 0.025 + f64::from(cells) * CELL_M;
                grid.mark((at(column), 0.025 + side * f64::from(row) * CELL_M));
                // Off the middle of a sector, where two ways would cost the same.
                let goal_rad = side * 0.1;
                VfhPlus::new(LIMITS)
                    .steer(&situation(&grid, goal_rad))
                    .unwrap()
            };
            let (left, right) = (steered(1.0), steered(-1.0));
            let off_rad = wrapped_rad(left.course_rad + right.course_rad);
            assert!(off_rad.abs() < 1e-6, "{column}, {row}: {left:?} {right:?}");
        }
    }
}
