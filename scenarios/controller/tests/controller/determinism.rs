use std::time::Duration;

use muster_controller::{Config, Controller, Settings, Wind};
use muster_machines::time::Timestamp;
use muster_msp::{Attitude, RawGps, RawImu, Version, request};
use nalgebra::Vector3;
use proptest::prelude::*;

use crate::companion::{Companion, Rc, origin};

/// A flight with noise and gusts: everything that was sent to the controller, by time in microseconds.
fn script() -> Vec<(u64, Vec<u8>)> {
    let mut script = Vec::new();
    for tick in 0..450_u64 {
        let at_us = 20_000 * tick;
        let rc = match tick {
            0..280 => Rc::IDLE,
            280..290 => Rc::ARM,
            290..400 => Rc {
                roll: 1_550,
                pitch: 1_460,
                ..Rc::throttle(1_400)
            },
            _ => Rc::throttle(1_250),
        };
        script.push((at_us, bytes_of(rc)));
        let mut ask = Vec::new();
        match tick % 3 {
            0 => request::<Attitude>(Version::V1, &mut ask).unwrap(),
            1 => request::<RawGps>(Version::V2, &mut ask).unwrap(),
            _ => request::<RawImu>(Version::V1, &mut ask).unwrap(),
        }
        script.push((at_us + 7_300, ask));
    }
    script
}

fn bytes_of(rc: Rc) -> Vec<u8> {
    use muster_msp::{SetRawRc, Sticks, order};

    use crate::companion::micros;
    let sticks = Sticks {
        roll: micros(rc.roll),
        pitch: micros(rc.pitch),
        throttle: micros(rc.throttle),
        yaw: micros(rc.yaw),
    };
    let message = SetRawRc::new(sticks, &[micros(rc.aux1), micros(rc.aux2)]).unwrap();
    let mut bytes = Vec::new();
    order(Version::V1, &message, &mut bytes).unwrap();
    bytes
}

/// All bytes that the controller sent, and its last state, when it is looked at at some times, too.
fn fly(seed: u64, looks_us: &[u64]) -> (Vec<u8>, String) {
    let at = |us: u64| Timestamp::from_nanos(1_000 * us);
    let config = Config::new(origin(), Settings::sole());
    let mut controller = Controller::new(config, seed, Timestamp::ZERO);
    let wind = Wind {
        mean_mps: Vector3::new(2.0, -1.0, 0.0),
        gusts_mps: 1.0,
    };
    controller.wind(Timestamp::ZERO, wind);
    let mut looks = looks_us.iter().copied().peekable();
    let mut sent = Vec::new();
    for (at_us, bytes) in script() {
        while let Some(look_us) = looks.next_if(|look_us| *look_us < at_us) {
            controller.advance(at(look_us));
            sent.extend(controller.transmit(at(look_us)));
        }
        sent.extend(controller.transmit(at(at_us)));
        controller.receive(at(at_us), &bytes);
    }
    let end = at(9_100_000);
    sent.extend(controller.transmit(end));
    let truth = format!("{:?}", controller.aircraft(end));
    (sent, truth)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn looking_changes_no_bit(mut looks_us in proptest::collection::vec(0_u64..9_000_000, 0..400)) {
        looks_us.sort_unstable();
        prop_assert_eq!(fly(1, &looks_us), fly(1, &[]));
    }

    #[test]
    fn any_bytes_are_survived(chunks in proptest::collection::vec(proptest::collection::vec(any::<u8>(), 0..60), 0..60)) {
        let mut companion = Companion::new(Config::new(origin(), Settings::sole()));
        for chunk in chunks {
            companion.send(&chunk);
            companion.run_ms(15);
        }
        prop_assert!(!companion.truth().is_armed);
    }
}

#[test]
fn seeds_differ() {
    assert_ne!(fly(1, &[]).0, fly(2, &[]).0);
}

#[test]
fn flight_was_one() {
    let (_, truth) = fly(1, &[]);
    assert!(truth.contains("is_armed: true"), "{truth}");
    assert!(truth.contains("Airborne"), "{truth}");
}

#[test]
fn rest_of_a_year_costs_no_time_and_uses_the_batterys_charge() {
    let mut config = Config::new(origin(), Settings::sole());
    config.airframe.battery.electronics_a = 1e-4;
    let mut controller = Controller::new(config, 1, Timestamp::ZERO);
    let year = Timestamp::ZERO + Duration::from_secs(365 * 86_400);
    let in_steps = controller.aircraft(year);
    assert!((in_steps.charge - (1.0 - 0.1 * 8_760.0 / 1_800.0)).abs() < 1e-6);
}
