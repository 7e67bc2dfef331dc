//! Rigid body: position, velocity, attitude and rates, and how forces change them.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::airframe::{Airframe, GRAVITY_MPS2};

/// Rotors in Betaflight's order: rear right, front right, rear left, front left (its mixer `QUADX`).
///
/// For each: forward or rear (±1), right or left (±1), and the sign of the torque about the axis down. The propellers of the
/// first and the last turn clockwise as seen from above; torque is opposite to the turn.
pub(crate) const ROTORS: [[f64; 3]; 4] = [
    [-1.0, 1.0, -1.0],
    [1.0, 1.0, 1.0],
    [-1.0, -1.0, 1.0],
    [1.0, -1.0, -1.0],
];

/// Motion of the aircraft. World frame: metres north, east, down; body frame: forward, right, down.
#[derive(Debug, Clone)]
pub(crate) struct Body {
    pub(crate) position: Vector3<f64>,
    pub(crate) velocity: Vector3<f64>,
    /// Turns body vectors into world vectors.
    pub(crate) attitude: UnitQuaternion<f64>,
    /// In rad/s about the body's axes.
    pub(crate) rates: Vector3<f64>,
    /// What an accelerometer measures, in m/s² along the body's axes.
    pub(crate) specific_force: Vector3<f64>,
}

impl Body {
    /// Level and at rest on the ground.
    pub(crate) fn at_rest(position: Vector3<f64>, heading_rad: f64) -> Self {
        Self {
            position,
            velocity: Vector3::zeros(),
            attitude: level(heading_rad),
            rates: Vector3::zeros(),
            specific_force: Vector3::new(0.0, 0.0, -GRAVITY_MPS2),
        }
    }

    /// Moves on by `step_s` seconds under thrust, drag and gravity. `reaction_nm` is the torque about the axis down of rotors
    /// that change their speed.
    ///
    /// Acceleration is constant in a step, so position is exact for it; rates take a step of the explicit Euler method.
    #[inline]
    pub(crate) fn integrate(
        &mut self,
        airframe: &Airframe,
        speeds_rad_s: &[f64; 4],
        reaction_nm: f64,
        wind: Vector3<f64>,
        step_s: f64,
    ) {
        let thrusts_n = speeds_rad_s.map(|speed| airframe.motor.thrust_n(speed));
        let through_air = self
            .attitude
            .inverse_transform_vector(&(self.velocity - wind));
        let mut force_n = drag(airframe, speeds_rad_s.iter().sum(), through_air);
        force_n.z -= thrusts_n.iter().sum::<f64>();
        self.specific_force = force_n / airframe.mass_kg;
        let mut acceleration = self.attitude.transform_vector(&self.specific_force);
        acceleration.z += GRAVITY_MPS2;

        self.position += self.velocity * step_s + acceleration * (0.5 * step_s * step_s);
        self.velocity += acceleration * step_s;

        let inertia = airframe.inertia_kgm2;
        let momentum = inertia.component_mul(&self.rates);
        let mut torque = torque_nm(airframe, &thrusts_n) - self.rates.cross(&momentum);
        torque.z += reaction_nm;
        self.rates += torque.component_div(&inertia) * step_s;
        let half = self.rates * (0.5 * step_s);
        let turn = UnitQuaternion::new_normalize(Quaternion::from_parts(1.0, half));
        self.attitude = UnitQuaternion::new_normalize((self.attitude * turn).into_inner());
    }

    /// Angle between the body's axis down and the world's, in radians.
    pub(crate) fn tilt_rad(&self) -> f64 {
        let down = self.attitude.transform_vector(&Vector3::z());
        libm::acos(down.z.clamp(-1.0, 1.0))
    }

    /// Roll to the right, pitch nose up and heading clockwise from north, in radians.
    pub(crate) fn angles_rad(&self) -> [f64; 3] {
        let q = self.attitude.quaternion();
        let (w, x, y, z) = (q.w, q.i, q.j, q.k);
        [
            libm::atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
            libm::asin((2.0 * (w * y - z * x)).clamp(-1.0, 1.0)),
            libm::atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
        ]
    }
}

/// The attitude that is level with a heading.
pub(crate) fn level(heading_rad: f64) -> UnitQuaternion<f64> {
    let half = 0.5 * heading_rad;
    UnitQuaternion::new_unchecked(Quaternion::new(libm::cos(half), 0.0, 0.0, libm::sin(half)))
}

#[inline]
fn drag(airframe: &Airframe, all_speeds_rad_s: f64, through_air: Vector3<f64>) -> Vector3<f64> {
    let of_rotors = airframe.rotor_drag.component_mul(&through_air);
    let of_frame = airframe
        .frame_drag
        .component_mul(&through_air)
        .component_mul(&through_air.abs());
    -(of_rotors * all_speeds_rad_s + of_frame)
}

#[inline]
fn torque_nm(airframe: &Airframe, thrusts_n: &[f64; 4]) -> Vector3<f64> {
    let mut torque = Vector3::zeros();
    for ([forward, right, turn], thrust) in ROTORS.iter().zip(thrusts_n) {
        torque.x -= right * airframe.rotor_right_m * thrust;
        torque.y += forward * airframe.rotor_forward_m * thrust;
        torque.z += turn * airframe.motor.torque_ratio_m * thrust;
    }
    torque
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_S: f64 = 1e-3;

    fn flown(steps: u32, mut body: Body, speeds: [f64; 4]) -> Body {
        for _ in 0..steps {
            body.integrate(
                &Airframe::agilicious(),
                &speeds,
                0.0,
                Vector3::zeros(),
                STEP_S,
            );
        }
        body
    }

    fn high() -> Body {
        Body::at_rest(Vector3::new(0.0, 0.0, -100.0), 0.0)
    }

    #[test]
    fn free_fall_follows_gravity_less_drag() {
        let airframe = Airframe {
            frame_drag: Vector3::zeros(),
            ..Airframe::agilicious()
        };
        let mut body = high();
        for _ in 0..2_000 {
            body.integrate(&airframe, &[0.0; 4], 0.0, Vector3::zeros(), STEP_S);
        }
        assert!((body.position.z - (-100.0 + 2.0 * GRAVITY_MPS2)).abs() < 1e-9);

        // v = v∞ tanh(g t / v∞), v∞ = √(m g / c).
        let terminal = (0.752 * GRAVITY_MPS2 / 1e-2).sqrt();
        let expected = terminal * (GRAVITY_MPS2 * 2.0 / terminal).tanh();
        let speed = flown(2_000, high(), [0.0; 4]).velocity.z;
        assert!((speed - expected).abs() < 0.01, "{speed} {expected}");
    }

    #[test]
    fn thrust_of_hover_speed_carries_the_weight() {
        let speed = Airframe::agilicious().hover_speed_rad_s();
        let body = flown(10_000, high(), [speed; 4]);
        assert!(body.velocity.norm() < 1e-9);
        assert!(body.rates.norm() < 1e-9);
    }

    #[test]
    fn rotors_turn_the_body_as_their_places_say() {
        let more = |rotor: usize| {
            let mut speeds = [1_000.0; 4];
            speeds[rotor] += 10.0;
            flown(1, high(), speeds).rates
        };
        let [rear_right, front_right, rear_left, front_left] = [0, 1, 2, 3].map(more);
        // Roll to the right is positive, pitch nose up, yaw clockwise.
        assert!(rear_right.x < 0.0 && rear_right.y < 0.0 && rear_right.z < 0.0);
        assert!(front_right.x < 0.0 && front_right.y > 0.0 && front_right.z > 0.0);
        assert!(rear_left.x > 0.0 && rear_left.y < 0.0 && rear_left.z > 0.0);
        assert!(front_left.x > 0.0 && front_left.y > 0.0 && front_left.z < 0.0);
    }

    #[test]
    fn angles_are_those_the_body_was_turned_by() {
        let mut body = high();
        body.attitude = UnitQuaternion::from_euler_angles(0.1, -0.2, 2.5);
        let [roll, pitch, heading] = body.angles_rad();
        assert!((roll - 0.1).abs() < 1e-12 && (pitch + 0.2).abs() < 1e-12);
        assert!((heading - 2.5).abs() < 1e-12);
        assert!((body.tilt_rad() - libm::acos(libm::cos(0.1) * libm::cos(0.2))).abs() < 1e-9);
    }

    #[test]
    fn step_of_a_millisecond_errs_by_millimetres() {
        // A second of turning about all axes under changing thrust, by steps of a millisecond and of a hundredth of it.
        let flown = |steps: u32| {
            let mut body = high();
            let step_s = 1.0 / f64::from(steps);
            for step in 0..steps {
                let phase = 20.0 * f64::from(step) * step_s;
                let more = 30.0 * libm::sin(phase);
                let speeds = [1_090.0 + more, 1_090.0, 1_085.0 - more, 1_095.0];
                body.integrate(
                    &Airframe::agilicious(),
                    &speeds,
                    0.0,
                    Vector3::zeros(),
                    step_s,
                );
            }
            body
        };
        let (coarse, fine) = (flown(1_000), flown(100_000));
        assert!(fine.rates.norm() > 0.2, "it turns: {}", fine.rates);
        let error_m = (coarse.position - fine.position).norm();
        assert!(error_m < 0.005, "{error_m} m");
        let error_rad = coarse.attitude.angle_to(&fine.attitude);
        assert!(error_rad < 0.005, "{error_rad} rad");
    }

    #[test]
    fn turning_without_torque_keeps_the_momentum() {
        let airframe = Airframe::agilicious();
        let mut body = high();
        body.rates = Vector3::new(5.0, 1.0, -2.0);
        let momentum = |body: &Body| {
            body.attitude
                .transform_vector(&airframe.inertia_kgm2.component_mul(&body.rates))
        };
        let before = momentum(&body);
        let after = momentum(&flown(1_000, body, [0.0; 4]));
        assert!((before - after).norm() < 0.01 * before.norm());
    }

    #[test]
    fn wind_carries_the_body_along() {
        let airframe = Airframe::agilicious();
        let mut body = high();
        let wind = Vector3::new(0.0, 4.0, 0.0);
        for _ in 0..30_000 {
            body.integrate(
                &airframe,
                &[airframe.hover_speed_rad_s(); 4],
                0.0,
                wind,
                STEP_S,
            );
        }
        assert!((body.velocity - wind).norm() < 0.05, "{}", body.velocity);
    }
}
