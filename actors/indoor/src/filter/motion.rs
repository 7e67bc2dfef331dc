//! How particles move.

use std::time::Duration;

use super::config::{Config, OdomModel};
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
pub(super) fn advance(
    particles: &mut Particles,
    moved: Moved,
    config: &Config,
    metres_per_cell: f64,
    noise: &mut Noise,
) {
    match moved {
        Moved::Odometry(motion) => match config.odom_model {
            OdomModel::Diff => diff(particles, motion, config, metres_per_cell, noise),
            OdomModel::Omni => omni(particles, motion, config, metres_per_cell, noise),
        },
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

/// Source: S. Thrun, W. Burgard, D. Fox, *Probabilistic Robotics*, 2005, table 5.6; going backwards is no half turn, as in AMCL.
fn diff(
    particles: &mut Particles,
    motion: Motion,
    config: &Config,
    metres_per_cell: f64,
    noise: &mut Noise,
) {
    let distance_m = libm::hypot(motion.forward_m, motion.left_m);
    let first = if distance_m < STANDSTILL_M {
        0.0
    } else {
        libm::atan2(motion.left_m, motion.forward_m)
    };
    let second = wrapped_rad(motion.turn_rad - first);
    let amount = |turn: f64| {
        let back = wrapped_rad(turn - std::f64::consts::PI).abs();
        turn.abs().min(back)
    };
    let deviation = |of_turn: f64, of_distance: f64, turns: f64| {
        libm::sqrt(of_turn * turns + of_distance * distance_m * distance_m) as f32
    };
    let (squared_first, squared_second) = (
        amount(first) * amount(first),
        amount(second) * amount(second),
    );
    let first_noise = deviation(config.alpha1, config.alpha2, squared_first);
    let second_noise = deviation(config.alpha1, config.alpha2, squared_second);
    let distance_noise = deviation(config.alpha4, config.alpha3, squared_first + squared_second)
        / metres_per_cell as f32;
    let (first, second, distance) = (
        first as f32,
        second as f32,
        (distance_m / metres_per_cell) as f32,
    );
    let poses = particles.x.iter_mut().zip(&mut particles.y);
    for ((x, y), heading) in poses.zip(&mut particles.heading) {
        let direction = *heading + first + first_noise * noise.normal();
        let (sin, cos) = sin_cos(direction);
        let distance = distance + distance_noise * noise.normal();
        *x += distance * cos;
        *y += distance * sin;
        *heading = direction + second + second_noise * noise.normal();
    }
}

/// The distances along and across the motion and the turn each have their own noise: the direction of a motion does not show how
/// far the heading turned. As AMCL's `omni`; there the noise of distances by turns is `alpha1`.
fn omni(
    particles: &mut Particles,
    motion: Motion,
    config: &Config,
    metres_per_cell: f64,
    noise: &mut Noise,
) {
    let distance_sq = motion.forward_m * motion.forward_m + motion.left_m * motion.left_m;
    let turn_sq = motion.turn_rad * motion.turn_rad;
    let deviation =
        |of_turn: f64, of_distance: f64| libm::sqrt(of_turn * turn_sq + of_distance * distance_sq);
    let turn_noise = deviation(config.alpha1, config.alpha2) as f32;
    let along_noise = (deviation(config.alpha4, config.alpha3) / metres_per_cell) as f32;
    let lateral_noise = (deviation(config.alpha4, config.alpha5) / metres_per_cell) as f32;
    let course = if distance_sq > 0.0 {
        libm::atan2(motion.left_m, motion.forward_m) as f32
    } else {
        0.0
    };
    let distance = (libm::sqrt(distance_sq) / metres_per_cell) as f32;
    let turn = motion.turn_rad as f32;
    let poses = particles.x.iter_mut().zip(&mut particles.y);
    for ((x, y), heading) in poses.zip(&mut particles.heading) {
        let (sin, cos) = sin_cos(*heading + course);
        let along = distance + along_noise * noise.normal();
        let lateral = lateral_noise * noise.normal();
        *x += along * cos - lateral * sin;
        *y += along * sin + lateral * cos;
        *heading += turn + turn_noise * noise.normal();
    }
}

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;

    use super::*;

    /// Particles that start at the origin and look along the rows, after a motion; cells of half a metre.
    fn moved(motion: Motion, config: &Config) -> Particles {
        let mut particles = Particles::default();
        (0..4_000).for_each(|_| particles.push(0.0, 0.0, 0.0));
        let mut noise = Noise::new(ChaCha8Rng::seed_from_u64(1));
        advance(
            &mut particles,
            Moved::Odometry(motion),
            config,
            0.5,
            &mut noise,
        );
        particles
    }

    fn spread(values: &[f32]) -> (f32, f32) {
        let count = values.len() as f32;
        let mean = values.iter().sum::<f32>() / count;
        let variance = values
            .iter()
            .map(|it| (it - mean) * (it - mean))
            .sum::<f32>()
            / count;
        (mean, variance.sqrt())
    }

    fn only(turn: f64, distance: f64) -> Config {
        Config {
            alpha1: turn,
            alpha2: 0.0,
            alpha3: distance,
            alpha4: 0.0,
            ..Config::default()
        }
    }

    fn motion(forward_m: f64, turn_rad: f64) -> Motion {
        Motion {
            forward_m,
            left_m: 0.0,
            turn_rad,
        }
    }

    #[test]
    fn noise_getters_are_not_swapped() {
        let turned = moved(motion(2.0, 1.0), &only(0.04, 0.0));
        let (_, heading) = spread(&turned.heading);
        assert!((heading - 0.2).abs() < 0.01, "{heading}");
        let went = moved(motion(2.0, 0.0), &only(0.0, 0.04));
        let (ahead, deviation) = spread(&went.x);
        // 2 m are 4 cells, a deviation of 0.4 m is 0.8.
        assert!(
            (ahead - 4.0).abs() < 0.05 && (deviation - 0.8).abs() < 0.03,
            "{ahead} {deviation}"
        );
        assert!(spread(&went.heading).1 < 1e-6);
    }

    #[test]
    fn angles_are_not_passed_where_distances_belong() {
        let turned = moved(motion(0.0, 1.0), &only(0.0, 0.0));
        assert!(turned.x.iter().chain(&turned.y).all(|it| it.abs() < 1e-6));
        let went = moved(motion(1.0, 0.0), &only(0.0, 0.0));
        assert!(went.heading.iter().all(|it| it.abs() < 1e-6));
        assert!(went.x.iter().all(|it| (it - 2.0).abs() < 1e-5));
    }

    #[test]
    fn radians_are_not_divided_by_degrees() {
        let turned = moved(motion(0.0, 1.0), &only(0.0, 0.0));
        assert!(turned.heading.iter().all(|it| (it - 1.0).abs() < 1e-5));
        let noisy = moved(motion(0.0, 1.0), &only(0.01, 0.0));
        assert!((spread(&noisy.heading).1 - 0.1).abs() < 0.005);
    }

    #[test]
    fn sideways_flight_of_an_omni_model_turns_no_heading() {
        let config = Config {
            odom_model: OdomModel::Omni,
            alpha5: 0.01,
            ..only(0.04, 0.04)
        };
        let sideways = Motion {
            forward_m: 0.0,
            left_m: 2.0,
            turn_rad: 0.0,
        };
        let went = moved(sideways, &config);
        assert!(spread(&went.heading).1 < 1e-6);
        let ((left, along), (_, lateral)) = (spread(&went.y), spread(&went.x));
        assert!((left - 4.0).abs() < 0.05 && (along - 0.8).abs() < 0.03);
        assert!((lateral - 0.4).abs() < 0.02, "{lateral}");
        let diff = Config {
            odom_model: OdomModel::Diff,
            ..config
        };
        assert!(spread(&moved(sideways, &diff).heading).1 > 0.2);
    }

    #[test]
    fn without_odometry_particles_walk_by_the_root_of_time() {
        let mut particles = Particles::default();
        (0..4_000).for_each(|_| particles.push(0.0, 0.0, 0.0));
        let mut noise = Noise::new(ChaCha8Rng::seed_from_u64(1));
        let moved = Moved::Unknown(Duration::from_secs(4));
        let config = Config {
            walk_m2: 0.25,
            ..Config::default()
        };
        advance(&mut particles, moved, &config, 0.5, &mut noise);
        assert!((spread(&particles.x).1 - 2.0).abs() < 0.08);
    }
}
