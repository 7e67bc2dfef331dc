//! Settling time of vehicles at the end of a leg.

use std::time::Duration;

use muster_machines::identity::NodeId;
use muster_machines::mission::State;
use muster_machines::node::Address;
use muster_machines::time::Timestamp;
use muster_scenarios::engine::{Engine, run};
use muster_scenarios::report::FlightOfDrone;
use muster_scenarios::scenario::{DroneFault, Fault, FaultKind, Scenario, Target};

use crate::support::{fly, scenario};

fn settling(settle_ms: u32, overrides: &[&str]) -> Scenario {
    let settle = format!("vehicle.settle_ms={settle_ms}");
    let overrides: Vec<_> = overrides.iter().copied().chain([&*settle]).collect();
    scenario("thesis-1.toml", &overrides)
}

/// Duration of each stay in states of one kind.
fn durations(drone: &FlightOfDrone, of: fn(State) -> bool) -> Vec<Duration> {
    let pairs = drone.states.windows(2).filter(|pair| of(pair[0].1));
    pairs.map(|pair| pair[1].0 - pair[0].0).collect()
}

#[test]
fn legs_take_up_to_the_settling_time_longer_and_landings_do_not() {
    let settle_ms = 2_000;
    let drones = |settle_ms| {
        let (_, flight) = run(&settling(settle_ms, &[]), Engine::Events, None).unwrap();
        flight.drones
    };
    for (at_once, settling) in drones(0).iter().zip(drones(settle_ms)) {
        let is_leg = |state| matches!(state, State::MovingToWaypoint { .. });
        let legs = durations(at_once, is_leg)
            .into_iter()
            .zip(durations(&settling, is_leg));
        let mut longer: Vec<_> = legs.map(|(shorter, longer)| longer - shorter).collect();
        assert_eq!(longer.len(), 7);
        let most = Duration::from_millis(settle_ms.into());
        assert!(longer.iter().all(|time| *time <= most), "{longer:?}");
        longer.sort_unstable();
        longer.dedup();
        assert_eq!(
            longer.len(),
            7,
            "each leg draws its own settling time: {longer:?}"
        );

        let is_landing = |state| state == State::Landing;
        assert_eq!(
            durations(at_once, is_landing),
            durations(&settling, is_landing)
        );
    }
}

#[test]
fn both_engines_draw_the_same_settling_times() {
    for crash in [None, Some(120)] {
        let mut scenario = settling(5_000, &["radio.loss=0.1"]);
        scenario.faults = crash
            .into_iter()
            .map(|at_s| {
                let drone = Target::Drone(NodeId(1));
                let kind = FaultKind::Drone(drone, DroneFault::CrashActor(Address::Navigation));
                Fault::at(Timestamp::from_secs_f64(f64::from(at_s)), kind)
            })
            .collect();
        let events = fly(&scenario, Engine::Events);
        assert_eq!(fly(&scenario, Engine::Actors).trace, events.trace);
        assert_ne!(fly(&settling(0, &[]), Engine::Events).trace, events.trace);
    }
}

#[test]
fn time_limits_include_the_longest_settling_time() {
    let settle = Duration::from_secs(60);
    // All drones stay in range of each other, even if one is late.
    let near = "formation.spacing_m=50";
    let at_once = settling(0, &[near]).plan.limits;
    let longer = settling(60_000, &[near]).plan.limits;
    // Leg: twice three legs to a slot. Take-off: twice its three legs. Duration: twice these and the seven legs of the
    // mission, and two limits of a leg.
    assert_eq!(longer.leg, at_once.leg + 6 * settle);
    assert_eq!(longer.take_off, at_once.take_off + 6 * settle);
    assert_eq!(longer.duration, at_once.duration + (6 + 20 + 12) * settle);
    for seed in 1..=5 {
        let scenario = settling(60_000, &[near, &format!("seed={seed}")]);
        let report = fly(&scenario, Engine::Events);
        assert_eq!(report.violations, []);
        assert!(report.mission_completed);
        for drone in &report.drones {
            assert_eq!(drone.landed_because, None, "drone {}", drone.id);
        }
    }
}
