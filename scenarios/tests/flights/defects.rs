//! The ancestor's nine defects: with a defect planted, the test of a shipped scenario fails.

use std::panic::catch_unwind;

use muster_machines::flaw::{Flaw, plant};
use muster_scenarios::engine::Engine;

use crate::support::{fly, scenario};
use crate::{election, faults, shipped};

/// Checks that the test fails with the planted flaw, and that its message contains all of `expected`.
fn assert_found(flaw: Flaw, test: fn(), expected: &[&str]) {
    let _planted = plant(flaw);
    let Err(panic) = catch_unwind(test) else {
        panic!("{flaw:?} is not detected");
    };
    let message = panic.downcast_ref::<String>().map_or("", String::as_str);
    let is_complete = expected.iter().all(|it| message.contains(it));
    assert!(
        is_complete,
        "{flaw:?} is detected with another message: {message}"
    );
}

/// `tests/processes` checks that the same symbol is not in the `musterd` that it runs.
#[test]
fn binary_with_planted_flaws_contains_the_marker_symbol() {
    let own = std::env::current_exe().unwrap();
    let mut search = std::process::Command::new("grep");
    let found = search.args(["-qaF", "4flaw7planted"]).arg(own).status();
    assert!(found.unwrap().success());
}

#[test]
fn defect_1_hung_master_is_not_replaced() {
    assert_found(
        Flaw::IgnoresFailedActors,
        shipped::master_with_a_hung_mission_actor_recovers,
        &[
            "hung-mission",
            "rule: 1",
            "follows drone 3, which is not in its segment",
        ],
    );
    // Without a watchdog, no election starts.
    let unwatched = scenario("hung-mission.toml", &["limits.hang_ms=3600000"]);
    let report = fly(&unwatched, Engine::Events);
    let broken: Vec<_> = report.violations.iter().map(|it| it.rule).collect();
    assert_eq!((broken, report.elections), (vec![5], vec![]));
}

#[test]
fn defect_2_master_does_not_wait_for_a_returned_drone() {
    assert_found(
        Flaw::IgnoresReturnedMembers,
        shipped::master_waits_for_a_returned_drone,
        &["returning-drone", "rule: 3, ", "drones: [6]"],
    );
}

#[test]
fn defect_3_two_masters_that_meet_both_stay_master() {
    for (flaw, expected) in [
        (
            Flaw::NeverStepsDown,
            ["cut-in-two", "rule: 1", "of term 2 and drone 3"],
        ),
        (
            Flaw::FollowsAnyBallot,
            ["cut-two-apart", "rule: 1", "which is not better"],
        ),
    ] {
        let test = shipped::segments_merge_and_all_drones_fly_every_waypoint;
        assert_found(flaw, test, &expected);
    }
}

#[test]
fn defect_4_orders_of_another_swarm_are_accepted() {
    for (flaw, test, scenario) in [
        (
            Flaw::AcceptsOtherSwarms,
            shipped::two_passing_swarms_each_follow_their_own_master as fn(),
            "two-swarms",
        ),
        (
            Flaw::SkipsSignatureCheck,
            shipped::frames_of_strangers_and_other_swarms_are_dropped,
            "other-swarm",
        ),
    ] {
        assert_found(flaw, test, &[scenario, "rule: 2", "admitted a frame"]);
    }
}

#[test]
fn defect_5_loss_of_the_master_in_flight_is_not_detected() {
    assert_found(
        Flaw::DetectsMasterLossAtWaypointsOnly,
        election::each_half_of_the_line_elects_a_master_and_continues,
        &["rule: 1", "follows drone 7, which is not in its segment"],
    );
}

#[test]
fn defect_6_set_up_never_ends() {
    assert_found(
        Flaw::WaitsForever,
        shipped::swarm_takes_off_without_a_dead_drone,
        &["dead-on-ground: mission not completed"],
    );
}

#[test]
fn defect_7_all_drones_land_on_one_point() {
    let test = shipped::forty_drones_have_forty_slots;
    let expected = ["big-matrix", "rule: 4", "0.00 m apart"];
    assert_found(Flaw::LandsOnOnePoint, test, &expected);
}

#[test]
fn defect_8_slots_are_shared_missing_or_too_far_away() {
    let matrix = shipped::forty_drones_have_forty_slots;
    let clusters = shipped::clusters_without_the_master_become_separate_swarms;
    // Detected before take-off.
    let expected = ["big-matrix", "in lockstep", "take off: 0 m over ground"];
    assert_found(Flaw::RepeatsInnerRings, matrix, &expected);
    assert_found(Flaw::DropsRemainder, clusters, &["a slot for each drone"]);
    let expected = ["split-up-5: number of swarms"];
    assert_found(Flaw::StretchesDiagonals, clusters, &expected);
}

#[test]
fn defect_9_slots_are_assigned_by_id() {
    let test = shipped::forty_drones_have_forty_slots;
    let expected = ["big-matrix: waves to take off"];
    assert_found(Flaw::AssignsSlotsById, test, &expected);
}

/// Not a defect of the ancestor, which had no frame counters.
#[test]
fn frames_recorded_before_a_radio_restart_are_accepted() {
    assert_found(
        Flaw::SkipsFreshnessProof,
        faults::restarted_radio_drops_frames_recorded_before_its_restart,
        &["rule: 2", "admitted a frame"],
    );
}
