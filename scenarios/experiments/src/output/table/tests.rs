use muster_scenarios::report::count;

use super::*;
use crate::output::sample;

#[test]
fn table_of_fifteen_drones_fits_in_100_columns() {
    let (report, _) = sample::swarm(15);
    let text = table(&report, Some(100), Colour::Never);
    assert!(
        text.lines().all(|line| line.chars().count() <= 100),
        "{text}"
    );
    insta::assert_snapshot!(text);
}

#[test]
fn table_shows_restarts_early_landings_and_violations() {
    let (report, _) = sample::faulty();
    insta::assert_snapshot!(table(&report, None, Colour::Never));
}

#[test]
fn table_of_one_drone_has_no_separation_and_no_barrier() {
    let (mut report, _) = sample::swarm(1);
    report.barriers.clear();
    insta::assert_snapshot!(table(&report, Some(80), Colour::Never));
}

#[test]
fn narrow_terminal_wraps_states_but_not_numbers() {
    let (report, _) = sample::faulty();
    let narrow = table(&report, Some(70), Colour::Never);
    for drone in &report.drones {
        assert!(
            narrow.contains(&figure(count(drone.messages_received), 0)),
            "{narrow}"
        );
    }
}

#[test]
fn plain_table_has_no_escapes() {
    let (report, _) = sample::faulty();
    assert!(!table(&report, None, Colour::Never).contains('\x1b'));
    assert!(table(&report, None, Colour::Always).contains('\x1b'));
}

#[test]
fn table_names_segments_that_never_met() {
    let (mut report, _) = sample::swarm(7);
    report.never_met = (0..7).map(|id| vec![id]).collect();
    report.mission_completed = false;
    let text = table(&report, None, Colour::Never);
    let network = "network      7 segments never heard each other in their slots: drone 0; drone 1; drone 2; drone 3; \
                   drone 4; 2 more; raise `radio.range_m` or lower `formation.spacing_m`";
    assert!(text.contains(network), "{text}");
    assert!(text.contains("not completed by one swarm"), "{text}");
    assert!(!report.are_missions_completed());
}

#[test]
fn election_too_short_for_two_decimals_has_no_duration_of_zero() {
    let election = |settled_after_s| Election {
        at_s: 12.1,
        led_after_s: settled_after_s,
        settled_after_s,
        masters: vec![3],
    };
    for (settled_after_s, says) in [
        (
            Some(0.002),
            "at 12.1 s: no agreed master for less than 0.01 s; then master 3",
        ),
        (
            Some(0.32),
            "at 12.1 s: no agreed master; 0.32 s later: master 3",
        ),
        (None, "at 12.1 s: no agreed master until the end"),
    ] {
        assert_eq!(describe_election(&election(settled_after_s)), says);
    }
    let many = vec![election(Some(0.32))];
    let [(_, number), ..] = describe_elections(&many);
    assert_eq!(number, "1 period without an agreed master");
}

#[test]
fn many_elections_have_a_median_and_from_100_on_a_99th_percentile() {
    let election = |after_s: u32| Election {
        at_s: 12.0,
        led_after_s: None,
        settled_after_s: Some(f64::from(after_s)),
        masters: vec![3],
    };
    for (number, says) in [
        (11, "median 6.000 s, longest 11.000 s"),
        (60, "median 30.500 s, longest 60.000 s"),
        (
            200,
            "median 100.500 s, 99th percentile 198.000 s, longest 200.000 s",
        ),
    ] {
        let elections: Vec<_> = (1..=number).map(election).collect();
        let [.., (_, agreed)] = describe_elections(&elections);
        assert!(agreed.contains(says), "{agreed}");
    }
}
