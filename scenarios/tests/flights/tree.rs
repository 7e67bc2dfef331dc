//! Cost of a barrier under policy `tree`, on the shared 802.11a medium with real frame lengths.

use muster_scenarios::engine::Engine;

use crate::support::{fly, rows, scenario, shipped};

/// Minimum number of frames per barrier: fifteen drones in line, and fifteen in range of each other.
const LINE_FRAMES_MIN: f64 = 27.0;
const MESH_FRAMES_MIN: f64 = 15.0;

/// For each frame loss: maximum barrier wait on the line in milliseconds, and maximum multiple of the minimum frames.
const TARGETS: [(&str, f64, f64); 3] = [("0", 40.0, 1.3), ("0.1", 80.0, 1.8), ("0.3", 150.0, 3.0)];

/// Means over the barriers of several seeds.
struct Cost {
    /// Barrier wait, in milliseconds.
    wait_ms: f64,
    /// Frames from the first arrival to the last departure, without keep-alives.
    frames: f64,
    /// Keep-alives in the same time.
    keep_alives: f64,
    /// Retries of the medium in the same time.
    retries: f64,
    /// Messages received per drone in the whole run.
    received: f64,
}

impl Cost {
    /// Cost over seeds 0 to 9; checks that no drone misses a waypoint.
    fn of(name: &str, fields: &[&str]) -> Self {
        let mut barriers = Vec::new();
        let mut received = Vec::new();
        for seed in 0..10 {
            let seed = format!("seed={seed}");
            let fields: Vec<_> = fields.iter().copied().chain([&*seed]).collect();
            let report = fly(&scenario(name, &fields), Engine::Events);
            assert_eq!(report.violations, []);
            assert!(report.mission_completed);
            for drone in &report.drones {
                assert_eq!(drone.landed_because, None, "{fields:?}: drone {}", drone.id);
            }
            barriers.extend(report.barriers);
            received.push(report.means.messages_received);
        }
        let count = |number: u64| f64::from(u32::try_from(number).unwrap());
        let over = |value: &dyn Fn(usize) -> f64| {
            mean(&(0..barriers.len()).map(value).collect::<Vec<_>>())
        };
        Self {
            wait_ms: over(&|at| (barriers[at].moving_s - barriers[at].arrived_s) * 1e3),
            frames: over(&|at| count(barriers[at].transmissions)),
            keep_alives: over(&|at| count(barriers[at].keep_alives)),
            retries: over(&|at| count(barriers[at].retries)),
            received: mean(&received),
        }
    }
}

impl std::fmt::Display for Cost {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{:.1} ms, {:.2} frames, {:.2} keep-alives, {:.2} retries, {:.0} received",
            self.wait_ms, self.frames, self.keep_alives, self.retries, self.received
        )
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / f64::from(u32::try_from(values.len()).unwrap())
}

#[test]
fn barrier_on_the_line_costs_little_more_than_the_minimum() {
    let mut costs = String::new();
    for (loss, wait_ms, frames) in TARGETS {
        let cost = Cost::of("barrier-line.toml", &[&format!("radio.loss={loss}")]);
        assert!(cost.wait_ms <= wait_ms, "loss {loss}: {cost}");
        assert!(
            cost.frames <= frames * LINE_FRAMES_MIN,
            "loss {loss}: {cost}"
        );
        costs.push_str(&format!("loss {loss}: {cost}\n"));
    }
    insta::assert_snapshot!(costs);
}

#[test]
fn barrier_in_a_mesh_costs_little_more_than_one_frame_per_drone() {
    let cost = Cost::of("barrier-mesh.toml", &[]);
    assert!(cost.frames <= 1.3 * MESH_FRAMES_MIN, "{cost}");
    insta::assert_snapshot!(cost);
}

#[test]
fn tree_receives_at_most_a_quarter_of_the_frames_of_flood() {
    let fields = ["radio.medium=csma", "protocol.liveness=heartbeat"];
    let tree = Cost::of(
        "thesis-2.toml",
        &[&fields[..], &["protocol.policy=tree"]].concat(),
    );
    let flood = Cost::of("thesis-2.toml", &fields);
    let share = tree.received / flood.received;
    assert!(share <= 0.25, "{share}");
}

/// Checks the stored figures of 100 seeds. `.ci/run` compares them with a new run.
#[test]
fn documented_figures_meet_their_targets() {
    let column = |file: &str, name: &str| {
        let text = std::fs::read_to_string(shipped("tests/data").join(file)).unwrap();
        let heading = text.lines().next().unwrap();
        let at = heading.split(',').position(|it| it == name).unwrap();
        let values = rows(file).into_iter().map(|row| row[at].clone());
        values.collect::<Vec<_>>()
    };
    let numbers = |file: &str, name: &str| -> Vec<f64> {
        let values = column(file, name).into_iter();
        values.map(|value| value.parse().unwrap()).collect()
    };
    for file in ["barrier-line.csv", "barrier-mesh.csv"] {
        for (name, expected) in [("runs", "100"), ("broken", "0"), ("incomplete", "0")] {
            assert!(
                column(file, name).iter().all(|it| it == expected),
                "{file}: {name}"
            );
        }
    }
    let waits_ms = numbers("barrier-line.csv", "waypoint_wait_mean_ms_median");
    let frames = numbers("barrier-line.csv", "transmissions_per_barrier_median");
    let losses = column("barrier-line.csv", "radio.loss");
    assert_eq!(losses, TARGETS.map(|(loss, ..)| loss));
    for (at, (loss, wait_ms, most)) in TARGETS.into_iter().enumerate() {
        assert!(waits_ms[at] <= wait_ms, "loss {loss}: {} ms", waits_ms[at]);
        assert!(
            frames[at] <= most * LINE_FRAMES_MIN,
            "loss {loss}: {} frames",
            frames[at]
        );
    }
    let frames = numbers("barrier-mesh.csv", "transmissions_per_barrier_median");
    assert!(frames[0] <= 1.3 * MESH_FRAMES_MIN, "{} frames", frames[0]);
}
