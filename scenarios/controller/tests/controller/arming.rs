use muster_controller::{Contact, Settings};
use muster_msp::{Motor, ReceivedMotors, SetMotor, Version, order};

use crate::companion::{Companion, Rc, exact};

fn companion() -> Companion {
    Companion::ready(exact(Settings::sole()))
}

#[test]
fn nothing_refuses_arming_with_throttle_low_and_switch_off() {
    assert_eq!(companion().refusals(), [""; 0]);
}

#[test]
fn arming_is_refused_for_five_seconds_after_the_start() {
    let mut companion = Companion::new(exact(Settings::sole()));
    companion.rc = Some(Rc::IDLE);
    companion.run_ms(1_000);
    assert_eq!(companion.refusals(), ["BOOTGRACE", "CALIB"]);
    companion.run_ms(3_800);
    assert_eq!(companion.refusals(), ["BOOTGRACE"]);
    companion.run_ms(300);
    assert_eq!(companion.refusals(), [""; 0]);
}

#[test]
fn arming_is_refused_without_rc() {
    let mut companion = Companion::new(exact(Settings::sole()));
    companion.run_ms(6_000);
    assert_eq!(companion.refusals(), ["RXLOSS"]);
}

#[test]
fn arming_is_refused_until_rc_has_come_for_half_a_second() {
    let mut companion = Companion::new(exact(Settings::sole()));
    companion.run_ms(6_000);
    companion.rc = Some(Rc::IDLE);
    companion.run_ms(400);
    assert_eq!(companion.refusals(), ["RXLOSS"]);
    companion.run_ms(200);
    assert_eq!(companion.refusals(), [""; 0]);
}

#[test]
fn arming_is_refused_with_the_throttle_open() {
    let mut companion = companion();
    companion.rc = Some(Rc {
        throttle: 1_050,
        ..Rc::IDLE
    });
    companion.run_ms(100);
    assert_eq!(companion.refusals(), ["THROTTLE"]);
    companion.rc = Some(Rc::throttle(1_060));
    companion.run_ms(100);
    assert_eq!(companion.refusals(), ["THROTTLE", "ARM_SWITCH"]);
    assert!(!companion.truth().is_armed);
    companion.rc = Some(Rc {
        throttle: 1_049,
        ..Rc::IDLE
    });
    companion.run_ms(100);
    assert_eq!(companion.refusals(), [""; 0]);
}

#[test]
fn arm_switch_must_be_seen_low_after_a_refusal() {
    let mut companion = companion();
    companion.rc = Some(Rc::throttle(1_200));
    companion.run_ms(100);
    companion.rc = Some(Rc::ARM);
    companion.run_ms(2_000);
    assert_eq!(companion.refusals(), ["ARM_SWITCH"]);
    assert!(!companion.truth().is_armed);
    companion.rc = Some(Rc::IDLE);
    companion.run_ms(100);
    companion.rc = Some(Rc::ARM);
    companion.run_ms(100);
    assert!(companion.truth().is_armed);
}

#[test]
fn arm_switch_must_be_low_when_the_first_frame_comes() {
    let mut companion = Companion::new(exact(Settings::sole()));
    companion.rc = Some(Rc::ARM);
    companion.run_ms(7_000);
    assert_eq!(companion.refusals(), ["NOT_DISARMED", "ARM_SWITCH"]);
    assert!(!companion.truth().is_armed);
    companion.rc = Some(Rc::IDLE);
    companion.run_ms(100);
    assert_eq!(companion.refusals(), [""; 0]);
}

#[test]
fn arming_is_refused_on_a_slope() {
    // A wreck lies as it fell: armed, rolled over on the ground.
    let mut companion = Companion::armed(exact(Settings::sole()));
    companion.rc = Some(Rc::throttle(1_500));
    companion.run_ms(1_000);
    companion.rc = Some(Rc {
        aux2: 1_000,
        roll: 2_000,
        ..Rc::throttle(1_300)
    });
    companion.run_until(5_000, |it| it.truth().contact == Contact::Wreck);
    companion.rc = Some(Rc::IDLE);
    companion.run_ms(500);
    assert_eq!(companion.refusals(), ["ANGLE"]);
}

#[test]
fn switching_arm_off_disarms_after_four_frames() {
    let mut companion = Companion::armed(exact(Settings::sole()));
    companion.rc = Some(Rc::IDLE);
    let took_ms = companion.run_until(200, |it| !it.truth().is_armed);
    assert!((60..=90).contains(&took_ms), "{took_ms}");
}

#[test]
fn motors_turn_by_set_motor_while_disarmed_until_stopped() {
    let mut companion = companion();
    let mut bytes = Vec::new();
    let mut turning = SetMotor::STOP;
    turning.outputs[2] = muster_msp::MotorOutput::new(1_100).unwrap();
    order(Version::V1, &turning, &mut bytes).unwrap();
    companion.send(&bytes);
    companion.run_ms(60_000);
    assert_eq!(
        companion.ask::<Motor>().outputs_us[..4],
        [1_000, 1_000, 1_100, 1_000]
    );
    let [rear_right, _, rear_left, _] = companion.truth().rotors_rad_s;
    assert!(rear_right <= 0.0 && rear_left > 100.0);
    bytes.clear();
    order(Version::V1, &SetMotor::STOP, &mut bytes).unwrap();
    companion.send(&bytes);
    companion.run_ms(1_000);
    assert!(companion.truth().rotors_rad_s.iter().all(|it| *it <= 0.0));
}

#[test]
fn set_motor_while_armed_has_its_effect_at_disarming() {
    let mut companion = Companion::armed(exact(Settings::sole()));
    let before = companion.ask::<Motor>().outputs_us;
    let mut bytes = Vec::new();
    let slow = SetMotor {
        outputs: [muster_msp::MotorOutput::new(1_100).unwrap(); 8],
    };
    order(Version::V1, &slow, &mut bytes).unwrap();
    companion.send(&bytes);
    assert!(
        companion
            .answer(<ReceivedMotors as muster_msp::Message>::COMMAND)
            .is_some()
    );
    assert_eq!(companion.ask::<Motor>().outputs_us, before);
    companion.rc = Some(Rc::IDLE);
    companion.run_ms(1_000);
    assert_eq!(companion.ask::<Motor>().outputs_us[..4], [1_100; 4]);
}
