//! Gains from a hover test, beside the default ones: hover and square of aircraft that are not the one the defaults are for.

#![allow(clippy::print_stdout, reason = "figures are printed on demand")]

use muster_experiments::tuning::tune;
use muster_machines::geometry::Ned;
use muster_machines::mission::State;
use muster_machines::msp::controller::Gains;
use muster_scenarios::engine::{Engine, run};
use muster_scenarios::scenario::Scenario;

use crate::support::scenario;

const SEEDS: u64 = 2;
/// Height of the hover, in metres.
const HOVER_M: f64 = 2.0;
/// Side of the square, in metres.
const SIDE_M: f64 = 10.0;
/// What counts as equal, in metres: a fifth of the position's error.
const EQUAL_M: f64 = 0.01;

/// Where an aircraft was in states that fit, ten times a second, north, east and up in metres. `None` if it did not complete
/// its mission.
fn flown(scenario: &Scenario, gains: Gains, fits: impl Fn(State) -> bool) -> Option<Vec<[f64; 3]>> {
    let mut scenario = scenario.clone();
    scenario.plan = scenario.plan.with_gains(gains);
    let (report, flight) = run(&scenario, Engine::Events, None).unwrap();
    assert_eq!(report.violations, []);
    if !report.mission_completed {
        return None;
    }
    let drone = &flight.drones[0];
    let within = drone
        .track
        .iter()
        .filter(|(at, _)| fits(drone.state_at(*at)));
    let axes = |place: Ned| [place.north_m(), place.east_m(), place.altitude_m()];
    Some(within.map(|(_, place)| axes(*place)).collect())
}

fn rms(errors: impl Iterator<Item = f64>) -> f64 {
    let (count, sum) = errors.fold((0.0, 0.0), |(count, sum), it| (count + 1.0, sum + it * it));
    f64::sqrt(sum / count)
}

/// Horizontal and vertical RMS of a hover.
fn hover(scenario: &Scenario, gains: Gains) -> Option<[f64; 2]> {
    let held = State::WaypointReached { waypoint: 0 };
    let places = flown(scenario, gains, |state| state == held)?;
    assert!(places.len() > 500, "{}", places.len());
    Some([
        rms(places.iter().map(|[north, east, _]| north.hypot(*east))),
        rms(places.iter().map(|[_, _, up]| up - HOVER_M)),
    ])
}

/// RMS of the distance from the nearest side of a square, and how far it flies beyond the corners.
fn square(scenario: &Scenario, gains: Gains) -> Option<[f64; 2]> {
    let legs = |state| matches!(state, State::MovingToWaypoint { .. });
    let places = flown(scenario, gains, legs)?;
    let beyond = |at: f64| f64::max(-at, at - SIDE_M);
    let off = |[north, east, _]: &[f64; 3]| {
        let outside = beyond(*north).max(beyond(*east));
        let sides = [*north, SIDE_M - north, *east, SIDE_M - east].map(f64::abs);
        outside.max(sides.into_iter().fold(f64::INFINITY, f64::min))
    };
    let most = |[north, east, _]: &[f64; 3]| beyond(*north).max(beyond(*east));
    Some([
        rms(places.iter().map(off)),
        places.iter().map(most).fold(0.0, f64::max),
    ])
}

/// The means of four figures over some seeds, with the default gains and with tuned ones; infinite if a mission was not
/// completed.
fn means(aircraft: &[&str]) -> [[f64; 4]; 2] {
    let mut sums = [[0.0; 4]; 2];
    for seed in 1..=SEEDS {
        let seed = format!("seed={seed}");
        let overrides = [&[seed.as_str()], aircraft].concat();
        let [hovers, squares] = ["hover", "square"]
            .map(|it| scenario(&format!("hardware/betaflight-{it}.toml"), &overrides));
        let tuned = tune(&hovers).unwrap();
        println!("{aircraft:?}, {seed}: {:?}", tuned.response);
        for (sums, gains) in sums.iter_mut().zip([hovers.plan.gains, tuned.gains]) {
            let incomplete = [f64::INFINITY; 2];
            let flown = [hover(&hovers, gains), square(&squares, gains)];
            let figures = flown.map(|it| it.unwrap_or(incomplete)).concat();
            for (sum, figure) in sums.iter_mut().zip(figures) {
                *sum += figure / SEEDS as f64;
            }
        }
    }
    sums
}

#[test]
fn tuned_gains_fly_other_aircraft_at_least_as_well() {
    for aircraft in [
        &["aircraft.payload_kg=0.1"][..],
        &["aircraft.battery_wear=0.5"],
    ] {
        let [default, tuned] = means(aircraft);
        println!("{aircraft:?}: hover RMS level, vertical; square RMS, overshoot, in m");
        println!("  default {default:.3?}\n  tuned   {tuned:.3?}");
        for (default_m, tuned_m) in default.into_iter().zip(tuned) {
            assert!(tuned_m.is_finite(), "{aircraft:?}");
            assert!(tuned_m <= default_m + EQUAL_M, "{aircraft:?}");
        }
    }
}

#[test]
fn aircraft_too_heavy_for_the_default_gains_flies_with_tuned_ones() {
    let heavy = scenario(
        "hardware/betaflight-hover.toml",
        &["aircraft.payload_kg=0.5"],
    );
    let (report, _) = run(&heavy, Engine::Events, None).unwrap();
    assert!(!report.mission_completed);
    let tuned = tune(&heavy).unwrap();
    println!("{:?}\n{:?}", tuned.response, tuned.gains);
    let [level_m, vertical_m] = hover(&heavy, tuned.gains).unwrap();
    assert!(
        level_m < 0.15 && vertical_m < 0.15,
        "{level_m}, {vertical_m}"
    );
}

#[test]
fn hover_test_with_gps_measures_the_response_too() {
    let tuned = tune(&scenario("flight-controllers.toml", &[])).unwrap();
    println!("{:?}\n{:?}", tuned.response, tuned.gains);
    assert!((tuned.gains.hover_throttle - 0.3).abs() < 0.03);
}
