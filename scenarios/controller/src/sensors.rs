//! What the firmware measures apart from rates: attitude, height, position. Each error is a function of the step, so that
//! nothing needs to run between two looks.

use muster_machines::geometry::Ned;
use nalgebra::Vector3;

use crate::body::Body;
use crate::noise::{Drift, Noise};

/// Errors of the sensors: standard deviations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorNoise {
    /// Rate after the gyro's filters, in rad/s.
    pub rate_rad_s: f64,
    /// Acceleration while airborne, in m/s².
    pub acceleration_mps2: f64,
    /// Roll and pitch as the firmware estimates them, in radians; drifts within 10 s.
    pub tilt_rad: f64,
    /// Heading as the firmware estimates it, in radians; drifts within 10 s.
    pub heading_rad: f64,
    /// Barometric altitude, in metres, from look to look.
    pub barometer_m: f64,
    /// Barometric altitude, in metres; drifts within a minute.
    pub barometer_drift_m: f64,
    /// GPS position north and east, in metres; drifts within half a minute.
    pub gps_m: f64,
    /// GPS altitude, in metres; drifts within half a minute.
    pub gps_altitude_m: f64,
    /// GPS velocity, in m/s, from fix to fix.
    pub gps_mps: f64,
    /// Rangefinder, in metres.
    pub rangefinder_m: f64,
}

impl Default for SensorNoise {
    /// Rate: 0.1 °/s, what 0.0028 °/s/√Hz (ICM-42688-P, data sheet) and vibration leave within 100 Hz. GPS: 1.5 m CEP and
    /// 0.05 m/s (u-blox M10, data sheet), altitude twice the position. Rangefinder: 1 cm (HC-SR04, data sheet 3 mm). Assumed:
    /// vibration of 0.5 m/s², 0.3° of tilt, 2° of heading (with a compass), 0.1 m and 0.4 m of barometer.
    fn default() -> Self {
        Self {
            rate_rad_s: 1.7e-3,
            acceleration_mps2: 0.5,
            tilt_rad: 5.2e-3,
            heading_rad: 3.5e-2,
            barometer_m: 0.1,
            barometer_drift_m: 0.4,
            gps_m: 1.3,
            gps_altitude_m: 2.6,
            gps_mps: 0.05,
            rangefinder_m: 0.01,
        }
    }
}

impl SensorNoise {
    /// Sensors without errors.
    pub const NONE: Self = Self {
        rate_rad_s: 0.0,
        acceleration_mps2: 0.0,
        tilt_rad: 0.0,
        heading_rad: 0.0,
        barometer_m: 0.0,
        barometer_drift_m: 0.0,
        gps_m: 0.0,
        gps_altitude_m: 0.0,
        gps_mps: 0.0,
        rangefinder_m: 0.0,
    };
}

/// Range of the rangefinder, in metres (HC-SR04).
const RANGE_M: std::ops::RangeInclusive<f64> = 0.02..=4.0;

/// Tilt beyond which a rangefinder's echo is lost: cosine of 25° (Betaflight, `rangefinder.c`).
const RANGEFINDER_COS_MIN: f64 = 0.906;

/// Field of the Earth in Valencia, north and down, in gauss (World Magnetic Model 2025, rounded).
const FIELD_GAUSS: [f64; 2] = [0.27, 0.37];

/// Sensors that the firmware reads for itself and for its answers.
#[derive(Debug, Clone)]
pub(crate) struct Sensors {
    noise: SensorNoise,
    rates: Noise<3>,
    acceleration: Noise<3>,
    attitude: Drift<3>,
    barometer: Noise<1>,
    barometer_drift: Drift<1>,
    rangefinder: Noise<1>,
    pub(crate) gps: Gps,
    /// Vibration: what a fault adds to the error of the rates, in rad/s.
    pub(crate) shake_rad_s: f64,
}

impl Sensors {
    pub(crate) fn new(noise: SensorNoise, seed: u64, place: Vector3<f64>) -> Self {
        Self {
            noise,
            rates: Noise::new(seed, 1),
            acceleration: Noise::new(seed, 2),
            attitude: Drift::new(seed, 3, 10_000),
            barometer: Noise::new(seed, 4),
            barometer_drift: Drift::new(seed, 5, 60_000),
            rangefinder: Noise::new(seed, 6),
            gps: Gps::new(noise, seed, place),
            shake_rad_s: 0.0,
        }
    }

    /// Rates about the body's axes, in rad/s.
    #[inline]
    pub(crate) fn rates(&mut self, step: u64, body: &Body) -> Vector3<f64> {
        body.rates + Vector3::from(self.rates.at(step)) * (self.noise.rate_rad_s + self.shake_rad_s)
    }

    /// Roll to the right, pitch nose up and heading, in radians.
    pub(crate) fn angles_rad(&mut self, step: u64, body: &Body) -> [f64; 3] {
        let [roll, pitch, heading] = body.angles_rad();
        let [roll_error, pitch_error, heading_error] = self.attitude.at(step);
        [
            roll + roll_error * self.noise.tilt_rad,
            pitch + pitch_error * self.noise.tilt_rad,
            heading + heading_error * self.noise.heading_rad,
        ]
    }

    /// Acceleration along the body's axes, in m/s².
    pub(crate) fn acceleration(&mut self, step: u64, body: &Body) -> Vector3<f64> {
        let shaken = Vector3::from(self.acceleration.at(step));
        body.specific_force + shaken * self.noise.acceleration_mps2
    }

    /// Magnetic field along the body's axes, in gauss.
    pub(crate) fn field(body: &Body) -> Vector3<f64> {
        let [north, down] = FIELD_GAUSS;
        body.attitude
            .inverse_transform_vector(&Vector3::new(north, 0.0, down))
    }

    /// Altitude by pressure above a place at altitude 0 of the world's frame, in metres.
    pub(crate) fn barometer_m(&mut self, step: u64, body: &Body) -> f64 {
        let [error] = self.barometer.at(step);
        let [drift] = self.barometer_drift.at(step);
        -body.position.z + error * self.noise.barometer_m + drift * self.noise.barometer_drift_m
    }

    /// Height above ground corrected for tilt, in metres; `None` out of range.
    pub(crate) fn rangefinder_m(&mut self, step: u64, body: &Body, height_m: f64) -> Option<f64> {
        let cosine = libm::cos(body.tilt_rad());
        let [error] = self.rangefinder.at(step);
        let range_m = height_m / cosine + error * self.noise.rangefinder_m;
        let is_heard = cosine > RANGEFINDER_COS_MIN && RANGE_M.contains(&range_m);
        is_heard.then_some(range_m * cosine)
    }
}

/// Steps between two fixes: 10 Hz.
const FIX_STEPS: u64 = 100;

/// A position by GPS.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Fix {
    /// In the world's frame.
    pub(crate) place: Ned,
    /// In m/s north, east and down.
    pub(crate) velocity: Vector3<f64>,
}

/// A GPS receiver: fixes at 10 Hz, each 100 ms old when it is reported.
#[derive(Debug, Clone)]
pub(crate) struct Gps {
    noise: SensorNoise,
    position_error: Drift<3>,
    velocity_error: Noise<3>,
    /// The last fix that was taken, by number.
    taken: (u64, Vector3<f64>, Vector3<f64>),
    reported: Fix,
    /// Fault: no satellites.
    pub(crate) is_lost: bool,
}

impl Gps {
    fn new(noise: SensorNoise, seed: u64, place: Vector3<f64>) -> Self {
        Self {
            noise,
            position_error: Drift::new(seed, 7, 30_000 / FIX_STEPS),
            velocity_error: Noise::new(seed, 8),
            taken: (0, place, Vector3::zeros()),
            reported: Fix {
                place: Ned(place),
                velocity: Vector3::zeros(),
            },
            is_lost: false,
        }
    }

    /// Takes a fix when one is due. Between calls that are more than a fix apart, the aircraft has been at rest.
    pub(crate) fn look(&mut self, step: u64, body: &Body) {
        let number = step / FIX_STEPS;
        let now = (number, body.position, body.velocity);
        if number == self.taken.0 {
            return;
        }
        let (_, place, velocity) = if number == self.taken.0 + 1 {
            self.taken
        } else {
            now
        };
        self.taken = now;
        let [north, east, down] = self.position_error.at(number);
        let error = Vector3::new(
            north * self.noise.gps_m,
            east * self.noise.gps_m,
            down * self.noise.gps_altitude_m,
        );
        let slip = Vector3::from(self.velocity_error.at(number)) * self.noise.gps_mps;
        self.reported = Fix {
            place: Ned(place + error),
            velocity: velocity + slip,
        };
    }

    /// The newest fix; `None` without satellites.
    pub(crate) fn fix(&self) -> Option<Fix> {
        (!self.is_lost).then_some(self.reported)
    }

    /// Number of the newest fix.
    pub(crate) fn number(&self) -> u64 {
        self.taken.0
    }
}
