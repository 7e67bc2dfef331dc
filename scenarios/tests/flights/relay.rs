//! Pure relays: nodes that forward frames and fly no mission.

use muster_scenarios::engine::Engine;

use crate::support::{fly, scenario};

#[test]
fn relays_connect_drones_out_of_range_of_each_other() {
    for loss in ["0", "0.2"] {
        for seed in 0..5 {
            let fields = [format!("radio.loss={loss}"), format!("seed={seed}")];
            let fields = fields.each_ref().map(String::as_str);
            let report = fly(&scenario("relay.toml", &fields), Engine::Events);
            assert_eq!(report.violations, []);
            assert!(report.mission_completed);
            for drone in &report.drones {
                assert_eq!(drone.state, "finished", "{fields:?}: drone {}", drone.id);
                assert_eq!(drone.landed_because, None, "{fields:?}: drone {}", drone.id);
            }
            assert_eq!(report.drones.len(), 3, "relays are not drones");
            let relays: Vec<_> = report.relays.iter().map(|relay| relay.id).collect();
            assert_eq!(relays, [3, 4, 5]);
            assert!(report.relays.iter().all(|relay| relay.hops.is_some()));
            let bridged = report.bridges.iter().map(|bridge| &bridge.out_of_range);
            assert_eq!(bridged.flatten().count(), 2, "{fields:?}");
        }
    }
}

#[test]
fn drones_out_of_range_stay_on_the_ground_without_relays() {
    let report = fly(&scenario("relay.toml", &["relays=[]"]), Engine::Events);
    assert_eq!(report.violations, []);
    for drone in [0, 2] {
        assert_eq!(report.drones[drone].state, "start");
        assert_eq!(report.drones[drone].flight_time_s, None);
        assert_eq!(report.drones[drone].messages_received, 0);
    }
}

#[test]
fn relay_forwards_again_after_actor_restarts() {
    let faults = r#"faults=[{ at_s = 40, kind = "crash-actor", drone = 3, actor = "routing" }, { at_s = 41, kind = "crash-actor", drone = 4, actor = "radio" }]"#;
    let scenario = scenario("relay.toml", &[faults]);
    let report = fly(&scenario, Engine::Events);
    assert_eq!(report.trace, fly(&scenario, Engine::Actors).trace);
    assert_eq!(report.violations, []);
    assert!(report.drones.iter().all(|drone| drone.state == "finished"));
    let restarts: Vec<_> = report.relays.iter().map(|relay| relay.restarts).collect();
    assert_eq!(restarts, [1, 1, 0]);
}
