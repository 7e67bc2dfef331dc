//! Both engines give the same trace for a scenario and a seed, under all faults.

use std::time::Duration;

use muster_machines::identity::NodeId;
use muster_machines::node::Address;
use muster_machines::time::Timestamp;
use muster_scenarios::engine::Engine;
use muster_scenarios::report::Report;
use muster_scenarios::scenario::{DroneFault, Fault, FaultKind, Scenario, Target};

use crate::support::{Sweep, fly, scenario};

fn on_both_engines(scenario: &Scenario) -> Report {
    let actors = fly(scenario, Engine::Actors);
    let events = fly(scenario, Engine::Events);
    assert_eq!(actors.trace, events.trace, "the engines disagree");
    assert_eq!(actors.drones, events.drones);
    assert_eq!(
        fly(scenario, Engine::Actors).trace,
        actors.trace,
        "the actors engine is not deterministic"
    );
    actors
}

fn crash(at_s: f64, drone: u32, actor: Address) -> Fault {
    let kind = FaultKind::Drone(Target::Drone(NodeId(drone)), DroneFault::CrashActor(actor));
    Fault::at(Timestamp::from_secs_f64(at_s), kind)
}

fn assert_all_finished(report: &Report) {
    assert_eq!(report.violations, []);
    for drone in &report.drones {
        assert_eq!(drone.state, "finished", "drone {}", drone.id);
        assert_eq!(drone.landed_because, None, "drone {}", drone.id);
    }
}

#[test]
fn both_engines_agree_on_the_shipped_scenarios() {
    let mut sweep = Sweep::default();
    for experiment in sweep.of(1..=5) {
        let name = &format!("thesis-{experiment}.toml");
        assert_all_finished(&on_both_engines(&scenario(name, &[])));
    }
}

#[test]
fn both_engines_agree_on_unicasts() {
    let mut sweep = Sweep::default();
    for name in ["barrier-line.toml", "barrier-mesh.toml", "relay.toml"] {
        for loss in sweep.of(["radio.loss=0", "radio.loss=0.3"]) {
            assert_all_finished(&on_both_engines(&scenario(name, &[loss])));
        }
    }
    let ideal = ["radio.medium=ideal", "radio.loss=0.2"];
    assert_all_finished(&on_both_engines(&scenario("barrier-line.toml", &ideal)));
}

#[test]
fn both_engines_agree_under_frame_loss() {
    let lossy = scenario("thesis-1.toml", &["radio.loss=0.2", "formation.drones=7"]);
    assert_all_finished(&on_both_engines(&lossy));
}

#[test]
fn both_engines_agree_on_a_shared_fading_medium() {
    let radio = [
        "radio.medium=csma",
        "radio.model=nakagami",
        "radio.nakagami_m=3",
    ];
    let shared = scenario("thesis-1.toml", &radio);
    let report = on_both_engines(&shared);
    assert_all_finished(&report);
    let ideal = fly(&scenario("thesis-1.toml", &[]), Engine::Events);
    assert_ne!(report.trace, ideal.trace);
}

#[test]
fn both_engines_agree_on_burst_losses() {
    let bursts = ["radio.burst_every_ms=380", "radio.burst_ms=20"];
    for medium in ["radio.medium=ideal", "radio.medium=csma"] {
        let trace = |fields: &[&str]| {
            let fields = [&[medium], fields].concat();
            fly(&scenario("thesis-1.toml", &fields), Engine::Events).trace
        };
        let bursty = scenario("thesis-1.toml", &[bursts[0], bursts[1], medium]);
        let report = on_both_engines(&bursty);
        assert_all_finished(&report);
        assert_ne!(report.trace, trace(&[]));
        let lossless = [bursts[0], bursts[1], "radio.burst_loss=0"];
        assert_eq!(trace(&lossless), trace(&[]), "a random draw changed");
    }
}

#[test]
fn trace_depends_on_the_seed_only_through_random_draws() {
    let trace =
        |overrides: &[&str]| fly(&scenario("thesis-1.toml", overrides), Engine::Events).trace;
    assert_ne!(trace(&["seed=1"]), trace(&["seed=2"]));
    // A single drone draws only its own phase. Before the take-off order nothing is drawn.
    let nothing_drawn = |seed: &str| {
        let mut scenario = scenario("thesis-1.toml", &[seed, "formation.drones=1"]);
        scenario.plan = scenario.plan.with_duration(Duration::from_nanos(1));
        fly(&scenario, Engine::Events).trace
    };
    assert_eq!(nothing_drawn("seed=1"), nothing_drawn("seed=2"));
}

#[test]
fn mission_completes_after_a_panic_in_any_actor() {
    for actor in Address::ALL {
        for drone in [0, 2] {
            let mut scenario = scenario("thesis-1.toml", &[]);
            scenario.faults = vec![crash(150.3, drone, actor)];
            let report = on_both_engines(&scenario);
            assert_all_finished(&report);
            assert_eq!(report.drones[drone as usize].restarts, 1);
        }
    }
}

#[test]
fn mission_completes_after_panics_in_all_actors_in_any_phase() {
    // On the ground, taking off, in discovery, in hop update, at a waypoint, on a leg, moving to land, landing.
    let mut sweep = Sweep::default();
    for from_s in [0.1, 20.0, 52.0, 59.1, 60.5, 150.0, 391.0, 410.0] {
        for drone in sweep.of([1, 2]) {
            let mut scenario = scenario("thesis-1.toml", &[]);
            scenario.faults = (0..)
                .zip(Address::ALL)
                .map(|(index, actor)| crash(from_s + 0.4 * f64::from(index), drone, actor))
                .collect();
            let report = on_both_engines(&scenario);
            assert_all_finished(&report);
            assert_eq!(report.drones[drone as usize].restarts, 5, "from {from_s} s");
        }
    }
}

#[test]
fn mission_completes_after_simultaneous_panics_in_all_actors() {
    let mut scenario = scenario("thesis-1.toml", &[]);
    scenario.faults = Address::ALL.map(|actor| crash(150.0, 2, actor)).into();
    assert_all_finished(&on_both_engines(&scenario));
}

#[test]
fn drone_over_its_restart_limit_lands_and_the_others_continue() {
    for actor in Address::ALL {
        let mut scenario = scenario("thesis-1.toml", &["limits.msp_restarts_max=5"]);
        scenario.faults = (0..6)
            .map(|index| crash(150.0 + f64::from(index), 0, actor))
            .collect();
        let report = on_both_engines(&scenario);
        assert_eq!(report.violations, [], "{actor}");
        let (given_up, others) = report.drones.split_first().unwrap();
        assert_eq!(given_up.restarts, 5, "{actor}");
        assert!(
            given_up.flight_time_s.unwrap() < 200.0,
            "{actor}: it landed at once"
        );
        for drone in others {
            assert_eq!(drone.state, "finished", "{actor}, drone {}", drone.id);
            assert_eq!(drone.landed_because, None, "{actor}, drone {}", drone.id);
        }
        let waited = report.barriers.iter().map(|it| it.moving_s - it.arrived_s);
        let climb_s = scenario.plan.limits.climb.as_secs_f64();
        assert!(
            waited.fold(0.0, f64::max) < 8.0 + climb_s,
            "{actor}: a barrier waits for a member's time to live, and the climb without it"
        );
    }
}

#[test]
fn drone_over_its_restart_limit_lands_while_another_actor_restarts() {
    for (first, last) in [
        (Address::Msp, Address::Navigation),
        (Address::Routing, Address::Mission),
        (Address::Mission, Address::Navigation),
    ] {
        let mut scenario = scenario("thesis-1.toml", &["limits.msp_restarts_max=5"]);
        // The fifth failure's back-off is 80 ms; the sixth comes within it.
        scenario.faults = (0..5)
            .map(|index| crash(150.0 + f64::from(index), 0, first))
            .chain([crash(154.01, 0, last)])
            .collect();
        let report = on_both_engines(&scenario);
        assert_eq!(report.violations, [], "{first}, {last}");
        assert!(report.mission_completed, "{first}, {last}");
        let waited = report.barriers.iter().map(|it| it.moving_s - it.arrived_s);
        assert!(waited.fold(0.0, f64::max) < 8.0, "{first}, {last}");
    }
}

#[test]
fn member_lost_before_a_routing_restart_does_not_block_barriers() {
    let mut scenario = scenario("thesis-1.toml", &["formation.drones=3"]);
    scenario.faults = (0..6)
        .map(|index| crash(150.0 + 0.3 * f64::from(index), 0, Address::Mission))
        .chain([crash(152.0, 1, Address::Routing)])
        .collect();
    let report = on_both_engines(&scenario);
    assert_eq!(report.violations, []);
    assert!(report.mission_completed);
}

#[test]
fn all_drones_land_if_the_master_is_over_its_restart_limit() {
    for actor in Address::ALL {
        let mut scenario = scenario("thesis-1.toml", &[]);
        scenario.faults = (0..6)
            .map(|index| crash(150.0 + f64::from(index), 2, actor))
            .collect();
        let report = on_both_engines(&scenario);
        assert_eq!(report.violations, [], "{actor}");
        assert!(
            report
                .drones
                .iter()
                .all(|drone| drone.flight_time_s.is_some()),
            "{actor}"
        );
    }
}

#[test]
fn drones_out_of_range_land_without_elections_and_the_master_continues() {
    for liveness in ["protocol.liveness=thesis", "protocol.liveness=heartbeat"] {
        let fields = ["radio.range_m=100", liveness, "protocol.succession=land"];
        let report = on_both_engines(&scenario("thesis-1.toml", &fields));
        assert_eq!(report.violations, []);
        for drone in &report.drones {
            let out_of_range = drone.id != 2;
            assert_eq!(drone.state, "finished");
            assert_eq!(
                drone.landed_because.is_some(),
                out_of_range,
                "drone {}",
                drone.id
            );
        }
        assert_eq!(report.barriers.len(), 8);
    }
}

#[test]
fn half_of_the_frames_lost_break_no_rule() {
    for seed in 0..5 {
        let seed = format!("seed={seed}");
        let lossy = ["radio.loss=0.5", "protocol.liveness=heartbeat", &seed];
        let report = on_both_engines(&scenario("thesis-1.toml", &lossy));
        assert_eq!(report.violations, []);
    }
}

#[test]
fn watcher_is_called_once_per_second_until_the_end() {
    let scenario = scenario("thesis-1.toml", &[]);
    for engine in [Engine::Actors, Engine::Events] {
        let (sender, receiver) = std::sync::mpsc::channel();
        let watcher = Box::new(move |progress| sender.send(progress).unwrap());
        let (report, _) = muster_scenarios::engine::run(&scenario, engine, Some(watcher)).unwrap();
        let updates: Vec<_> = receiver.iter().collect();
        assert!(
            updates
                .windows(2)
                .all(|pair| pair[0].simulated_s < pair[1].simulated_s)
        );
        let last = updates[updates.len() - 1];
        let ended = Duration::from_secs_f64(report.simulated_s).as_secs();
        assert!(ended - last.simulated_s <= 1, "{engine}");
        assert!(last.done >= last.total - 1, "{engine}: {last:?}");
    }
}
