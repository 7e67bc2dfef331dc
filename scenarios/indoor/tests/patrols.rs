//! Whole patrols of the shipped flat. Thousands of seeds are for `muster map patrol`.

use std::path::Path;
use std::sync::LazyLock;
use std::time::Duration;

use muster_indoor::patrol::Fault;
use muster_indoor_world::campaign::SEEN_MIN;
use muster_indoor_world::engine;
use muster_indoor_world::flat::{Flat, shipped};
use muster_indoor_world::world::{CLEARANCE_M, Failing, Prepared, Setup};

static FLAT: LazyLock<Prepared> = LazyLock::new(|| {
    let flat = Flat::read(Path::new("flat")).expect("a shipped flat");
    Prepared::new(flat, Default::default()).expect("a flat to fly in")
});

#[test]
fn shipped_flats_can_be_read() {
    assert!(!shipped().is_empty());
}

#[test]
fn patrols_with_noise_and_people_touch_nothing_and_see_all() {
    let undisturbed = engine::run(&FLAT, Setup::undisturbed());
    assert!(undisturbed.is_done && undisturbed.seen() >= SEEN_MIN);
    for seed in 0..6 {
        let outcome = engine::run(&FLAT, Setup::seeded(seed));
        assert!(outcome.is_done && !outcome.is_at_fault(), "seed {seed}");
        assert!(
            outcome.seen() >= SEEN_MIN,
            "seed {seed}: {}",
            outcome.seen()
        );
        assert_eq!(outcome.blind_motions, 0, "seed {seed}");
    }
}

#[test]
fn both_engines_give_the_same_patrol() {
    let events = engine::run(&FLAT, Setup::seeded(5));
    let actors = engine::run_on_actors(&FLAT, Setup::seeded(5)).unwrap();
    assert!(events == actors);
    assert!(events.least_clearance_m >= CLEARANCE_M);
}

#[test]
fn seeds_differ_and_repeat() {
    let one = engine::run(&FLAT, Setup::seeded(1));
    assert!(one == engine::run(&FLAT, Setup::seeded(1)));
    assert!(one != engine::run(&FLAT, Setup::seeded(2)));
}

#[test]
fn a_patrol_ends_with_one_sonar_dead_one_stuck_and_one_before_glass() {
    let from = Duration::from_secs(20);
    let all = [(2, Failing::Dead), (0, Failing::Stuck), (3, Failing::Glass)];
    let setup = Setup {
        failing: all
            .iter()
            .map(|(sonar, how)| (*sonar, *how, from))
            .collect(),
        ..Setup::seeded(0)
    };
    let outcome = engine::run(&FLAT, setup);
    for (sonar, fault) in [(2, Fault::Dead), (0, Fault::Stuck), (3, Fault::Deaf)] {
        let mut found = outcome.sonars.iter();
        let found = found.find(|(_, it)| it.sonar == sonar && it.fault == Some(fault));
        let (at, _) = found.unwrap_or_else(|| panic!("sonar {sonar} is not found"));
        let after_s = at.as_secs_f64() - from.as_secs_f64();
        assert!(after_s <= 2.0, "sonar {sonar}: {after_s} s");
    }
    assert!(outcome.is_done);
    // Nearer than the rule asks for, but nothing is touched.
    assert!(outcome.least_clearance_m >= 0.1);
}
