//! The ancestor's nine defects: with the guard against one of them taken out, the test of a shipped scenario fails.

use std::panic::catch_unwind;

use muster_machines::flaw::{Flaw, plant};
use muster_scenarios::engine::Engine;

use crate::support::{fly, scenario};
use crate::{election, faults, shipped};

/// Without that guard the test fails and says all of this; with it, it is one of the tests that pass.
fn assert_found(flaw: Flaw, test: fn(), says: &[&str]) {
    let _planted = plant(flaw);
    let Err(panic) = catch_unwind(test) else {
        panic!("{flaw:?} is not found");
    };
    let said = panic.downcast_ref::<String>().map_or("", String::as_str);
    let is_said = says.iter().all(|it| said.contains(it));
    assert!(is_said, "{flaw:?} is found otherwise: {said}");
}

#[test]
fn defect_1_nobody_takes_over_from_a_master_that_hangs() {
    assert_found(
        Flaw::LeavesWhatFails,
        shipped::a_master_whose_mission_hangs_is_mended_and_goes_on,
        &["hung-mission", "rule: 1", "obeys drone 3, which no link"],
    );
    // Nor if it is never found out.
    let unwatched = scenario("hung-mission.toml", &["limits.hang_ms=3600000"]);
    let report = fly(&unwatched, Engine::Events);
    let broken: Vec<_> = report.violations.iter().map(|it| it.rule).collect();
    assert_eq!((broken, report.elections), (vec![5], vec![]));
}

#[test]
fn defect_2_the_master_goes_on_without_whoever_came_back() {
    assert_found(
        Flaw::OverlooksWhoReturns,
        shipped::a_drone_that_returns_is_waited_for,
        &["returning-drone", "rule: 3, ", "drones: [6]"],
    );
}

#[test]
fn defect_3_two_masters_that_meet_are_both_obeyed() {
    for (flaw, says) in [
        (
            Flaw::NeverStepsDown,
            ["cut-in-two", "rule: 1", "of term 2 and drone 3"],
        ),
        (
            Flaw::ObeysAnyMaster,
            ["cut-two-apart", "rule: 1", "which is no better"],
        ),
    ] {
        let test = shipped::swarms_that_meet_again_are_one_and_all_fly_every_waypoint;
        assert_found(flaw, test, &says);
    }
}

#[test]
fn defect_4_another_swarm_is_obeyed() {
    for (flaw, test, scenario) in [
        (
            Flaw::HeedsOtherSwarms,
            shipped::two_swarms_that_pass_each_other_obey_their_own_masters_and_nobody_else
                as fn(),
            "two-swarms",
        ),
        (
            Flaw::BelievesAnySender,
            shipped::nobody_heeds_strangers_and_other_swarms,
            "other-swarm",
        ),
    ] {
        assert_found(flaw, test, &[scenario, "rule: 2", "let in a frame"]);
    }
}

#[test]
fn defect_5_a_master_that_dies_in_flight_is_not_missed_there() {
    assert_found(
        Flaw::MissesMasterAtWaypointsOnly,
        election::each_half_of_the_line_elects_a_master_and_flies_on,
        &["rule: 1", "obeys drone 7, which no link leads to"],
    );
}

#[test]
fn defect_6_set_up_never_ends() {
    assert_found(
        Flaw::WaitsForEver,
        shipped::a_swarm_takes_off_without_whoever_is_dead,
        &["dead-on-ground: not flown to its end"],
    );
}

#[test]
fn defect_7_all_land_on_one_point() {
    let test = shipped::forty_drones_have_forty_places;
    let says = ["big-matrix", "rule: 4", "0.00 m apart"];
    assert_found(Flaw::LandsOnOnePoint, test, &says);
}

#[test]
fn defect_8_slots_are_shared_missing_or_too_far_out() {
    let matrix = shipped::forty_drones_have_forty_places;
    let clusters = shipped::clusters_without_their_master_are_swarms_of_their_own;
    // It is found before anybody flies.
    let says = ["big-matrix", "in lockstep", "take off: 0 m over ground"];
    assert_found(Flaw::RepeatsPlaces, matrix, &says);
    assert_found(Flaw::DropsRemainder, clusters, &["a slot for each drone"]);
    let says = ["split-up-5: how many swarms"];
    assert_found(Flaw::StretchesDiagonals, clusters, &says);
}

#[test]
fn defect_9_slots_go_by_number() {
    let test = shipped::forty_drones_have_forty_places;
    let says = ["big-matrix: waves to take off"];
    assert_found(Flaw::TakesSlotsByNumber, test, &says);
}

/// None of the ancestor's, which had no counters to begin with.
#[test]
fn what_was_recorded_before_a_radio_was_started_anew_is_let_in() {
    assert_found(
        Flaw::BelievesTheUnproven,
        faults::a_radio_that_was_started_anew_obeys_no_frames_that_were_recorded_before,
        &["rule: 2", "let in a frame"],
    );
}
