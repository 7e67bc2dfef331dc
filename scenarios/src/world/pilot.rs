//! A pilot beside a drone whose flight controller has a pilot's receiver.

use std::time::Duration;

use muster_controller::{CHANNELS, Contact, GRAVITY_MPS2, Truth};
use muster_machines::time::Timestamp;
use nalgebra::Vector3;

/// Time for which a switch stays before it is moved again.
const PATIENCE: Duration = Duration::from_secs(1);
/// Time on the ground after which an armed aircraft is disarmed: Betaflight's `auto_disarm_delay`.
const STANDS_FOR: Duration = Duration::from_secs(5);
/// Acceleration against a velocity, in 1/s.
const BRAKE_PER_S: f64 = 0.8;
/// Its limit, in m/s²: a tilt of 15°.
const BRAKE_MAX_MPS2: f64 = 2.6;
/// Descent rate, in m/s.
const DESCENT_MPS: f64 = 1.5;
/// Descent rate near the ground, in m/s.
const FINAL_MPS: f64 = 0.7;
/// Height below which the descent is slow, in metres.
const FINAL_M: f64 = 4.0;
/// Throttle at which the simulated aircraft hovers with a full battery, in µs.
const HOVER_US: f64 = 1_305.0;
/// Throttle per error of the climb, in µs per m/s.
const CLIMB_US: f64 = 80.0;
/// Tilt at full stick in the mode ANGLE, in radians: Betaflight's `angle_limit`.
const ANGLE_LIMIT_RAD: f64 = 1.047;

/// What a pilot does.
///
/// Arms when the drone is to take off, and leaves the sticks to it by the switch of MSP OVERRIDE. The sticks always say what
/// brings the aircraft down, for when they count: after taking over, or without a companion. Disarms on the ground.
///
/// Invariant: an aircraft that was armed once is not armed again.
#[derive(Debug, Default)]
pub struct Pilot {
    /// The drone is to take off.
    pub is_to_take_off: bool,
    arm: Switch,
    has_armed: bool,
    has_taken_over: bool,
    stands_since: Option<Timestamp>,
    /// Sticks and switches as they are.
    pub channels: [u16; CHANNELS],
}

/// A switch, and since when it is there.
#[derive(Debug, Default, Clone, Copy)]
struct Switch {
    is_high: bool,
    since: Timestamp,
}

impl Pilot {
    /// The pilot takes the sticks, for good.
    pub const fn take_over(&mut self) {
        self.has_taken_over = true;
    }

    /// Sticks and switches in µs, if they move: roll, pitch, yaw, throttle, AUX1 (ARM), AUX2 (ANGLE), AUX3 (MSP OVERRIDE).
    pub fn moves(&mut self, now: Timestamp, truth: &Truth) -> Option<[u16; CHANNELS]> {
        self.move_arm_switch(now, truth);
        let mut channels = [1_500; CHANNELS];
        channels[..4].copy_from_slice(&sticks(truth));
        let switch = |is_high: bool| if is_high { 2_000 } else { 1_000 };
        channels[4] = switch(self.arm.is_high);
        channels[5] = switch(true);
        channels[6] = switch(!self.has_taken_over);
        let before = std::mem::replace(&mut self.channels, channels);
        (before != channels).then_some(channels)
    }

    fn move_arm_switch(&mut self, now: Timestamp, truth: &Truth) {
        self.has_armed |= truth.is_armed;
        match truth.contact {
            Contact::Airborne => self.stands_since = None,
            Contact::Ground | Contact::Wreck => _ = self.stands_since.get_or_insert(now),
        }
        let Switch { is_high, since } = self.arm;
        let stands = |since: Timestamp| now.since(since) >= STANDS_FOR;
        let moves = if is_high {
            // Nothing came of it, or it has come down.
            let is_refused = !truth.is_armed && now.since(since) >= PATIENCE;
            is_refused || stands(since) && self.stands_since.is_some_and(stands)
        } else {
            let may_arm = !self.has_armed && !self.has_taken_over;
            may_arm && self.is_to_take_off && now.since(since) >= PATIENCE
        };
        if moves {
            self.arm = Switch {
                is_high: !is_high,
                since: now,
            };
        }
    }
}

/// Roll, pitch, yaw and throttle that bring an aircraft to rest and down.
fn sticks(truth: &Truth) -> [u16; 4] {
    if truth.contact != Contact::Airborne {
        return [1_500, 1_500, 1_500, 1_000];
    }
    let velocity = truth.velocity.0;
    let forward = (truth.attitude * Vector3::x()).xy().normalize();
    let brake = (-velocity.xy() * BRAKE_PER_S).cap_magnitude(BRAKE_MAX_MPS2);
    let ahead = brake.dot(&forward);
    let right = brake.y * forward.x - brake.x * forward.y;
    // The tangent of so small an angle is the angle.
    let stick = |mps2: f64| micros(1_500.0 + 500.0 * mps2 / GRAVITY_MPS2 / ANGLE_LIMIT_RAD);
    let descent_mps = if truth.position.altitude_m() > FINAL_M {
        DESCENT_MPS
    } else {
        FINAL_MPS
    };
    let throttle = HOVER_US + CLIMB_US * (velocity.z - descent_mps);
    [
        stick(right),
        stick(ahead),
        1_500,
        micros(throttle.clamp(1_100.0, 1_600.0)),
    ]
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the values are from 1,000 to 2,000"
)]
fn micros(us: f64) -> u16 {
    us.clamp(1_000.0, 2_000.0) as u16
}
