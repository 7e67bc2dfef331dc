//! Potential fields, the baseline.

use super::grid::offset_m;
use super::{Avoider, Limits, Situation, Steering};

/// ε of equations 4 and 5: the pull, in m/s per metre to the goal.
const PULL: f64 = 0.5;
/// η of equations 6 and 7: the push of one certain cell. A straight wall of cells 0.5 m away pushes with about the highest
/// speed.
const PUSH: f64 = 0.01;
/// ρ of equations 6 and 7: the distance up to which obstacles push, in metres.
const INFLUENCE_M: f64 = 1.0;
/// Certainty from which a cell is an obstacle: two echoes.
const OBSTACLE: u8 = 6;
/// Distance below which an obstacle pushes no harder, in metres: half a cell. The force has a pole at 0.
const NEAREST_M: f64 = 0.025;

/// Potential fields (Khatib 1986), equations 1 to 7 of the indoor thesis. The force is the velocity, up to the highest
/// speed.
#[derive(Debug, Clone)]
pub struct PotentialFields {
    limits: Limits,
}

impl PotentialFields {
    /// For a drone with these limits. The radius is not used: the drone is a point.
    #[must_use]
    pub const fn new(limits: Limits) -> Self {
        Self { limits }
    }
}

/// Equation 7 for one obstacle, by the drone's offset from it in metres: a vector away from the obstacle.
fn repulsion((x_m, y_m): (f64, f64)) -> (f64, f64) {
    let distance_m = libm::hypot(x_m, y_m).max(NEAREST_M);
    if distance_m > INFLUENCE_M {
        return (0.0, 0.0);
    }
    let size = PUSH * (1.0 / distance_m - 1.0 / INFLUENCE_M) / (distance_m * distance_m);
    (size * x_m / distance_m, size * y_m / distance_m)
}

impl Avoider for PotentialFields {
    fn steer(&mut self, situation: &Situation<'_>) -> Option<Steering> {
        let pull = PULL * situation.goal_m;
        let pull = pull.min(self.limits.speed_max_mps);
        let mut force = (
            pull * libm::cos(situation.goal_rad),
            pull * libm::sin(situation.goal_rad),
        );
        for (index, certainty) in situation.grid.occupied() {
            if certainty >= OBSTACLE {
                let (x_m, y_m) = offset_m(index);
                let push = repulsion((-x_m, -y_m));
                force = (force.0 + push.0, force.1 + push.1);
            }
        }
        Some(Steering {
            course_rad: libm::atan2(force.1, force.0),
            speed_mps: libm::hypot(force.0, force.1).min(self.limits.speed_max_mps),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_push_is_the_gradient_of_equation_6() {
        let potential = |d: f64| PUSH * (1.0 / d - 1.0 / INFLUENCE_M).powi(2);
        for d in [0.1, 0.3, 0.7, 0.99] {
            let (push, across) = repulsion((d, 0.0));
            // Equation 7 leaves out the factor 2 of the derivative of a square; the thesis's own.
            let gradient = (potential(d + 1e-6) - potential(d - 1e-6)) / 2e-6;
            assert!((push + gradient / 2.0).abs() < 1e-4 * push.max(1.0), "{d}");
            assert!(across.abs() < 1e-12);
        }
        assert_eq!(repulsion((1.01, 0.0)), (0.0, 0.0));
    }

    /// A defect of the indoor thesis's code: an angle was passed where the distance belongs.
    #[test]
    fn angles_in_the_place_of_distances_would_push_by_bearing() {
        for distance_m in [0.2_f64, 0.5, 0.9] {
            let size = |bearing_rad: f64| {
                let (sin, cos) = bearing_rad.sin_cos();
                let (x, y) = repulsion((distance_m * cos, distance_m * sin));
                libm::hypot(x, y)
            };
            let ahead = size(0.0);
            for bearing in 1..12 {
                let lateral = size(f64::from(bearing) * 0.5);
                assert!(
                    (lateral - ahead).abs() < 1e-9 * ahead,
                    "{distance_m} {bearing}"
                );
            }
        }
        assert!(repulsion((0.2, 0.0)).0 > 10.0 * repulsion((0.5, 0.0)).0);
    }
}
