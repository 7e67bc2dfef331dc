//! Whole patrols of the shipped flats. Thousands of seeds are for `muster map patrol`.

use std::num::NonZeroUsize;
use std::path::Path;
use std::time::Duration;

use muster_indoor::patrol::Fault;
use muster_indoor_world::campaign::{self, SEEN_MIN, TIMES_MAX};
use muster_indoor_world::flat::{Flat, shipped};
use muster_indoor_world::world::{Failing, Outcome, Prepared, Setup};
use muster_indoor_world::{engine, page};

/// Error of the believed position that 95 % of the steps stay below, in metres.
const ERROR_P95_M: f64 = 0.25;
/// When sonars fail.
const FAIL_AFTER: Duration = Duration::from_secs(20);

fn prepared(name: &str) -> Prepared {
    let flat = Flat::read(Path::new(name)).expect("a shipped flat");
    Prepared::new(flat, Default::default()).expect("a flat to fly in")
}

fn check_safe(outcome: &Outcome, what: &str) {
    assert!(outcome.is_done && outcome.landed.is_none(), "{what}");
    let clearance = &outcome.clearance;
    assert!(
        !clearance.is_at_fault(),
        "{what}: {:?}",
        clearance.touches()
    );
    assert_eq!(outcome.blind_motions, 0, "{what}");
}

/// Flies a patrol that is safe and keeps its time.
fn check_patrol(prepared: &Prepared, what: &str, seed: u64) -> Outcome {
    let exact = engine::run(prepared, Setup::exact(seed));
    let outcome = engine::run(prepared, Setup::seeded(seed));
    check_safe(&outcome, what);
    let times = outcome.time.as_secs_f64() / exact.time.as_secs_f64();
    assert!(times <= TIMES_MAX, "{what}: {times}");
    outcome
}

#[test]
fn patrols_of_all_flats_touch_nothing_see_all_and_keep_their_time_and_their_pose() {
    std::thread::scope(|scope| {
        for (name, _) in shipped() {
            scope.spawn(move || {
                let prepared = prepared(name);
                for seed in 0..2 {
                    let what = format!("{name}, seed {seed}");
                    let outcome = check_patrol(&prepared, &what, seed);
                    assert!(outcome.seen() >= SEEN_MIN, "{what}: {}", outcome.seen());
                    let error_m = outcome.track.error_m(0.95);
                    assert!(error_m <= ERROR_P95_M, "{what}: {error_m}");
                }
            });
        }
    });
}

/// From tables that are half a cell off, it believed itself half a decimetre nearer to the middle of a door than it was, and came
/// within 0.15 m of the door's post, which passed by the failing sonars.
#[test]
fn drone_passes_doors_clear_of_their_posts_with_failing_sonars() {
    let flat = prepared("flat");
    let three = [(2, Failing::Dead), (0, Failing::Stuck), (3, Failing::Glass)];
    let after = Duration::from_secs(10);
    for seed in [1, 2] {
        let failing = three.iter().map(|(sonar, how)| (*sonar, *how, after));
        let setup = Setup {
            failing: failing.collect(),
            ..Setup::seeded(seed)
        };
        check_safe(&engine::run(&flat, setup), &format!("seed {seed}"));
    }
}

/// A wall that it looked at blocked all ways of the drone, which stood still for two minutes.
#[test]
fn drone_leaves_a_door_post_that_it_looks_at() {
    check_patrol(&prepared("corridor"), "corridor, seed 55", 55);
}

/// Without making room they take two times as long as without noise: drone and person wait for each other at a door.
#[test]
fn drone_makes_room_for_a_person_at_a_door() {
    for (name, seed) in [("ell", 28), ("ell", 61), ("flat", 866)] {
        check_patrol(&prepared(name), &format!("{name}, seed {seed}"), seed);
    }
}

/// Remembering people who have gone, they take 1.6 to 1.9 times as long as without noise.
#[test]
fn drone_flies_on_where_a_person_has_gone() {
    for (name, seed) in [("flat", 587), ("ell", 87), ("corridor", 52)] {
        check_patrol(&prepared(name), &format!("{name}, seed {seed}"), seed);
    }
}

/// The person stands in a corner of its walk, from where both ways lead closer to the drone, and the drone beside a wall, from where
/// only a way back leads. Without making room it takes 27 times as long, and 44 stops are given up.
#[test]
fn drone_makes_room_for_a_person_who_can_not_turn_back() {
    let prepared = prepared("flat");
    let alone = engine::run(&prepared, Setup::undisturbed());
    let outcome = engine::run(&prepared, Setup::exact(436));
    check_safe(&outcome, "seed 436");
    assert!(outcome.given_up.is_empty());
    let times = outcome.time.as_secs_f64() / alone.time.as_secs_f64();
    assert!(times <= 2.0, "{times}");
}

#[test]
fn both_engines_give_the_same_patrol() {
    let flat = prepared("flat");
    let events = engine::run(&flat, Setup::seeded(5));
    let actors = engine::run_on_actors(&flat, Setup::seeded(5)).unwrap();
    assert!(events == actors);
}

#[test]
fn page_lists_failed_patrols_and_marks_what_was_not_seen() {
    let flat = passage();
    let seeds = "1..3".parse().unwrap();
    let jobs = NonZeroUsize::MIN;
    let mut patrols = campaign::run(&flat, seeds, &[], jobs, |_| ());
    let mut first = engine::run(&flat, Setup::seeded(1));
    let page = page::patrol(&flat, &patrols, &first, "muster map patrol flat");
    assert!(!page.contains("Patrols that failed") && !page.contains("class=\"short\""));
    patrols.rows[1].seen = 0.98;
    first.unseen = first.visible / 50;
    let page = page::patrol(&flat, &patrols, &first, "muster map patrol flat");
    for part in [
        "Patrols that failed",
        "<td class=\"n\">2</td><td class=\"n short\">98.00</td>",
        "<td>saw 98.00 %</td>",
        " %, less than 99 %,</b> of what can be seen",
    ] {
        assert!(page.contains(part), "{part}: {page}");
    }
}

#[test]
fn seeds_differ_and_repeat() {
    let flat = passage();
    let one = engine::run(&flat, Setup::seeded(1));
    assert!(one == engine::run(&flat, Setup::seeded(1)));
    assert!(one != engine::run(&flat, Setup::seeded(2)));
}

#[test]
fn patrols_end_with_a_sonar_dead_stuck_or_before_glass_and_with_all_three() {
    let all = [
        (2, Failing::Dead, Fault::Dead),
        (0, Failing::Stuck, Fault::Stuck),
        (3, Failing::Glass, Fault::Deaf),
    ];
    let flat = prepared("flat");
    for failing in [&all[..1], &all[1..2], &all[2..], &all[..]] {
        let setup = Setup {
            failing: failing
                .iter()
                .map(|(sonar, how, _)| (*sonar, *how, FAIL_AFTER))
                .collect(),
            ..Setup::seeded(0)
        };
        let outcome = engine::run(&flat, setup);
        check_safe(&outcome, &format!("{failing:?}"));
        for (sonar, _, fault) in failing {
            let mut found = outcome.sonars.iter();
            let found = found.find(|(_, it)| it.sonar == *sonar && it.fault == Some(*fault));
            let (at, _) = found.unwrap_or_else(|| panic!("sonar {sonar} is not found"));
            let after_s = at.as_secs_f64() - FAIL_AFTER.as_secs_f64();
            assert!(after_s <= 2.0, "sonar {sonar}: {after_s} s");
        }
    }
}

/// A passage of 1.25 m beside a zone that is not to be entered; a person walks to and fro in it.
fn passage() -> Prepared {
    let wall = "#".repeat(42);
    let free = format!("#{}#", ".".repeat(40));
    let beside = format!("#{}{}{}#", ".".repeat(10), "x".repeat(20), ".".repeat(10));
    let rows = [
        vec![wall.clone()],
        vec![free; 5],
        vec![beside; 3],
        vec![wall],
    ]
    .concat();
    let text = format!(
        "about = \"a passage beside a zone\"\ncell_m = 0.25\nplan = '''\n{}\n'''\n\
         start = {{ x_m = 1.0, y_m = 1.6, heading_deg = 0.0 }}\ncamera = {{ range_m = 4.0, cone_deg = 60.0 }}\n\
         [[people]]\nspeed_mps = 0.6\npath = [[2.0, 1.6], [9.0, 1.6]]\n",
        rows.join("\n")
    );
    let flat = Flat::parse(Path::new("passage"), &text).expect("a flat");
    Prepared::new(flat, Default::default()).expect("a flat to fly in")
}

/// Across a zone the drone's camera sees 20 cm farther than the drone counts with, so that it never came as near as it was asked to.
#[test]
fn patrol_is_judged_by_what_the_drone_plans_to_see() {
    let wall = "#".repeat(26);
    let row = format!("#{}{}#\n", ".".repeat(8), "x".repeat(16));
    let text = format!(
        "about = \"a zone\"\ncell_m = 0.25\nplan = '''\n{wall}\n{}{wall}\n'''\n\
         start = {{ x_m = 1.0, y_m = 1.5, heading_deg = 0.0 }}\ncamera = {{ range_m = 3.0, cone_deg = 60.0 }}\n",
        row.repeat(10)
    );
    let flat = Flat::parse(Path::new("zone"), &text).expect("a flat");
    let prepared = Prepared::new(flat, Default::default()).expect("a flat to fly in");
    let outcome = engine::run(&prepared, Setup::undisturbed());
    check_safe(&outcome, "zone");
    assert!(outcome.seen() >= SEEN_MIN, "{}", outcome.seen());
}

/// Round the person, the drone entered the zone, which only its paths kept out of.
#[test]
fn drone_that_meets_a_person_beside_a_zone_stays_out_of_the_zone() {
    let passage = passage();
    for seed in 0..4 {
        let what = format!("seed {seed}");
        check_safe(&engine::run(&passage, Setup::exact(seed)), &what);
        check_safe(&engine::run(&passage, Setup::seeded(seed)), &what);
    }
}
