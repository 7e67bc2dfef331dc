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

/// One cell of the window.
#[derive(Debug, Clone, Copy)]
struct Cell {
    /// a − b·d², in parts.
    weight: i32,
    /// First sector that the enlarged cell covers.
    first: u8,
    /// The sector after the last; may be beyond a full turn.
    end: u8,
    /// The sector of the cell's own bearing.
    sector: u8,
    /// Distance from the drone, in metres.
    distance_m: f32,
    /// Bearing from the drone, in radians.
    bearing_rad: f32,
}

/// VFH+. A call takes the same few microseconds however the grid is filled.
#[derive(Debug, Clone)]
pub struct VfhPlus {
    limits: Limits,
    table: Vec<Cell>,
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
            table: (0..SIDE * SIDE)
                .map(|index| cell(index, limits.radius_m))
                .collect(),
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
        let reach_m = reach_m as f32;
        let near = situation.grid.occupied_near(f64::from(reach_m));
        near.for_each(|(index, certainty)| {
            let cell = &self.table[index];
            let certainty = i32::from(certainty) * i32::from(cell.distance_m < reach_m);
            let magnitude = certainty * certainty * cell.weight;
            changes[usize::from(cell.first)] += magnitude;
            changes[usize::from(cell.end)] -= magnitude;
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

    /// The sectors that the drone can't turn to at its speed without touching an enlarged obstacle (section 3).
    fn unreachable(&self, situation: &Situation<'_>) -> SectorSet {
        let turn_m = situation.speed_mps / self.limits.turn_rate_max_rps;
        let clear_m = turn_m + self.limits.radius_m;
        let (sin, cos) = (
            libm::sin(situation.course_rad),
            libm::cos(situation.course_rad),
        );
        let reach_m = turn_m + clear_m;
        // Of each side: how far the drone may turn, in radians.
        let mut turns = [PI, PI];
        for (index, certainty) in situation.grid.occupied_near(reach_m) {
            let cell = &self.table[index];
            if certainty < OBSTACLE || f64::from(cell.distance_m) >= reach_m {
                continue;
            }
            let (x_m, y_m) = offset_m(index);
            let (ahead_m, left_m) = (cos * x_m + sin * y_m, cos * y_m - sin * x_m);
            let (ahead_sq, aside) = (ahead_m * ahead_m, left_m.abs() - turn_m);
            if ahead_sq + aside * aside < clear_m * clear_m {
                let side = usize::from(left_m < 0.0);
                let turn = wrapped_rad(f64::from(cell.bearing_rad) - situation.course_rad);
                turns[side] = turns[side].min(turn.abs());
            }
        }
        let [left, right] = turns;
        let is_out = |sector: &usize| {
            let aside = wrapped_rad(bearing_of(*sector as f64) - situation.course_rad);
            // The course itself is no turn.
            aside.abs() > SECTOR_RAD && (aside > left || -aside > right)
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
        for (index, certainty) in situation.grid.occupied_near(f64::from(nearest_m)) {
            let cell = &self.table[index];
            if cell.distance_m < nearest_m
                && certainty >= OBSTACLE
                && ahead.contains(usize::from(cell.sector))
            {
                nearest_m = cell.distance_m;
            }
        }
        (f64::from(nearest_m) - self.limits.radius_m).max(0.0)
    }
}

/// A cell's row in the table. A cell nearer than `radius_m` has no tangent (asin of more than 1): it blocks the half circle on
/// its side. The drone's own cell has no side: it counts nowhere.
fn cell(index: usize, radius_m: f64) -> Cell {
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
    let bearing = libm::atan2(y_m, x_m);
    let first = sector_of(bearing - half_width);
    let width = (2.0 * half_width / SECTOR_RAD).ceil() as usize;
    Cell {
        weight: if distance_m > 0.0 {
            (weight.max(0.0) * PARTS).round() as i32
        } else {
            0
        },
        first: first as u8,
        end: (first + width.max(1)) as u8,
        sector: sector_of(bearing) as u8,
        distance_m: distance_m as f32,
        bearing_rad: bearing as f32,
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
