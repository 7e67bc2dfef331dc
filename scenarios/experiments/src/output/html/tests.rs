use std::time::Duration;

use muster_machines::time::Timestamp;
use muster_scenarios::report::{Epoch, Flight, Mark, MarkKind, NodeHistory, Report};
use scraper::{Html, Selector};

use super::page;
use crate::output::sample::{self, flown};

fn parsed((report, flight): &(Report, Flight)) -> Html {
    let html = Html::parse_document(&page(report, flight));
    assert_eq!(html.errors, Vec::<std::borrow::Cow<'static, str>>::new());
    html
}

fn number(html: &Html, selector: &str) -> usize {
    html.select(&Selector::parse(selector).unwrap()).count()
}

fn text(html: &Html, selector: &str) -> String {
    let selector = Selector::parse(selector).unwrap();
    html.select(&selector)
        .flat_map(|element| element.text())
        .collect()
}

#[test]
fn page_is_well_formed_for_1_to_100_drones() {
    for drones in [1, 2, 15, 100] {
        let html = parsed(&sample::swarm(drones));
        let drones = drones as usize;
        assert_eq!(number(&html, ".main g.drone"), drones);
        assert_eq!(number(&html, "details tbody tr"), drones);
        assert_eq!(number(&html, "g.bars"), 2 * drones);
    }
}

#[test]
fn page_shows_every_drone_with_its_kind() {
    let html = parsed(&sample::swarm(15));
    let about = text(&html, ".main g.drone > title");
    for id in 0..15 {
        assert!(about.contains(&format!("drone {id} (")), "{about}");
    }
    assert_eq!(number(&html, ".main g.k-master"), 1);
    assert_eq!(number(&html, ".main g.k-relay"), 12);
    assert_eq!(number(&html, ".main g.k-leaf"), 2);
    assert_eq!(number(&html, ".main .range circle"), 1);
    assert_eq!(text(&html, ".main .pin-number"), "012345");
}

#[test]
fn page_names_drones_that_stayed_on_the_ground_and_faults_that_never_happened() {
    let (mut report, flight) = sample::swarm(5);
    "start".clone_into(&mut report.drones[4].state);
    report.mission_completed = false;
    report.never_injected = vec![2, 3];
    let html = parsed(&(report, flight));
    assert!(text(&html, ".cards .note").contains("flown without drone 4, never off the ground"));
    assert!(text(&html, ".facts").contains("never injected, by number in the file: 2, 3"));
}

#[test]
fn map_enlarges_drones_close_together() {
    assert_eq!(number(&parsed(&sample::swarm(15)), ".enlarged"), 2);
    assert_eq!(number(&parsed(&sample::swarm(1)), ".enlarged"), 0);
}

#[test]
fn page_loads_nothing_from_the_network() {
    let (report, flight) = sample::faulty();
    let page = page(&report, &flight);
    for outside in [
        "http://", "https://", "//cdn", "@import", "import(", "fetch(", "XMLHttp", "url(", " src=",
        "<link",
    ] {
        assert!(!page.contains(outside), "{outside}");
    }
    assert!(page.contains("default-src 'none'"));
}

#[test]
fn page_escapes_text_of_the_run() {
    let hostile = r#"<script>alert(1)</script>&"'.toml"#;
    let (mut report, flight) = sample::faulty();
    report.scenario = hostile.to_owned();
    report.trace = Some(hostile.to_owned());
    report.drones[0].state = hostile.to_owned();
    report.drones[0].landed_because = Some(hostile.to_owned());
    report.violations[0].what = hostile.to_owned();
    let mut flight = flight;
    flight.history.marks = vec![Mark {
        at: Timestamp::ZERO,
        until: None,
        kind: MarkKind::Fault,
        nodes: vec![],
        text: hostile.to_owned(),
    }];
    let html = parsed(&(report, flight));
    assert_eq!(number(&html, "script"), 2, "the record and what plays it");
    let record: serde_json::Value = serde_json::from_str(&text(&html, "#record")).unwrap();
    assert_eq!(record["marks"][0]["text"], hostile);
    assert!(text(&html, ".facts dd").contains(hostile));
    assert!(text(&html, ".trace").contains(hostile));
    assert!(text(&html, "section.bad td").contains(hostile));
}

#[test]
fn drone_without_flight_time_has_a_place_but_no_bar() {
    let html = parsed(&sample::faulty());
    assert_eq!(number(&html, "g.bars"), 12);
    assert_eq!(number(&html, "g.bars .bar"), 17);
    assert!(text(&html, "g.bars > title").contains("no flight time"));
    assert_eq!(number(&html, ".scroll g.broken"), 2);
    assert!(text(&html, ".card.bad").contains("2 times"));
}

#[test]
fn page_works_without_drones_barriers_and_positions() {
    let (mut report, mut flight) = sample::swarm(1);
    report.barriers.clear();
    report.min_separation_m = None;
    assert!(text(&parsed(&(report.clone(), flight.clone())), ".none").contains("No barriers"));
    report.drones.clear();
    report.simulated_s = 0.0;
    flight.drones.clear();
    flight.waypoints.clear();
    let html = parsed(&(report, flight));
    assert!(text(&html, ".none").contains("No positions were recorded."));
}

#[test]
fn page_shows_the_command_that_repeats_the_run() {
    let html = parsed(&sample::swarm(2));
    let command = "muster sim scenarios/thesis-2.toml --seed 7 --engine actors";
    assert_eq!(text(&html, "pre code"), command);
}

#[test]
fn radio_range_far_beyond_the_tracks_does_not_shrink_the_map() {
    let (report, mut flight) = sample::swarm(15);
    let legend = |flight: &Flight| text(&parsed(&(report.clone(), flight.clone())), ".map .legend");
    assert!(!legend(&flight).contains("beyond the map"));
    flight.range_m = 30_000.0;
    assert!(legend(&flight).contains("30,000 m radio range, beyond the map"));
    let html = parsed(&(report, flight));
    assert!(!text(&html, ".main .tick").contains("10,000"));
}

#[test]
fn range_is_drawn_around_the_master_of_the_marks() {
    let (report, mut flight) = sample::swarm(5);
    let about = |flight: &Flight| text(&parsed(&(report.clone(), flight.clone())), ".range title");
    assert!(about(&flight).contains("drone 2, the master then"));
    let epoch = |master, term| Epoch {
        term,
        rank: 0,
        master,
        since: Timestamp::ZERO,
    };
    flight.history.epochs = vec![epoch(4, 1), epoch(2, 2)];
    let later = Timestamp::from_secs_f64(report.simulated_s);
    flight.history.nodes = (0..5)
        .map(|id| NodeHistory {
            id,
            epochs: vec![(Timestamp::ZERO, Some(0)), (later, Some(1))],
            ..NodeHistory::default()
        })
        .collect();
    assert!(about(&flight).contains("drone 4, the master then"));
}

#[test]
fn plot_of_the_closest_pair_names_its_logarithmic_scale() {
    let html = parsed(&sample::swarm(3));
    assert!(text(&html, ".replay-plots h3").contains("Closest pair, logarithmic scale"));
}

#[test]
fn drone_that_landed_early_is_not_called_finished() {
    let html = parsed(&sample::faulty());
    let states = text(&html, "td.state");
    assert!(
        states.starts_with("landed earlythe master was silent"),
        "{states}"
    );
    assert!(text(&html, ".main g.drone > title").contains("s, landed early"));
}

#[test]
fn time_of_processes_is_not_called_simulated() {
    let (mut report, flight) = sample::swarm(2);
    assert!(page(&report, &flight).contains("simulated time in seconds"));
    report.engine = None;
    let page = page(&report, &flight);
    assert!(page.contains("time in seconds") && !page.contains("simulated"));
}

#[test]
fn drones_with_a_flight_controller_have_plots_and_no_others_do() {
    let gap = Duration::from_millis(20);
    let (report, mut flight) = sample::swarm(4);
    assert_eq!(
        number(
            &parsed(&(report.clone(), flight.clone())),
            "details.control"
        ),
        0
    );
    flight.drones[1].control = Some(flown(60, gap));
    flight.drones[3].control = Some(flown(60, gap));
    let mark = |kind, nodes| Mark {
        at: Timestamp::from_secs_f64(20.0),
        until: None,
        kind,
        nodes,
        text: "it broke".to_owned(),
    };
    flight.history.marks = vec![
        mark(MarkKind::Fault, vec![3]),
        mark(MarkKind::Death, vec![1]),
    ];
    let html = parsed(&(report, flight));
    assert_eq!(text(&html, "details.control summary"), "drone 1drone 3");
    assert_eq!(number(&html, "details.control[open]"), 1);
    for class in ["c-roll", "c-pitch", "c-throttle", "c-gap"] {
        assert_eq!(number(&html, &format!("details.control path.{class}")), 2);
    }
    assert_eq!(number(&html, "details.control line.mean"), 2);
    assert_eq!(
        text(&html, "details.control g.broken title"),
        "fault at 20.0 s: it broke"
    );
}

#[test]
fn a_gap_beyond_the_axis_is_drawn_at_its_edge() {
    let heights = |milliseconds| {
        let (report, mut flight) = sample::swarm(1);
        flight.drones[0].control = Some(flown(60, Duration::from_millis(milliseconds)));
        let html = parsed(&(report, flight));
        let selector = Selector::parse("path.c-gap").unwrap();
        let path = html.select(&selector).next().unwrap();
        path.value().attr("d").unwrap().to_owned()
    };
    assert_ne!(heights(20), heights(200));
    assert_eq!(heights(200), heights(60_000));
}
