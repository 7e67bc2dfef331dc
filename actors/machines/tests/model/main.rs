//! Checks the model of elections and merging partitions: rules 1a to 1c of the design hold in every reachable state of
//! three drones, with lost, late and repeated frames and single faults. More drones and combined faults take minutes:
//! `cargo run --release -p muster-machines --example model`.

mod swarm;

use std::num::NonZeroUsize;

use swarm::{Faults, Flaw, Found, Pace, Swarm, search};

const NONE: Faults = Faults::NONE;

fn assert_holds(found: &Found, what: &str) {
    assert_eq!(found.violated, [], "{what}");
    assert_eq!(
        found.unreached, [""; 0],
        "{what}: states that should be reached are not"
    );
}

#[test]
fn rules_hold_for_three_drones_with_any_single_fault() {
    for faults in [
        Faults { crashes: 1, ..NONE },
        Faults {
            failures: 1,
            ..NONE
        },
        Faults { splits: 1, ..NONE },
        Faults {
            suspicions: 1,
            ..NONE
        },
    ] {
        let found = search(Swarm::new(3, faults, Pace::Prompt).that_settles(), None);
        assert!(found.is_exhausted);
        assert_holds(&found, &format!("{faults:?}"));
    }
}

#[test]
fn rules_hold_for_three_drones_with_a_partition_and_a_crash() {
    let faults = Faults {
        crashes: 1,
        splits: 1,
        ..NONE
    };
    let found = search(Swarm::new(3, faults, Pace::Prompt), None);
    assert!(found.is_exhausted && found.states > 100_000);
    assert_holds(&found, "");
}

#[test]
fn rules_hold_with_a_one_way_link_and_a_false_suspicion() {
    let faults = Faults {
        one_way: 1,
        suspicions: 1,
        ..NONE
    };
    assert_holds(&search(Swarm::new(3, faults, Pace::Prompt), None), "");
}

#[test]
fn rules_hold_with_a_failing_actor_and_delayed_messages() {
    let faults = Faults {
        failures: 1,
        ..NONE
    };
    let found = search(Swarm::new(3, faults, Pace::Mailboxes).that_settles(), None);
    assert!(found.is_exhausted);
    assert_holds(&found, "");
}

#[test]
fn rules_hold_for_four_drones_to_a_depth_of_six_steps() {
    let faults = Faults {
        crashes: 1,
        splits: 1,
        ..NONE
    };
    let found = search(Swarm::new(4, faults, Pace::Prompt), NonZeroUsize::new(6));
    assert!(!found.is_exhausted && found.depth == 6);
    assert!(found.reached > found.states && found.states > 1_000);
    assert_eq!(found.violated, []);
}

#[test]
fn deliberate_flaws_are_detected() {
    for (flaw, faults, pace, rule) in Flaw::ALL {
        let found = search(Swarm::new(3, faults, pace).with(flaw), None);
        let found: Vec<_> = found.violated.iter().map(|(name, _)| *name).collect();
        assert!(found.contains(&rule), "{flaw:?}: {found:?}");
    }
}
