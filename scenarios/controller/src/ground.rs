//! Contact with flat ground: the aircraft stands on legs, lands softly or breaks.

use nalgebra::{UnitQuaternion, Vector3};

use crate::airframe::GRAVITY_MPS2;
use crate::body::{Body, level};

/// What the aircraft touches.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Contact {
    /// It flies or falls.
    Airborne,
    /// It stands on its legs.
    Ground,
    /// It has broken. It may still fall; on the ground it stays where it is.
    Wreck,
}

/// What legs and propellers survive. Assumed, for light aircraft on short grass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Landing {
    /// Highest vertical speed at touchdown, in m/s.
    pub descent_max_mps: f64,
    /// Highest horizontal speed on the ground, in m/s; faster, it tips over.
    pub slide_max_mps: f64,
    /// Highest tilt on the ground, in radians; further, propellers hit the ground.
    pub tilt_max_rad: f64,
    /// Friction coefficient.
    pub friction: f64,
    /// Time constant with which legs level the aircraft and end its turning, in seconds.
    pub levelling_s: f64,
}

impl Default for Landing {
    fn default() -> Self {
        Self {
            descent_max_mps: 2.5,
            slide_max_mps: 2.0,
            tilt_max_rad: 0.6,
            friction: 0.6,
            levelling_s: 0.05,
        }
    }
}

/// Tilt and rate below which legs have ended them, in radians and rad/s.
const STILL: f64 = 1e-3;

impl Landing {
    /// Keeps a body that has moved for `step_s` seconds since its velocity was `before` out of the ground at `down_m`.
    pub(crate) fn contact(
        &self,
        body: &mut Body,
        before: Vector3<f64>,
        down_m: f64,
        step_s: f64,
    ) -> Contact {
        if body.position.z < down_m {
            return Contact::Airborne;
        }
        let slide_mps = libm::hypot(body.velocity.x, body.velocity.y);
        let breaks = body.velocity.z > self.descent_max_mps
            || slide_mps > self.slide_max_mps
            || body.tilt_rad() > self.tilt_max_rad;
        body.position.z = down_m;
        if breaks {
            body.stop();
            return Contact::Wreck;
        }
        body.velocity.z = body.velocity.z.min(0.0);
        let braked_mps = self.friction * GRAVITY_MPS2 * step_s;
        let kept = if slide_mps > braked_mps {
            1.0 - braked_mps / slide_mps
        } else {
            0.0
        };
        body.velocity.x *= kept;
        body.velocity.y *= kept;
        self.level(body, step_s);
        let mut felt = (body.velocity - before) / step_s;
        felt.z -= GRAVITY_MPS2;
        body.specific_force = body.attitude.inverse_transform_vector(&felt);
        Contact::Ground
    }

    fn level(&self, body: &mut Body, step_s: f64) {
        let share = (step_s / self.levelling_s).min(1.0);
        let [_, _, heading_rad] = body.angles_rad();
        let goal = level(heading_rad);
        if body.rates.norm() < STILL && body.attitude.angle_to(&goal) < STILL {
            body.attitude = goal;
            body.rates = Vector3::zeros();
        } else {
            // A quaternion and its opposite are one attitude. The way to the farther one is a turn the other way round.
            let is_near = body.attitude.coords.dot(&goal.coords) >= 0.0;
            let goal = if is_near { goal } else { opposite(goal) };
            body.attitude = body.attitude.nlerp(&goal, share);
            body.rates *= 1.0 - share;
        }
    }
}

/// The same attitude as the other quaternion.
fn opposite(attitude: UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::new_unchecked(-attitude.into_inner())
}

impl Body {
    /// Ends all motion.
    pub(crate) fn stop(&mut self) {
        let heading_and_tilt = self.attitude;
        let up = Vector3::new(0.0, 0.0, -GRAVITY_MPS2);
        *self = Self {
            velocity: Vector3::zeros(),
            rates: Vector3::zeros(),
            attitude: heading_and_tilt,
            specific_force: heading_and_tilt.inverse_transform_vector(&up),
            position: self.position,
        };
    }

    /// Whether it has come to rest.
    pub(crate) fn is_still(&self) -> bool {
        self.velocity == Vector3::zeros() && self.rates == Vector3::zeros()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn legs_level_an_aircraft_whichever_way_it_has_turned() {
        for heading_rad in [-3.0, -1.0, 0.5, 2.0, 3.0] {
            let mut body = Body::at_rest(Vector3::zeros(), heading_rad);
            body.attitude *= UnitQuaternion::from_euler_angles(0.1, 0.1, 0.0);
            for attitude in [body.attitude, opposite(body.attitude)] {
                let mut body = Body { attitude, ..body };
                for _ in 0..500 {
                    let before = body.velocity;
                    let contact = Landing::default().contact(&mut body, before, 0.0, 1e-3);
                    assert_eq!(contact, Contact::Ground, "{heading_rad}");
                }
                assert!(body.tilt_rad() < 0.001, "{heading_rad} {}", body.tilt_rad());
            }
        }
    }
}
