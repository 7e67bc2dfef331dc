//! Failsafes: drones that can't continue land safely by themselves, and the others continue.

use muster_machines::geometry::Ned;
use muster_scenarios::engine::{Engine, run};
use muster_scenarios::report::{Flight, Report};
use muster_scenarios::scenario::Scenario;

use crate::support::{Sweep, fly, scenario};

const OVER: Option<&str> = None;
const ALONE: Option<&str> = Some("it had no contact with other drones");
const LOW: Option<&str> = Some("its battery was low");
const CRITICAL: Option<&str> = Some("its battery was critically low");
const LOST: Option<&str> = Some("it lost its position");
const FENCE: Option<&str> = Some("it was about to leave the geofence");

/// Runs a shipped scenario on both engines; checks that they agree and break no rule.
fn flown(name: &str, fields: &[&str]) -> (Report, Flight) {
    let scenario = scenario(name, fields);
    let (report, flight) = run(&scenario, Engine::Events, None).unwrap();
    assert_eq!(report.violations, [], "{name}, {fields:?}");
    let actors = fly(&scenario, Engine::Actors);
    assert_eq!(actors.trace, report.trace, "{name}, {fields:?}");
    (report, flight)
}

/// Landing reason of each drone that finished.
fn reasons(report: &Report) -> Vec<Option<&str>> {
    let landed = report.drones.iter().filter(|it| it.state == "finished");
    landed.map(|it| it.landed_because.as_deref()).collect()
}

#[test]
fn drone_without_contact_lands_or_continues_as_configured() {
    let (report, _) = flown("failsafe-alone.toml", &[]);
    assert_eq!(reasons(&report), [ALONE]);
    assert!(!report.mission_completed);
    let (report, _) = flown("failsafe-alone.toml", &["failsafe.alone=carry-on"]);
    assert_eq!(reasons(&report), [OVER]);
    assert!(report.mission_completed);
}

#[test]
fn drones_with_low_batteries_land_and_a_master_hands_over() {
    let (report, _) = flown("failsafe-battery.toml", &[]);
    assert_eq!(reasons(&report), [LOW, OVER, CRITICAL, OVER]);
    assert!(report.drones[4].state.starts_with("battery empty "));
    assert!(report.mission_completed, "by the other drones");
    let [election] = &report.elections[..] else {
        panic!("one election: {:?}", report.elections);
    };
    assert!(election.settled_after_s.unwrap() < 0.1, "{election:?}");
}

#[test]
fn drone_without_position_climbs_to_its_hold_altitude_and_lands() {
    let (report, flight) = flown("failsafe-gps.toml", &[]);
    assert_eq!(reasons(&report), [OVER, LOST, OVER, OVER, OVER]);
    assert!(report.mission_completed);
    let highest = |drone: usize| {
        let track = flight.drones[drone].track.iter();
        track.map(|(_, at)| at.altitude_m()).fold(0.0, f64::max)
    };
    assert!(highest(1) > highest(0) + 5.0, "it waits above the others");
}

#[test]
fn position_lost_for_less_than_a_second_has_no_effect() {
    let short = r#"faults=[{ at_s = 38, kind = "lose-gps", drone = 3, for_s = 0.9 }]"#;
    let (interrupted, _) = flown("failsafe-gps.toml", &[short]);
    let (undisturbed, _) = flown("failsafe-gps.toml", &["faults=[]"]);
    assert_eq!(reasons(&interrupted), [OVER; 5]);
    assert!((interrupted.simulated_s - undisturbed.simulated_s).abs() < 1e-9);
}

#[test]
fn no_drone_leaves_the_fence_with_a_pilot_flying_outward() {
    let (report, flight) = flown("failsafe-fence.toml", &[]);
    let farthest = |drone: usize| {
        let track = flight.drones[drone].track.iter();
        track
            .map(|(_, at)| Ned::HOME.horizontal_distance_m(*at))
            .fold(0.0, f64::max)
    };
    assert!((0..5).all(|drone| farthest(drone) < 250.0));
    assert_eq!(reasons(&report), [FENCE; 5]);
}

/// Smallest distance of any drone's track from the fence, in metres; negative outside.
fn min_margin_m(scenario: &Scenario, flight: &Flight) -> f64 {
    let fence = scenario.plan.vehicle.failsafe.fence.as_deref().unwrap();
    let tracks = flight.drones.iter().map(|drone| &drone.track);
    let legs = tracks.flat_map(|track| track.windows(2));
    legs.flat_map(|leg| {
        let zones = fence.zones().iter();
        zones.map(|zone| zone.clearance_along_m(leg[0].1, leg[1].1))
    })
    .fold(f64::INFINITY, f64::min)
}

#[test]
fn no_drone_leaves_a_concave_fence_of_a_plan() {
    let (report, flight) = flown("failsafe-plan-fence.toml", &[]);
    let landed = report.drones.iter().map(|it| it.landed_because.as_deref());
    let landed: Vec<_> = landed.collect();
    assert_eq!(landed, [FENCE, FENCE, FENCE, OVER, FENCE]);
    let scenario = scenario("failsafe-plan-fence.toml", &[]);
    let min_m = min_margin_m(&scenario, &flight);
    assert!(min_m > 0.0, "{min_m} m");
    // The circle stops drone 4, and the concave corner of the polygon stops the master.
    let farthest = |drone: usize| {
        let track = flight.drones[drone].track.iter();
        track.map(|(_, at)| at.north_m()).fold(0.0, f64::max)
    };
    assert!(farthest(4) < 110.0, "{}", farthest(4));
    let at_the_corner = 210.0..220.0;
    assert!(at_the_corner.contains(&farthest(2)), "{}", farthest(2));
}

#[test]
fn no_drone_leaves_the_fence_of_a_plan_in_any_direction() {
    for degrees in (0..360_i32).step_by(24) {
        for speed_mps in [4.0, 9.9] {
            let heading = f64::from(degrees).to_radians();
            let (north, east) = (speed_mps * heading.cos(), speed_mps * heading.sin());
            let pilot = format!(
                "follow.pilot=[{{after_s=2,north_mps={north:.3},east_mps={east:.3}}},\
                 {{after_s=30,north_mps={:.3},east_mps={:.3}}}]",
                -east, north
            );
            let fields = [
                &*pilot,
                "formation.heading_deg=30",
                // Only the fence is tested: a stopped drone may come close to others that continue.
                "limits.separation_horizontal_m=0.01",
                "limits.separation_vertical_m=0.01",
            ];
            let scenario = scenario("failsafe-plan-fence.toml", &fields);
            let (report, flight) = run(&scenario, Engine::Events, None).unwrap();
            assert_eq!(report.violations, [], "{fields:?}");
            let min_m = min_margin_m(&scenario, &flight);
            assert!(min_m > 0.0, "{fields:?}: {min_m} m");
        }
    }
}

#[test]
fn fences_of_plan_and_scenario_are_both_in_force() {
    let own = "geofence.radius_m=100";
    let both = scenario("failsafe-plan-fence.toml", &[own]);
    let (report, flight) = run(&both, Engine::Events, None).unwrap();
    assert_eq!(report.violations, []);
    let min_m = min_margin_m(&both, &flight);
    assert!(min_m > 0.0, "{min_m} m");
    let zones = both
        .plan
        .vehicle
        .failsafe
        .fence
        .as_ref()
        .unwrap()
        .zones()
        .len();
    assert_eq!(zones, 3);
    assert!(reasons(&report).contains(&FENCE));
}

#[test]
fn hung_process_starts_no_election_when_it_resumes() {
    let mut sweep = Sweep::default();
    for for_s in sweep.of([2.0, 0.5, 5.0]) {
        let fields = [
            "protocol.succession=elect",
            "protocol.parameters=fast",
            "limits.watchdog_ms=60000",
            "mission.file=missions/field.waypoints",
            &*format!(
                "faults=[{{ at_waypoint = 1, after_s = 5, kind = \"hang\", drone = 3, for_s = {for_s} }}]"
            ),
        ];
        let (report, _) = flown("barrier-mesh.toml", &fields);
        assert_eq!(report.elections, [], "{for_s} s");
        assert!(report.mission_completed);
    }
}
