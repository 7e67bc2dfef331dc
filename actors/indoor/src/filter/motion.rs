//! How particles move.

use std::time::Duration;

use super::config::Config;
use super::fast::sin_cos;
use super::noise::Noise;
use super::particles::Particles;
use crate::frames::{Motion, wrapped_rad};

/// What is known of the drone's motion since the last step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Moved {
    /// The odometry's.
    Odometry(Motion),
    /// Nothing but the time that passed: a random walk.
    Unknown(Duration),
}

/// Shorter motions have no direction, metres; AMCL's.
const STANDSTILL_M: f64 = 0.01;

/// Moves each particle with its own noise.
///
/// Source: S. Thrun, W. Burgard, D. Fox, *Probabilistic Robotics*, 2005, table 5.6; going backwards is no half turn, as in AMCL.
pub(super) fn advance(
    particles: &mut Particles,
    moved: Moved,
    config: &Config,
    metres_per_cell: f64,
    noise: &mut Noise,
) {
    match moved {
        Moved::Odometry(motion) => odometry(particles, motion, config, metres_per_cell, noise),
        Moved::Unknown(time) => {
            let walk = libm::sqrt(config.walk_m2 * time.as_secs_f64()) / metres_per_cell;
            let turn = libm::sqrt(config.walk_rad2 * time.as_secs_f64());
            jitter(particles, walk as f32, turn as f32, noise);
        }
    }
    particles.turn();
}

/// Adds normal noise: cells and radians.
pub(super) fn jitter(particles: &mut Particles, walk: f32, turn: f32, noise: &mut Noise) {
    let poses = particles.x.iter_mut().zip(&mut particles.y);
    for ((x, y), heading) in poses.zip(&mut particles.heading) {
        *x += walk * noise.normal();
        *y += walk * noise.normal();
        *heading += turn * noise.normal();
    }
}

fn odometry(
    particles: &mut Particles,
    motion: Motion,
    config: &Config,
    metres_per_cell: f64,
    noise: &mut Noise,
) {
    let way_m = libm::hypot(motion.forward_m, motion.left_m);
    let first = if way_m < STANDSTILL_M {
        0.0
    } else {
        libm::atan2(motion.left_m, motion.forward_m)
    };
    let second = wrapped_rad(motion.turn_rad - first);
    let amount = |turn: f64| {
        let back = wrapped_rad(turn - std::f64::consts::PI).abs();
        turn.abs().min(back)
    };
    let deviation = |of_turn: f64, of_way: f64, turns: f64| {
        libm::sqrt(of_turn * turns + of_way * way_m * way_m) as f32
    };
    let (squared_first, squared_second) = (
        amount(first) * amount(first),
        amount(second) * amount(second),
    );
    let first_noise = deviation(config.alpha1, config.alpha2, squared_first);
    let second_noise = deviation(config.alpha1, config.alpha2, squared_second);
    let way_noise = deviation(config.alpha4, config.alpha3, squared_first + squared_second)
        / metres_per_cell as f32;
    let (first, second, way) = (
        first as f32,
        second as f32,
        (way_m / metres_per_cell) as f32,
    );
    let poses = particles.x.iter_mut().zip(&mut particles.y);
    for ((x, y), heading) in poses.zip(&mut particles.heading) {
        let direction = *heading + first + first_noise * noise.normal();
        let (sin, cos) = sin_cos(direction);
        let way = way + way_noise * noise.normal();
        *x += way * cos;
        *y += way * sin;
        *heading = direction + second + second_noise * noise.normal();
    }
}
