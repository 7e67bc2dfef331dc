//! An aircraft whose motors another firmware drives: Betaflight's software in the loop.
//!
//! Its packets, little-endian, over UDP. To the firmware, 18 `f64`: a constant time, or the firmware's clock follows our
//! jitter; rates about the body's axes in rad/s; specific force along them in m/s²; attitude as a quaternion w x y z from the
//! body's frame to north-east-down; velocity east, north and up in m/s; longitude and latitude in degrees and altitude in
//! metres; pressure in pascals. From it, four `f32` from 0 to 1: front right, rear left, front left, rear right. Measured with
//! Betaflight 4.6 (`tests/betaflight/physics.py`).

use muster_machines::time::Timestamp;
use nalgebra::UnitQuaternion;

use crate::aircraft::Aircraft;
use crate::controller::{Config, STEP_NANOS, Truth};
use crate::sensors::Sensors;
use crate::wind::Gusts;

/// Length of a packet to the firmware, in bytes.
pub const STATE_BYTES: usize = 18 * 8;
/// Length of a packet from the firmware, in bytes.
pub const MOTORS_BYTES: usize = 4 * 4;
/// Place of each rotor of ours in the firmware's packet: rear right, front right, rear left, front left.
const PLACES: [usize; 4] = [3, 0, 1, 2];
/// The constant time of packets, in seconds.
const TIME_S: f64 = 1.0;
/// Length of a degree of latitude, in metres. The firmware's own map is as coarse.
const METRES_PER_DEGREE: f64 = 111_320.0;

/// An aircraft with sensors and without a firmware.
///
/// As a [`Controller`](crate::Controller) it moves in steps of a millisecond when it is told the time.
#[derive(Debug)]
pub struct InLoop {
    config: Config,
    start: Timestamp,
    next_step: u64,
    aircraft: Aircraft,
    sensors: Sensors,
    duties: [f64; 4],
}

impl InLoop {
    /// An aircraft on the ground whose motors are off. The settings of `config` are not used: the firmware has its own.
    #[must_use]
    pub fn new(config: Config, seed: u64, now: Timestamp) -> Self {
        let place = config.place.0;
        Self {
            aircraft: Aircraft::new(&config, Gusts::new(seed, 0)),
            sensors: Sensors::new(config.noise, seed, place),
            config,
            start: now,
            next_step: 0,
            duties: [0.0; 4],
        }
    }

    /// Takes in a packet of the firmware. One of another length, or with a value that is no number, changes nothing.
    pub fn receive(&mut self, now: Timestamp, packet: &[u8]) {
        self.advance(now);
        let Ok(packet) = <[u8; MOTORS_BYTES]>::try_from(packet) else {
            return;
        };
        let (values, _) = packet.as_chunks::<4>();
        let duties = PLACES.map(|place| f64::from(f32::from_le_bytes(values[place])));
        if duties.iter().all(|duty| duty.is_finite()) {
            self.duties = duties.map(|duty| duty.clamp(0.0, 1.0));
        }
    }

    /// A packet for the firmware.
    #[must_use]
    pub fn transmit(&mut self, now: Timestamp) -> [u8; STATE_BYTES] {
        self.advance(now);
        let step = self.next_step;
        let body = &self.aircraft.body;
        let rates = self.sensors.rates(step, body);
        let force = self.sensors.acceleration(step, body);
        // The firmware takes it for its own estimate, which is as wrong as that of the simulated controller.
        let [roll, pitch, heading] = self.sensors.angles_rad(step, body);
        let attitude = UnitQuaternion::from_euler_angles(roll, pitch, heading);
        let altitude_m = self.sensors.barometer_m(step, body);
        let origin = self.config.origin;
        let parallel = libm::cos(origin.latitude_deg().to_radians());
        let values = [
            TIME_S,
            rates.x,
            rates.y,
            rates.z,
            force.x,
            force.y,
            force.z,
            attitude.w,
            attitude.i,
            attitude.j,
            attitude.k,
            body.velocity.y,
            body.velocity.x,
            -body.velocity.z,
            origin.longitude_deg() + body.position.y / METRES_PER_DEGREE / parallel,
            origin.latitude_deg() + body.position.x / METRES_PER_DEGREE,
            altitude_m,
            pressure_pa(altitude_m),
        ];
        let mut packet = [0; STATE_BYTES];
        let (places, _) = packet.as_chunks_mut::<8>();
        for (place, value) in places.iter_mut().zip(values) {
            *place = value.to_le_bytes();
        }
        packet
    }

    /// The truth about the aircraft. It counts as armed while the firmware turns a motor; its failsafe can't be seen.
    #[must_use]
    pub fn aircraft(&mut self, now: Timestamp) -> Truth {
        self.advance(now);
        let is_armed = self.duties.iter().any(|duty| *duty > 0.0);
        Truth::of(&self.aircraft, is_armed, false)
    }

    fn advance(&mut self, now: Timestamp) {
        let passed = u64::try_from(now.since(self.start).as_nanos()).unwrap_or(u64::MAX);
        while self.next_step <= passed / STEP_NANOS {
            self.aircraft.step(self.next_step, &self.duties);
            self.next_step += 1;
        }
    }
}

/// Pressure at an altitude above a place with 1,013.25 hPa (ISO 2533).
fn pressure_pa(altitude_m: f64) -> f64 {
    101_325.0 * libm::pow(1.0 - 2.255_77e-5 * altitude_m, 5.255_88)
}

#[cfg(test)]
mod tests {
    use muster_machines::geodetic::Geodetic;

    use super::*;
    use crate::firmware::settings::Settings;

    fn at(milliseconds: u64) -> Timestamp {
        Timestamp::from_nanos(milliseconds * 1_000_000)
    }

    fn aircraft() -> InLoop {
        let origin = Geodetic::new(39.48, -0.34, 20.0).unwrap();
        let config = Config {
            noise: crate::SensorNoise::NONE,
            ..Config::new(origin, Settings::fit())
        };
        InLoop::new(config, 1, at(0))
    }

    fn motors(front_right: f32, rear_left: f32, front_left: f32, rear_right: f32) -> Vec<u8> {
        let all = [front_right, rear_left, front_left, rear_right];
        all.iter().flat_map(|it| it.to_le_bytes()).collect()
    }

    fn value(packet: &[u8; STATE_BYTES], index: usize) -> f64 {
        f64::from_le_bytes(packet.as_chunks::<8>().0[index])
    }

    #[test]
    fn aircraft_at_rest_says_so() {
        let packet = aircraft().transmit(at(10));
        assert!((value(&packet, 6) + 9.806_65).abs() < 1e-9);
        assert!((value(&packet, 7) - 1.0).abs() < 1e-9);
        assert!((value(&packet, 17) - 101_325.0).abs() < 1e-6);
    }

    #[test]
    fn more_thrust_on_the_left_rolls_it_to_the_right() {
        let mut flown = aircraft();
        flown.receive(at(0), &motors(0.5, 0.55, 0.55, 0.5));
        let packet = flown.transmit(at(400));
        assert!(value(&packet, 1) > 0.1, "roll rate {}", value(&packet, 1));
        assert!(flown.aircraft(at(400)).position.altitude_m() > 0.1);
    }

    #[test]
    fn a_bad_packet_changes_nothing() {
        let mut flown = aircraft();
        flown.receive(at(0), &motors(f32::NAN, 1.0, 1.0, 1.0));
        flown.receive(at(0), &[0; 3]);
        let truth = flown.aircraft(at(500));
        assert!(!truth.is_armed && truth.position.altitude_m().abs() < 1e-9);
    }
}
