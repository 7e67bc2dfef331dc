//! From an estimate to the pose nearby that fits the readings best.
//!
//! The mean of particles that stand decimetres apart fits no better than a wrong place that looks like the true one.

use super::observation::Observation;
use super::particles::Particles;
use super::tables::Tables;

/// First step of the climb, and the one at which it ends, in metres. A cell of most maps is 5 cm.
const STEP_M: (f64, f64) = (0.1, 0.01);
/// The turn that is tried beside a step of a metre, in radians: ends of rays 5 m away move as far.
const TURN_RAD: f64 = 0.2;
/// Most rounds, with six poses each.
const ROUNDS_MAX: usize = 30;

/// The pose of the greatest likelihood that steps along x, y and heading lead to. Echoes of cones alone have no slope: then it is
/// the start.
///
/// Source: pattern search; R. Hooke, T. Jeeves, "Direct search solution of numerical and statistical problems", 1961, without
/// its longer steps.
pub(super) fn climbed(start: Particles, observation: &Observation, tables: &Tables) -> Particles {
    if !observation.has_rays() {
        return start;
    }
    let mut scores = Vec::new();
    observation.score(&start, tables, &mut scores);
    let (mut best, mut best_score) = (start.at(0), scores[0]);
    let (mut step_m, last_m) = STEP_M;
    let mut around = Particles::default();
    for _ in 0..ROUNDS_MAX {
        if step_m < last_m {
            break;
        }
        surround(&mut around, best, step_m, tables);
        observation.score(&around, tables, &mut scores);
        let tried = scores.iter().copied().enumerate();
        match tried.max_by(|(_, a), (_, b)| a.total_cmp(b)) {
            Some((index, score)) if score > best_score => {
                (best, best_score) = (around.at(index), score);
            }
            _ => step_m *= 0.5,
        }
    }
    Particles::one(best)
}

/// Sets particles to the poses a step before and behind along x, y and heading.
fn surround(around: &mut Particles, from: (f32, f32, f32), step_m: f64, tables: &Tables) {
    let (x, y, heading) = from;
    around.clear();
    for side_m in [-step_m, step_m] {
        let step = (side_m / tables.resolution_m) as f32;
        around.push(x + step, y, heading);
        around.push(x, y + step, heading);
        around.push(x, y, heading + (TURN_RAD * side_m) as f32);
    }
    around.turn();
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::filter::Config;
    use crate::frames::{BodyXy, MapPose};
    use crate::map::Map;
    use crate::reading::{Echo, Mounting, Reading};

    const ROOM: &str = "
##############################
#............................#
#............................#
#............................#
#..................###.......#
#..................###.......#
#............................#
#............................#
#............................#
####.........................#
####.........................#
##############################";

    /// The room in cells of 5 cm.
    fn fine_room() -> Map {
        let line = |line: &str| {
            let line: String = line.chars().map(|it| it.to_string().repeat(4)).collect();
            [line.as_str(); 4].join("\n")
        };
        let lines: Vec<String> = ROOM.lines().map(line).collect();
        Map::from_text(lines.join("\n").trim(), 0.05).unwrap()
    }

    fn scan(map: &Map, pose: MapPose) -> Vec<Reading> {
        let reading = |beam: i32| {
            let bearing_rad = f64::from(beam).to_radians() * 3.0;
            let mounting = Mounting::laser(BodyXy::new(0.0, 0.0), bearing_rad, 20.0);
            let range_m = map.cast(pose.at, pose.heading_rad + bearing_rad, 20.0);
            Reading {
                mounting,
                echo: range_m.map_or(Echo::Silence, Echo::At),
                taken: Duration::ZERO,
                expires: Duration::from_secs(1),
            }
        };
        (-30..30).map(reading).collect()
    }

    #[test]
    fn an_estimate_off_by_two_decimetres_fits_as_well_as_the_true_pose() {
        let map = fine_room();
        let config = Config {
            cone_range_max_m: 0.0,
            ..Config::default()
        };
        let tables = Tables::new(&map, &config).unwrap();
        let readings = scan(&map, MapPose::new(2.0, 1.2, 0.3));
        let observation = Observation::new(&readings, Duration::ZERO, 60, &tables, &config);
        let fit = |at: &Particles| observation.fit(at, &tables, &config);
        let particle = |(x_m, y_m, heading_rad): (f64, f64, f64)| {
            let (x, y, heading) = tables.in_grid(MapPose::new(x_m, y_m, heading_rad));
            Particles::one((x as f32, y as f32, heading as f32))
        };
        let exact = fit(&particle((2.0, 1.2, 0.3)));
        for off in [(2.2, 1.3, 0.36), (1.85, 1.05, 0.25), (2.0, 1.4, 0.24)] {
            let start = particle(off);
            let before = fit(&start);
            let after = fit(&climbed(start, &observation, &tables));
            assert!(before < exact - 0.03, "{off:?}: {before}, {exact}");
            assert!(after > exact - 0.005, "{off:?}: {after}, {exact}");
        }
    }
}
