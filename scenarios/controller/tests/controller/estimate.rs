//! What a drone's link says of its own estimate.

use std::time::Duration;

use muster_controller::{Config, PoseErrors, Settings, Wind};
use muster_machines::geometry::Ned;
use muster_machines::msp::controller::{Agreement, Receiver};
use muster_machines::msp::{ControllerLink, FlightCommand, Setpoint};

use crate::companion::origin;
use crate::flown::Flown;

const POSES: PoseErrors = PoseErrors {
    sigma_m: 0.05,
    period: Duration::from_millis(100),
    delay: Duration::from_millis(100),
    outliers: 0.0,
};

/// After a hover and a square.
fn flown(pose: Option<PoseErrors>, gusts_mps: f64) -> Flown<ControllerLink> {
    let simulated = |settings: Settings| Config {
        wind: Wind {
            gusts_mps,
            ..Wind::default()
        },
        ..Config::new(origin(), settings)
    };
    let mut flown = Flown::new(Receiver::Sole, 10, pose, simulated, |link| link);
    flown.run(Duration::from_secs(30));
    for (north_m, east_m) in [(20.0, 0.0), (20.0, 20.0), (0.0, 20.0), (0.0, 0.0)] {
        flown.command(FlightCommand::Fly(Setpoint::Leg {
            to: Ned::new(north_m, east_m, -20.0),
            speed_mps: 5.0,
            acceleration_mps2: 2.0,
        }));
        flown.run(Duration::from_secs(10));
    }
    flown
}

fn assert_honest(agreement: Agreement, what: &str) {
    let Agreement { counted, inside } = agreement;
    assert!(counted > 400, "{what}: {agreement:?}");
    assert!(
        inside as f64 >= 0.95 * counted as f64,
        "{what}: {agreement:?}"
    );
}

#[test]
fn differences_from_measurements_are_within_the_bounds_that_the_estimate_states() {
    for gusts_mps in [0.0, 1.0] {
        for pose in [None, Some(POSES)] {
            let innovations = flown(pose, gusts_mps).link.innovations();
            let what = format!("{pose:?}, gusts of {gusts_mps} m/s");
            assert_honest(innovations.position, &format!("{what}, position"));
            assert_honest(innovations.height, &format!("{what}, height"));
            if pose.is_none() {
                assert_honest(innovations.velocity, &format!("{what}, velocity"));
            }
        }
    }
}
