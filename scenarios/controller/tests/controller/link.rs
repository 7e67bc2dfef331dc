//! The drone's link and the simulated controller together, when the controller loses its receiver.

use std::time::Duration;

use muster_controller::{Contact, Settings};
use muster_machines::msp::controller::Receiver;
use muster_machines::msp::{ControllerLink, FlightCommand};

use crate::companion::exact;
use crate::flown::Flown;

/// In flight, with the failsafe's delay in 0.1 s.
fn flown(receiver: Receiver, delay_ds: u8) -> Flown<ControllerLink> {
    Flown::new(receiver, delay_ds, None, exact, |link| link)
}

#[test]
fn lost_receiver_starts_the_failsafe_at_its_delay_and_the_drone_reports_it_within_300_ms() {
    for receiver in [Receiver::Sole, Receiver::Override] {
        for delay_ds in [2, 4, 10] {
            let mut flown = flown(receiver, delay_ds);
            // Wherever between two frames and two questions the loss falls.
            for _ in 0..u64::from(delay_ds) {
                flown.tick();
            }
            flown.lose_receiver();
            let stage_2_ms = flown.run_until("stage 2", |it| it.truth().is_failsafe);
            let delay_ms = u64::from(delay_ds) * 100;
            // No earlier than a frame's period before: the last frame was heard by then.
            assert!(
                (delay_ms - 30..=delay_ms + 100).contains(&stage_2_ms),
                "{receiver:?}, {delay_ms} ms: {stage_2_ms} ms"
            );
            let reported_ms = flown.run_until("the report", |it| it.is_landing());
            assert!(reported_ms <= 300, "{receiver:?}: {reported_ms} ms");
        }
    }
}

/// Betaflight's simulation serves 77 commands a second, of which RC takes 50.
#[test]
fn a_drone_lands_with_a_controller_that_serves_few_commands() {
    for serial_period_ms in [10, 11, 12, 13] {
        let simulated = |settings| {
            exact(Settings {
                serial_period_ms,
                ..settings
            })
        };
        let mut flown = Flown::new(Receiver::Sole, 10, None, simulated, |link| link);
        flown.command(FlightCommand::Land);
        flown.run_until("landed", |it| !it.truth().is_armed);
        assert_eq!(flown.truth().contact, Contact::Ground);
    }
}

#[test]
fn nothing_arms_for_a_minute_after_a_lost_receiver_is_back() {
    for receiver in [Receiver::Sole, Receiver::Override] {
        let mut flown = flown(receiver, 4);
        flown.lose_receiver();
        flown.run_until("down", |it| !it.truth().is_armed);
        assert_eq!(flown.truth().contact, Contact::Ground, "{receiver:?}");
        flown.recover_receiver();
        flown.assert_stays_disarmed();
    }
}

#[test]
fn nothing_arms_for_a_minute_after_a_cut_line_is_back() {
    let mut flown = flown(Receiver::Sole, 4);
    flown.is_connected = false;
    flown.run_until("the report", |it| it.is_landing());
    flown.run_until("down", |it| !it.truth().is_armed);
    assert_eq!(flown.truth().contact, Contact::Ground);
    flown.is_connected = true;
    flown.assert_stays_disarmed();
}

/// The line is back while the failsafe lands the drone: RC would end it in mid-air.
#[test]
fn line_that_is_back_in_the_air_does_not_end_the_failsafe() {
    let mut flown = flown(Receiver::Sole, 4);
    flown.is_connected = false;
    flown.run(Duration::from_secs(3));
    assert!(flown.truth().is_failsafe);
    flown.is_connected = true;
    flown.run_until("down", |it| {
        let truth = it.truth();
        assert!(truth.is_failsafe || !truth.is_armed, "{truth:?}");
        !truth.is_armed
    });
    assert_eq!(flown.truth().contact, Contact::Ground);
    flown.assert_stays_disarmed();
}
