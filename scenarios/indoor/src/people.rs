//! People who walk to and fro. They stop before a drone, and turn back if it stays in their path.

use muster_indoor::frames::MapXy;
use muster_indoor::random::uniform;
use muster_indoor::sensor::Disc;
use rand_chacha::ChaCha8Rng;

use crate::flat::Walk;

/// Radius of a person, in metres.
pub(crate) const RADIUS_M: f64 = 0.2;
/// Distance of a person's edge from the drone at which the person stops, in metres.
const STOP_M: f64 = 0.5;
/// A person who was stopped for so long turns back, in seconds.
const PATIENCE_S: f64 = 3.0;
/// Share by which a person's speed may differ from the flat's.
const SPREAD: f64 = 0.2;

#[derive(Debug, Clone)]
pub(crate) struct Person {
    walk: Walk,
    speed_mps: f64,
    /// Place on the path, in metres from its begin.
    along_m: f64,
    forward: bool,
    stopped_s: f64,
    pub(crate) at: MapXy,
    /// Metres per second along x and y.
    pub(crate) velocity: (f64, f64),
}

impl Person {
    /// Somewhere on the path.
    pub(crate) fn new(walk: &Walk, rng: &mut ChaCha8Rng) -> Self {
        let along_m = uniform(rng) * length_m(&walk.path);
        Self {
            speed_mps: walk.speed_mps * (1.0 + SPREAD * (2.0 * uniform(rng) - 1.0)),
            at: point_at(&walk.path, along_m),
            walk: walk.clone(),
            along_m,
            forward: uniform(rng) < 0.5,
            stopped_s: 0.0,
            velocity: (0.0, 0.0),
        }
    }

    /// What sonars hear of the person.
    pub(crate) const fn disc(&self) -> Disc {
        Disc {
            at: self.at,
            radius_m: RADIUS_M,
        }
    }

    /// Walks for `dt_s` seconds, unless that leads closer than [`STOP_M`] to the drone.
    pub(crate) fn step(&mut self, dt_s: f64, drone: MapXy) {
        let end_m = length_m(&self.walk.path);
        let step_m = self.speed_mps * dt_s * if self.forward { 1.0 } else { -1.0 };
        let along_m = self.along_m + step_m;
        if !(0.0..=end_m).contains(&along_m) {
            self.forward = !self.forward;
            self.velocity = (0.0, 0.0);
            return;
        }
        let next = point_at(&self.walk.path, along_m);
        let (now_m, next_m) = (self.at.distance_m(drone), next.distance_m(drone));
        if next_m < now_m && next_m < STOP_M + RADIUS_M {
            self.velocity = (0.0, 0.0);
            self.stopped_s += dt_s;
            if self.stopped_s > PATIENCE_S {
                self.stopped_s = 0.0;
                self.forward = !self.forward;
            }
            return;
        }
        self.stopped_s = 0.0;
        self.velocity = (
            (next.x_m - self.at.x_m) / dt_s,
            (next.y_m - self.at.y_m) / dt_s,
        );
        self.along_m = along_m;
        self.at = next;
    }
}

fn length_m(path: &[MapXy]) -> f64 {
    path.windows(2).map(|leg| leg[0].distance_m(leg[1])).sum()
}

fn point_at(path: &[MapXy], mut along_m: f64) -> MapXy {
    for leg in path.windows(2) {
        let leg_m = leg[0].distance_m(leg[1]);
        if along_m <= leg_m {
            return leg[0].towards(leg[0].bearing_rad(leg[1]), along_m);
        }
        along_m -= leg_m;
    }
    path[path.len() - 1]
}
