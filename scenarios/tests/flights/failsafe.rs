//! Drones that can't go on come down safely, each by itself, and the others fly on.

use muster_machines::geometry::Ned;
use muster_scenarios::engine::{Engine, run};
use muster_scenarios::report::{Flight, Report};
use muster_scenarios::scenario::Scenario;

use crate::support::{fly, scenario};

const OVER: Option<&str> = None;
const ALONE: Option<&str> = Some("it heard of no other drone");
const LOW: Option<&str> = Some("its battery was low");
const CRITICAL: Option<&str> = Some("its battery was all but empty");
const LOST: Option<&str> = Some("it did not know where it was");
const FENCE: Option<&str> = Some("it was about to leave the geofence");

/// A shipped scenario, flown alike on both engines without breaking a rule.
fn flown(name: &str, fields: &[&str]) -> (Report, Flight) {
    let scenario = scenario(name, fields);
    let (report, flight) = run(&scenario, Engine::Events, None).unwrap();
    assert_eq!(report.violations, [], "{name}, {fields:?}");
    let actors = fly(&scenario, Engine::Actors);
    assert_eq!(actors.trace, report.trace, "{name}, {fields:?}");
    (report, flight)
}

/// Why each drone that ended on the ground by itself came down.
fn reasons(report: &Report) -> Vec<Option<&str>> {
    let landed = report.drones.iter().filter(|it| it.state == "finished");
    landed.map(|it| it.landed_because.as_deref()).collect()
}

#[test]
fn a_drone_that_hears_of_nobody_else_goes_to_land_or_flies_on() {
    let (report, _) = flown("failsafe-alone.toml", &[]);
    assert_eq!(reasons(&report), [ALONE]);
    assert!(!report.mission_completed);
    let (report, _) = flown("failsafe-alone.toml", &["failsafe.alone=carry-on"]);
    assert_eq!(reasons(&report), [OVER]);
    assert!(report.mission_completed);
}

#[test]
fn batteries_take_each_drone_down_by_itself_and_a_master_hands_over() {
    let (report, _) = flown("failsafe-battery.toml", &[]);
    assert_eq!(reasons(&report), [LOW, OVER, CRITICAL, OVER]);
    assert!(
        report.drones[4]
            .state
            .starts_with("its battery empty while")
    );
    assert!(report.mission_completed, "by those who can");
    let [election] = &report.elections[..] else {
        panic!("one election: {:?}", report.elections);
    };
    assert!(election.settled_after_s.unwrap() < 0.1, "{election:?}");
}

#[test]
fn a_lost_position_holds_a_drone_out_of_the_others_way_and_then_brings_it_down() {
    let (report, flight) = flown("failsafe-gps.toml", &[]);
    assert_eq!(reasons(&report), [OVER, LOST, OVER, OVER, OVER]);
    assert!(report.mission_completed);
    let highest = |drone: usize| {
        let track = flight.drones[drone].track.iter();
        track.map(|(_, at)| at.altitude_m()).fold(0.0, f64::max)
    };
    assert!(highest(1) > highest(0) + 5.0, "it holds above the others");
}

#[test]
fn a_second_without_a_position_changes_nothing() {
    let short = r#"faults=[{ at_s = 38, lose_gps = 3, for_s = 0.9 }]"#;
    let (blinked, _) = flown("failsafe-gps.toml", &[short]);
    let (never, _) = flown("failsafe-gps.toml", &["faults=[]"]);
    assert_eq!(reasons(&blinked), [OVER; 5]);
    assert!((blinked.simulated_s - never.simulated_s).abs() < 1e-9);
}

#[test]
fn nobody_leaves_the_fence_whatever_the_pilot_does() {
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

/// The least that any drone was within its fence, on all straight ways between the places of its track, in metres.
fn least_room_m(scenario: &Scenario, flight: &Flight) -> f64 {
    let fence = scenario.plan.vehicle.failsafe.fence.as_deref().unwrap();
    let tracks = flight.drones.iter().map(|drone| &drone.track);
    let legs = tracks.flat_map(|track| track.windows(2));
    legs.flat_map(|leg| {
        let zones = fence.zones().iter();
        zones.map(|zone| zone.room_along_m(leg[0].1, leg[1].1))
    })
    .fold(f64::INFINITY, f64::min)
}

#[test]
fn nobody_leaves_the_fence_of_a_plan_though_it_is_bent_inwards() {
    let (report, flight) = flown("failsafe-plan-fence.toml", &[]);
    let landed = report.drones.iter().map(|it| it.landed_because.as_deref());
    let landed: Vec<_> = landed.collect();
    assert_eq!(landed, [FENCE, FENCE, FENCE, OVER, FENCE]);
    let scenario = scenario("failsafe-plan-fence.toml", &[]);
    let least_m = least_room_m(&scenario, &flight);
    assert!(least_m > 0.0, "{least_m} m");
    // The circle stops one, the bend of the polygon the master; beside it there is room as far north again.
    let farthest = |drone: usize| {
        let track = flight.drones[drone].track.iter();
        track.map(|(_, at)| at.north_m()).fold(0.0, f64::max)
    };
    assert!(farthest(4) < 110.0, "{}", farthest(4));
    let at_the_bend = 210.0..220.0;
    assert!(at_the_bend.contains(&farthest(2)), "{}", farthest(2));
}

#[test]
fn nobody_leaves_the_fence_of_a_plan_wherever_the_pilot_flies() {
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
                // Only the fence is looked at: who is stopped amid a swarm that flies on may come near another.
                "limits.separation_horizontal_m=0.01",
                "limits.separation_vertical_m=0.01",
            ];
            let scenario = scenario("failsafe-plan-fence.toml", &fields);
            let (report, flight) = run(&scenario, Engine::Events, None).unwrap();
            assert_eq!(report.violations, [], "{fields:?}");
            let least_m = least_room_m(&scenario, &flight);
            assert!(least_m > 0.0, "{fields:?}: {least_m} m");
        }
    }
}

#[test]
fn the_fences_of_a_plan_and_of_its_scenario_are_both_in_force() {
    let own = "geofence.radius_m=100";
    let both = scenario("failsafe-plan-fence.toml", &[own]);
    let (report, flight) = run(&both, Engine::Events, None).unwrap();
    assert_eq!(report.violations, []);
    let least_m = least_room_m(&both, &flight);
    assert!(least_m > 0.0, "{least_m} m");
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
fn whoever_s_process_hung_for_a_while_elects_nobody() {
    for for_s in [0.5, 2.0, 5.0] {
        let fields = [
            "protocol.succession=elect",
            "protocol.parameters=fast",
            "limits.watchdog_ms=60000",
            "mission.file=missions/field.waypoints",
            &*format!("faults=[{{ at_waypoint = 1, after_s = 5, hang = 3, for_s = {for_s} }}]"),
        ];
        let (report, _) = flown("barrier-mesh.toml", &fields);
        assert_eq!(report.elections, [], "{for_s} s");
        assert!(report.mission_completed);
    }
}
