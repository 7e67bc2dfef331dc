//! The methods of avoidance on traps: a dead end in the form of a U, a corridor, a door.
//!
//! A point robot steers ten times a second towards the goal, or along a path to it, and sees all walls of its window: what is
//! compared is the method, not the sonars.

use std::sync::Arc;

use comfy_table::{CellAlignment, Table};
use muster_indoor::avoidance::{CELL_M, CertaintyGrid, Method, SIDE, SectorSet, Situation};
use muster_indoor::frames::{MapXy, wrapped_rad};
use muster_indoor::map::{Map, State};
use muster_indoor::path::Floor;
use muster_scenarios::report::TABLE_STYLE;

use crate::flat::{CELL_M as MAP_CELL_M, widened};
use crate::rule::{CLEARANCE_M, wall_m};
use crate::world::LIMITS;

/// Time between two decisions, in seconds.
const PERIOD_S: f64 = 0.1;
/// A robot that takes longer is trapped, in seconds.
const TIME_MAX_S: f64 = 90.0;
/// The goal is reached within this distance, in metres.
const REACHED_M: f64 = 0.2;
/// Distance along the path of the point that is steered to, in metres.
const AHEAD_M: f64 = 0.7;
/// Highest acceleration, in m/s².
const ACCELERATION_MPS2: f64 = 1.0;
/// Turns to the other side that make a flight a swing, a minute, and the angle from which a turn counts, in radians.
const SWINGS_A_MINUTE: f64 = 30.0;
const SWING_RAD: f64 = 0.35;

/// A place where methods fail.
#[derive(Debug, Clone, Copy)]
pub struct Trap {
    /// Its name.
    pub name: &'static str,
    plan: &'static str,
    start: MapXy,
    goal: MapXy,
}

/// The shipped traps, 10 cm a character.
pub const TRAPS: [Trap; 3] = [
    Trap {
        name: "U",
        plan: include_str!("../traps/u.txt"),
        start: MapXy::new(1.0, 2.0),
        goal: MapXy::new(4.5, 2.0),
    },
    Trap {
        name: "corridor",
        plan: include_str!("../traps/corridor.txt"),
        start: MapXy::new(0.5, 0.75),
        goal: MapXy::new(5.5, 0.75),
    },
    Trap {
        name: "door",
        plan: include_str!("../traps/door.txt"),
        start: MapXy::new(0.7, 1.4),
        goal: MapXy::new(4.3, 1.4),
    },
];

/// What came of one flight.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fate {
    /// The goal was reached.
    Passed,
    /// It was reached, swinging from side to side.
    Swung,
    /// The robot came to rest, or went round in circles.
    Trapped,
    /// A wall was nearer than the clearance of the rule.
    Touched,
}

impl Fate {
    /// In one word.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Passed => "passed",
            Self::Swung => "swings",
            Self::Trapped => "trapped",
            Self::Touched => "touches",
        }
    }
}

/// One flight of the comparison.
#[derive(Debug, Clone, PartialEq)]
pub struct Flown {
    /// The trap.
    pub trap: &'static str,
    /// How obstacles were avoided.
    pub method: Method,
    /// Whether a path was followed.
    pub with_path: bool,
    /// What came of it.
    pub fate: Fate,
    /// In seconds.
    pub time_s: f64,
    /// Least distance from walls, in metres.
    pub clearance_m: f64,
    /// Turns to the other side, a minute.
    pub swings_a_minute: f64,
}

/// Flies all methods through all traps, VFH+ without and with a path.
#[must_use]
pub fn compare() -> Vec<Flown> {
    let variants = [
        (Method::PotentialFields, false),
        (Method::Vfh, false),
        (Method::VfhPlus, false),
        (Method::VfhPlus, true),
    ];
    let all = TRAPS
        .iter()
        .flat_map(|trap| variants.map(|variant| (trap, variant)));
    all.map(|(trap, (method, with_path))| fly(trap, method, with_path))
        .collect()
}

/// The comparison as a table, one row for each flight.
#[must_use]
pub fn table(flown: &[Flown]) -> String {
    let mut table = Table::new();
    table.force_no_tty().load_style(TABLE_STYLE);
    table.set_header([
        "trap",
        "method",
        "result",
        "time s",
        "clearance m",
        "swings/min",
    ]);
    for flight in flown {
        let with = if flight.with_path { " with a path" } else { "" };
        table.add_row([
            flight.trap.to_owned(),
            format!("{}{with}", flight.method.name()),
            flight.fate.word().to_owned(),
            format!("{:.1}", flight.time_s),
            format!("{:.2}", flight.clearance_m),
            format!("{:.0}", flight.swings_a_minute),
        ]);
    }
    for column in 3..6 {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    format!("{table}\n")
}

struct Robot {
    at: MapXy,
    velocity: (f64, f64),
    course_rad: f64,
    turn_rps: f64,
}

impl Robot {
    /// Takes a velocity within its acceleration, for one period.
    fn step(&mut self, (vx, vy): (f64, f64)) {
        let (dx, dy) = (vx - self.velocity.0, vy - self.velocity.1);
        let change = libm::hypot(dx, dy);
        let share = (ACCELERATION_MPS2 * PERIOD_S / change.max(1e-12)).min(1.0);
        self.velocity = (self.velocity.0 + dx * share, self.velocity.1 + dy * share);
        let (vx, vy) = self.velocity;
        if libm::hypot(vx, vy) > 0.02 {
            let course_rad = libm::atan2(vy, vx);
            self.turn_rps = wrapped_rad(course_rad - self.course_rad) / PERIOD_S;
            self.course_rad = course_rad;
        }
        self.at = MapXy::new(self.at.x_m + vx * PERIOD_S, self.at.y_m + vy * PERIOD_S);
    }
}

fn fly(trap: &Trap, method: Method, with_path: bool) -> Flown {
    let cells = (0.1 / MAP_CELL_M) as usize;
    let map = Map::from_text(&widened(trap.plan, cells), MAP_CELL_M);
    let map = Arc::new(map.expect("shipped traps are tested"));
    let path = with_path.then(|| {
        let floor = Floor::new(Arc::clone(&map), LIMITS.radius_m);
        floor
            .path(trap.start, trap.goal)
            .expect("shipped traps have a path")
    });
    let mut avoider = method.avoider(LIMITS);
    let mut robot = Robot {
        at: trap.start,
        velocity: (0.0, 0.0),
        course_rad: trap.start.bearing_rad(trap.goal),
        turn_rps: 0.0,
    };
    let (mut time_s, mut clearance_m, mut swings) = (0.0, f64::INFINITY, Swings::default());
    let is_far = |robot: &Robot| robot.at.distance_m(trap.goal) > REACHED_M;
    while is_far(&robot) && time_s < TIME_MAX_S && clearance_m >= CLEARANCE_M {
        let to = path
            .as_deref()
            .map_or(trap.goal, |path| ahead(path, robot.at));
        let grid = surroundings(&map, robot.at);
        let steering = avoider.steer(&Situation {
            grid: &grid,
            goal_m: robot.at.distance_m(to),
            goal_rad: robot.at.bearing_rad(to),
            course_rad: robot.course_rad,
            speed_mps: libm::hypot(robot.velocity.0, robot.velocity.1),
            turn_rate_rps: robot.turn_rps.clamp(
                -LIMITS.turn_rate_max_rps / 2.0,
                LIMITS.turn_rate_max_rps / 2.0,
            ),
            blind: SectorSet::NONE,
        });
        let wanted = steering.map_or((0.0, 0.0), |it| {
            (
                it.speed_mps * libm::cos(it.course_rad),
                it.speed_mps * libm::sin(it.course_rad),
            )
        });
        robot.step(wanted);
        swings.observe(robot.course_rad);
        clearance_m = clearance_m.min(wall_m(&map, robot.at));
        time_s += PERIOD_S;
    }
    let swings_a_minute = f64::from(swings.count) * 60.0 / time_s;
    let left_m = robot.at.distance_m(trap.goal);
    Flown {
        trap: trap.name,
        method,
        with_path,
        fate: fate(clearance_m, left_m, swings_a_minute),
        time_s,
        clearance_m,
        swings_a_minute,
    }
}

/// How a flight ended that is `left_m` from its goal.
fn fate(clearance_m: f64, left_m: f64, swings_a_minute: f64) -> Fate {
    if clearance_m < CLEARANCE_M {
        Fate::Touched
    } else if left_m > REACHED_M {
        Fate::Trapped
    } else if swings_a_minute > SWINGS_A_MINUTE {
        Fate::Swung
    } else {
        Fate::Passed
    }
}

/// Counts turns to the other side.
#[derive(Debug, Default)]
struct Swings {
    /// The course at which the present turn began to count, and its side.
    extreme_rad: Option<f64>,
    side: f64,
    count: u32,
}

impl Swings {
    fn observe(&mut self, course_rad: f64) {
        let extreme_rad = *self.extreme_rad.get_or_insert(course_rad);
        let turned = wrapped_rad(course_rad - extreme_rad);
        if turned * self.side > 0.0 {
            self.extreme_rad = Some(course_rad);
        } else if turned.abs() > SWING_RAD {
            self.count += u32::from(self.side != 0.0);
            self.side = turned.signum();
            self.extreme_rad = Some(course_rad);
        }
    }
}

/// All walls in the window around a point.
fn surroundings(map: &Map, at: MapXy) -> CertaintyGrid {
    let mut grid = CertaintyGrid::new((at.x_m, at.y_m));
    let reach = SIDE as i64 / 2;
    for row in -reach..=reach {
        for column in -reach..=reach {
            let x_m = at.x_m + column as f64 * CELL_M;
            let y_m = at.y_m + row as f64 * CELL_M;
            let cell = map.cell(MapXy::new(x_m, y_m));
            if cell.is_some_and(|cell| map.state(cell) == State::Occupied) {
                grid.mark((x_m, y_m));
            }
        }
    }
    grid
}

/// The point of a path that lies [`AHEAD_M`] after the one nearest to the robot.
fn ahead(path: &[MapXy], at: MapXy) -> MapXy {
    let points: Vec<MapXy> = path
        .windows(2)
        .flat_map(|leg| {
            let steps = (leg[0].distance_m(leg[1]) / CELL_M).ceil().max(1.0);
            let bearing_rad = leg[0].bearing_rad(leg[1]);
            let length_m = leg[0].distance_m(leg[1]);
            let from = leg[0];
            (1..=steps as usize)
                .map(move |step| from.towards(bearing_rad, length_m * step as f64 / steps))
        })
        .collect();
    let nearest = (0..points.len()).min_by(|a, b| {
        points[*a]
            .distance_m(at)
            .total_cmp(&points[*b].distance_m(at))
    });
    let index = nearest.unwrap_or(0) + (AHEAD_M / CELL_M) as usize;
    points.get(index).or(points.last()).copied().unwrap_or(at)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What the indoor thesis says of potential fields (disadvantages): stuck in concave forms, oscillating in corridors; and
    /// what rejected them first: blocked between close obstacles.
    #[test]
    fn potential_fields_fail_where_vfh_plus_with_a_path_passes() {
        let flown = compare();
        for flight in &flown {
            match (flight.method, flight.with_path) {
                (Method::PotentialFields, _) => {
                    assert_ne!(flight.fate, Fate::Passed, "{flight:?}");
                }
                (Method::VfhPlus, true) => assert_eq!(flight.fate, Fate::Passed, "{flight:?}"),
                _ => {}
            }
        }
        let of_fields = |trap| {
            let mut fields = flown
                .iter()
                .filter(|it| it.method == Method::PotentialFields);
            fields.find(|it| it.trap == trap).map(|it| it.fate)
        };
        assert_eq!(of_fields("U"), Some(Fate::Trapped));
        assert_eq!(of_fields("corridor"), Some(Fate::Swung));
        assert_eq!(of_fields("door"), Some(Fate::Trapped));
    }
}
