//! What policy `tree` costs, on the line of thesis 2 over the shared 802.11a medium, frames at their real length.

use muster_scenarios::engine::Engine;

use crate::support::{fly, scenario};

/// Means over some seeds: from all arrived to all moving in milliseconds, frames a waypoint, messages received a drone.
fn cost(loss: &str) -> (f64, f64, f64) {
    let (mut waits_ms, mut frames, mut received) = (Vec::new(), Vec::new(), Vec::new());
    for seed in 0..10 {
        let seed = format!("seed={seed}");
        let loss = format!("radio.loss={loss}");
        let fields = [
            "protocol.policy=tree",
            "protocol.liveness=pulse",
            "radio.medium=csma",
            "radio.jitter_us=0",
            &loss,
            &seed,
        ];
        let report = fly(&scenario("thesis-2.toml", &fields), Engine::Events);
        assert_eq!(report.violations, []);
        assert!(
            report
                .drones
                .iter()
                .all(|drone| drone.landed_because.is_none())
        );
        for barrier in &report.barriers {
            waits_ms.push((barrier.moving_s - barrier.arrived_s) * 1_000.0);
            frames.push(f64::from(u32::try_from(barrier.transmissions).unwrap()));
        }
        received.push(report.means.messages_received);
    }
    let mean = |values: &[f64]| {
        values.iter().sum::<f64>() / f64::from(u32::try_from(values.len()).unwrap())
    };
    (mean(&waits_ms), mean(&frames), mean(&received))
}

#[test]
fn a_waypoint_costs_little_more_than_the_least_possible_whatever_is_lost() {
    // A barrier on a line of 15 takes 27 frames at least.
    for (loss, wait_ms, frames) in [("0", 40.0, 1.3), ("0.1", 80.0, 1.8), ("0.3", 150.0, 3.0)] {
        let cost = cost(loss);
        assert!(cost.0 <= wait_ms, "{} ms at a loss of {loss}", cost.0);
        assert!(
            cost.1 <= frames * 27.0,
            "{} frames at a loss of {loss}",
            cost.1
        );
    }
}

#[test]
fn a_drone_hears_at_most_a_quarter_of_what_it_hears_under_flood() {
    let (_, _, received) = cost("0");
    let flood = fly(
        &scenario("thesis-2.toml", &["radio.medium=csma"]),
        Engine::Events,
    );
    let share = received / flood.means.messages_received;
    assert!(share <= 0.25, "{share}");
}
