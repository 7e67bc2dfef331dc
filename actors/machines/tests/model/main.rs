//! The model of election and merging, checked: rules 1a to 1c of the design hold in every state that three drones come
//! to, whatever is lost, late or repeated, and whichever fault befalls them. More drones and faults at once take
//! minutes: `cargo run --release -p muster-machines --example model`.

mod swarm;

use std::num::NonZeroUsize;

use swarm::{Faults, Flaw, Found, Pace, Swarm, search};

const NONE: Faults = Faults::NONE;

fn assert_holds(found: &Found, what: &str) {
    assert_eq!(found.broken, [], "{what}");
    assert_eq!(found.missing, [""; 0], "{what}: the model proves nothing");
}

#[test]
fn whatever_single_fault_befalls_three_drones_the_rules_hold_in_every_state() {
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
fn three_drones_cut_apart_one_of_which_crashes_and_restarts_keep_the_rules_in_every_state() {
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
fn whoever_falsely_suspects_its_master_over_a_link_that_carries_one_way_changes_nothing_for_good() {
    let faults = Faults {
        one_way: 1,
        suspicions: 1,
        ..NONE
    };
    assert_holds(&search(Swarm::new(3, faults, Pace::Prompt), None), "");
}

#[test]
fn an_actor_that_fails_and_is_behind_with_its_messages_breaks_no_rule() {
    let faults = Faults {
        failures: 1,
        ..NONE
    };
    let found = search(Swarm::new(3, faults, Pace::Mailboxes).that_settles(), None);
    assert!(found.is_exhausted);
    assert_holds(&found, "");
}

#[test]
fn four_drones_keep_the_rules_for_as_many_steps_as_there_is_time_for() {
    let faults = Faults {
        crashes: 1,
        splits: 1,
        ..NONE
    };
    let found = search(Swarm::new(4, faults, Pace::Prompt), NonZeroUsize::new(6));
    assert!(!found.is_exhausted && found.depth == 6);
    assert!(found.reached > found.states && found.states > 1_000);
    assert_eq!(found.broken, []);
}

#[test]
fn what_is_broken_on_purpose_is_found() {
    for (flaw, faults, pace, rule) in Flaw::ALL {
        let found = search(Swarm::new(3, faults, pace).with(flaw), None);
        let found: Vec<_> = found.broken.iter().map(|(name, _)| *name).collect();
        assert!(found.contains(&rule), "{flaw:?}: {found:?}");
    }
}
