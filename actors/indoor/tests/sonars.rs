//! Localisation with five sonars and nothing else, in a flat.

#![allow(clippy::print_stdout, reason = "figures are printed on demand")]

use std::f64::consts::PI;
use std::sync::Arc;
use std::time::Duration;

use muster_indoor::filter::{Config, Filter, Moved, Tables};
use muster_indoor::frames::{BodyXy, MapPose, MapXy, Motion, wrapped_rad};
use muster_indoor::map::Map;
use muster_indoor::random::normal;
use muster_indoor::reading::{Mounting, Reading};
use muster_indoor::sensor::{Reflector, Room, SonarModel};
use nalgebra::{Matrix3, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// 9.6 m × 5.8 m, a character for 20 cm.
const FLAT: &str = "
################################################
#.................#............................#
#.................#............................#
#.................#............................#
#.................#............................#
#.................#.........#####..............#
#.................#.........#####..............#
#.................#............................#
#..............................................#
#..............................................#
#..............................................#
#..............................................#
#.................#............................#
#.................#............................#
#.................#............................#
#.................#............................#
###########....################....#############
#...................................#..........#
#...................................#..........#
#...................................#..........#
#..............................................#
#..............................................#
#..............................................#
#..............................................#
#...................................#..........#
#######.............................#..........#
#######.............................#..........#
#######.............................#..........#
################################################";
/// Corners of a round trip through all rooms, metres.
const ROUTE: [(f64, f64); 10] = [
    (1.0, 4.0),
    (2.6, 3.8),
    (3.6, 3.9),
    (6.4, 3.7),
    (6.5, 1.4),
    (8.3, 1.3),
    (6.5, 1.4),
    (2.6, 1.4),
    (2.6, 3.8),
    (1.0, 4.0),
];
const STEP_S: f64 = 0.125;
const SPEED_MPS: f64 = 0.4;

/// A drone that follows the route, its sonars and its odometry.
struct Drone {
    pose: MapPose,
    next: usize,
    rng: ChaCha8Rng,
}

impl Drone {
    fn new(seed: u64) -> Self {
        let (x, y) = ROUTE[0];
        Self {
            pose: MapPose::new(x, y, 0.0),
            next: 1,
            rng: ChaCha8Rng::seed_from_u64(seed),
        }
    }

    /// Moves a step along the route. Returns what the odometry says of it: 5 % noise of the way, 0.5° of the turn.
    fn fly(&mut self) -> Motion {
        let (x, y) = ROUTE[self.next % ROUTE.len()];
        let goal = MapXy::new(x, y);
        if self.pose.at.distance_m(goal) < 0.1 {
            self.next += 1;
        }
        let off = wrapped_rad(self.pose.at.bearing_rad(goal) - self.pose.heading_rad);
        let turn_rad = off.clamp(-0.2, 0.2);
        let forward_m = if off.abs() < 0.3 {
            SPEED_MPS * STEP_S
        } else {
            0.0
        };
        let motion = Motion {
            forward_m,
            left_m: 0.0,
            turn_rad,
        };
        self.pose = self.pose.moved(motion);
        Motion {
            forward_m: forward_m * (1.0 + 0.05 * normal(&mut self.rng)),
            left_m: 0.05 * forward_m * normal(&mut self.rng),
            turn_rad: turn_rad + 0.009 * normal(&mut self.rng),
        }
    }

    fn look(&mut self, map: &Map, now: Duration) -> Vec<Reading> {
        let model = SonarModel::default();
        let reading = |bearing_deg: f64| {
            let mounting = Mounting {
                at: BodyXy::new(0.0, 0.0),
                bearing_rad: bearing_deg.to_radians(),
                aperture_rad: PI / 6.0,
                range_min_m: 0.05,
                range_max_m: 4.0,
            };
            let room = Room {
                map,
                surfaces: &|_| Reflector::Rough,
                discs: &[],
            };
            let echo = model.measure(room, self.pose, &mounting, &[], &mut self.rng);
            Reading {
                mounting,
                echo,
                taken: now,
                expires: now + Duration::from_millis(250),
            }
        };
        [-90.0, -37.0, 0.0, 37.0, 90.0].map(reading).to_vec()
    }
}

#[test]
fn with_sonars_only_the_95th_percentile_of_the_error_is_at_most_25_cm() {
    check(5);
}

/// The same at length.
#[test]
#[ignore = "takes a minute"]
fn with_sonars_only_a_hundred_seeds_stay_within_25_cm() {
    check(100);
}

fn check(seeds: u64) {
    let map = Map::from_text(FLAT, 0.2).expect("a plan");
    let config = Config::default();
    let tables = Arc::new(Tables::new(&map, &config).expect("free cells"));
    let (mut errors_m, mut lost, mut all) = (Vec::new(), 0, 0);
    for seed in 0..seeds {
        let mut drone = Drone::new(seed);
        let mut filter = Filter::new(Arc::clone(&tables), config, seed);
        filter.start_at(
            drone.pose,
            Matrix3::from_diagonal(&Vector3::new(0.25, 0.25, 0.1)),
        );
        for step in 0..300_u32 {
            let now = Duration::from_secs_f64(STEP_S) * step;
            let motion = drone.fly();
            let readings = drone.look(&map, now);
            let estimate = filter.step(Moved::Odometry(motion), &readings, now);
            // Five seconds to converge.
            if step >= 40 {
                errors_m.push(estimate.pose.at.distance_m(drone.pose.at));
                lost += u32::from(estimate.is_lost);
                all += 1;
            }
        }
    }
    errors_m.sort_by(f64::total_cmp);
    let p95_m = errors_m[errors_m.len() * 95 / 100];
    println!(
        "p50 {:.3} m, p95 {p95_m:.3} m, lost in {lost} of {all} steps",
        errors_m[errors_m.len() / 2]
    );
    assert!(p95_m <= 0.25, "{p95_m}");
}
