use muster_msp::{Altitude, Attitude};

use super::super::{Estimator, Pose};
use super::*;
use crate::geometry::Ned;
use crate::msp::controller::Config;

const DRAG_PER_S: f64 = 0.45;
/// From one measurement of the module to the next.
const STEP_S: f64 = 0.02;

fn at(seconds: f64) -> Timestamp {
    Timestamp::from_secs_f64(seconds)
}

/// A vehicle, how it moves in truth, and what it believes.
struct Flight {
    seconds: f64,
    position: [f64; 2],
    velocity: [f64; 2],
    height_m: f64,
    estimator: Estimator,
    poses: bool,
    /// What the module says of the ground's quality.
    quality: u8,
    /// What stands beneath it, in metres.
    obstacle_m: f64,
    /// What its own barometer is off by, in metres.
    barometer_off_m: f64,
}

impl Flight {
    /// At a height of 2 m, for 3 s with poses.
    fn new(level_floor: bool) -> Self {
        let config = Config {
            flow: Some(FlowModule { level_floor }),
            ..crate::msp::controller::tests::config()
        };
        let mut estimator = Estimator::new(&config, at(0.0), Some(0.0));
        estimator.measure_altitude(at(0.0), &Altitude::default());
        let mut flight = Self {
            seconds: 0.0,
            position: [0.0; 2],
            velocity: [0.0; 2],
            height_m: 2.0,
            estimator,
            poses: true,
            quality: 200,
            obstacle_m: 0.0,
            barometer_off_m: 0.0,
        };
        flight.fly(3.0, |_| [0.0; 3], [0.0; 2]);
        flight.poses = false;
        flight
    }

    /// Flies on. `attitude`: roll, nose down and yaw in radians, by the time. `push_mps2`: what accelerates it beside its tilt.
    fn fly(&mut self, seconds: f64, attitude: impl Fn(f64) -> [f64; 3], push_mps2: [f64; 2]) {
        let steps = (seconds / STEP_S).round() as u32;
        for step in 0..steps {
            let tilt = |seconds| {
                let [roll_rad, nose_down_rad, yaw_rad] = attitude(seconds);
                Tilt {
                    roll_rad,
                    nose_down_rad,
                    yaw_rad,
                }
            };
            let (before, now_s) = (tilt(self.seconds), self.seconds + STEP_S);
            let (tilt, now) = (tilt(now_s), at(now_s));
            for (axis, push_mps2) in push_mps2.into_iter().enumerate() {
                let by_mps2 =
                    before.acceleration_mps2()[axis] + push_mps2 - DRAG_PER_S * self.velocity[axis];
                self.position[axis] += self.velocity[axis] * STEP_S;
                self.velocity[axis] += by_mps2 * STEP_S;
            }
            self.seconds = now_s;
            self.estimator.predict(now);
            self.see(now, before, tilt);
            if step % 4 == 0 {
                let degrees = |angle: f64| angle.to_degrees();
                let attitude = Attitude {
                    roll_ddeg: (degrees(tilt.roll_rad) * 10.0).round() as i16,
                    pitch_ddeg: (degrees(tilt.nose_down_rad) * 10.0).round() as i16,
                    yaw_deg: degrees(tilt.yaw_rad).round() as i16 % 360,
                };
                self.estimator.measure_attitude(now, &attitude);
            }
            if step % 5 == 0 {
                let altitude_cm = (100.0 * (self.height_m + self.barometer_off_m)) as i32;
                let altitude = Altitude {
                    altitude_cm,
                    climb_cmps: 0,
                };
                self.estimator.measure_altitude(now, &altitude);
                if self.poses {
                    let [north_m, east_m] = self.position;
                    let pose = Pose {
                        position: Ned::new(north_m, east_m, -self.height_m),
                        sigma_m: 0.05,
                        age: Duration::ZERO,
                    };
                    self.estimator.measure_pose(now, &pose);
                }
            }
        }
    }

    /// What the module sees while the vehicle turns from one attitude to another.
    fn see(&mut self, now: Timestamp, before: Tilt, tilt: Tilt) {
        let (roll, pitch, yaw) = (tilt.roll_rad, -tilt.nose_down_rad, tilt.yaw_rad);
        let rate = |from: f64, to: f64| (to - from) / STEP_S;
        let (roll_rate, pitch_rate, yaw_rate) = (
            rate(before.roll_rad, roll),
            rate(-before.nose_down_rad, pitch),
            rate(before.yaw_rad, yaw),
        );
        // The rows of the rotation from the local frame into the body's, and the rates of the attitude as the body's.
        let (sin, cos) = (libm::sin, libm::cos);
        let [north, east] = self.velocity;
        let ahead = north * cos(yaw) + east * sin(yaw);
        let right = east * cos(yaw) - north * sin(yaw);
        let body_x = ahead * cos(pitch);
        let body_y = ahead * sin(roll) * sin(pitch) + right * cos(roll);
        let about_x = roll_rate - yaw_rate * sin(pitch);
        let about_y = pitch_rate * cos(roll) + yaw_rate * cos(pitch) * sin(roll);
        let distance_m = (self.height_m - self.obstacle_m) / (cos(roll) * cos(pitch));
        let thousandths = |value: f64| (value * 1_000.0) as i32;
        let range = RangefinderSample {
            quality: self.quality,
            distance_mm: thousandths(distance_m),
        };
        let rates = OpticalFlow {
            quality: self.quality,
            x_mradps: thousandths(about_x - body_y / distance_m),
            y_mradps: thousandths(about_y + body_x / distance_m),
        };
        self.estimator.measure_flow(now, &FlowReading::Range(range));
        self.estimator.measure_flow(now, &FlowReading::Rates(rates));
    }

    /// How far the estimate is from the truth: position in metres, velocity in m/s.
    fn off(&self) -> [f64; 2] {
        let estimate = self.estimator.estimate().unwrap();
        let apart = |it: [f64; 2], other: [f64; 2]| libm::hypot(it[0] - other[0], it[1] - other[1]);
        let position = [estimate.position.north_m(), estimate.position.east_m()];
        let velocity = [estimate.velocity.0.x, estimate.velocity.0.y];
        [
            apart(position, self.position),
            apart(velocity, self.velocity),
        ]
    }

    fn is_lost(&self) -> bool {
        self.estimator.lost_for(at(self.seconds)).is_some()
    }

    fn believed_height_m(&self) -> f64 {
        self.estimator.estimate().unwrap().position.altitude_m()
    }
}

/// It sways and turns round.
fn sways(seconds: f64) -> [f64; 3] {
    let roll = 0.1 * libm::sin(1.7 * seconds);
    [roll, 0.08 * libm::cos(1.3 * seconds), 0.4 * (seconds - 3.0)]
}

#[test]
fn a_vehicle_that_sways_turns_and_is_pushed_by_wind_knows_how_it_moves_without_positions() {
    let mut flight = Flight::new(false);
    for _ in 0..20 {
        flight.fly(0.5, sways, [0.2, -0.1]);
        let [position_m, velocity_mps] = flight.off();
        assert!(
            position_m < 0.3 && velocity_mps < 0.15,
            "{:?}",
            flight.off()
        );
        assert!(!flight.is_lost());
    }
    let speed_mps = libm::hypot(flight.velocity[0], flight.velocity[1]);
    assert!(speed_mps > 0.3, "it moved: {speed_mps} m/s");
}

#[test]
fn the_same_vehicle_drifts_without_optical_flow_and_says_that_it_is_lost() {
    let mut flight = Flight::new(false);
    flight.quality = 0;
    flight.fly(0.9, sways, [0.2, -0.1]);
    assert!(!flight.is_lost(), "for a second");
    flight.fly(9.0, sways, [0.2, -0.1]);
    assert!(flight.is_lost() && flight.off()[0] > 1.0);
    // What is lost is not found by velocities.
    flight.quality = 200;
    flight.fly(3.0, sways, [0.2, -0.1]);
    assert!(flight.is_lost() && flight.off()[1] < 0.15);
}

#[test]
fn a_position_is_known_by_optical_flow_until_it_may_be_a_metre_off() {
    let level = |_| [0.0; 3];
    let mut hovers = Flight::new(false);
    hovers.fly(60.0, level, [0.0; 2]);
    assert!(!hovers.is_lost() && hovers.off()[0] < 0.3);
    hovers.fly(240.0, level, [0.0; 2]);
    assert!(hovers.is_lost());
    // A wind of 2 m/s carries it: after 10 m the scale may be wrong by a metre.
    let mut flies = Flight::new(false);
    flies.fly(4.0, level, [0.9, 0.0]);
    assert!(!flies.is_lost());
    flies.fly(6.0, level, [0.9, 0.0]);
    assert!(flies.is_lost() && flies.off()[1] < 0.15);
}

#[test]
fn poses_that_come_back_are_taken_in() {
    let mut flight = Flight::new(false);
    flight.fly(10.0, sways, [0.2, -0.1]);
    flight.poses = true;
    flight.fly(1.0, sways, [0.2, -0.1]);
    assert!(flight.off()[0] < 0.1, "{:?}", flight.off());
}

#[test]
fn the_range_tells_the_height_above_a_level_floor_only() {
    let level = |_| [0.0; 3];
    for (level_floor, expected_m) in [(true, 2.0), (false, 3.0)] {
        let mut flight = Flight::new(level_floor);
        for centimetres in 0..100 {
            flight.barometer_off_m = f64::from(centimetres) / 100.0;
            flight.fly(0.2, level, [0.0; 2]);
        }
        let height_m = flight.believed_height_m();
        assert!((height_m - expected_m).abs() < 0.1, "{height_m}");
    }
}

#[test]
fn what_stands_on_the_floor_is_not_taken_for_it() {
    let level = |_| [0.0; 3];
    let mut flight = Flight::new(true);
    flight.fly(2.0, level, [0.0; 2]);
    flight.obstacle_m = 0.7;
    flight.fly(5.0, level, [0.0; 2]);
    assert!((flight.believed_height_m() - 2.0).abs() < 0.1);
    flight.obstacle_m = 0.0;
    flight.fly(5.0, level, [0.0; 2]);
    assert!((flight.believed_height_m() - 2.0).abs() < 0.05);
}
