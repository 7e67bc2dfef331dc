use std::sync::LazyLock;

use muster_scenarios::report::Colour;
use scraper::{Html, Selector};

use super::*;
use crate::output::WriteError;

fn comparison() -> Comparison {
    static FLOWN: LazyLock<Comparison> = LazyLock::new(|| fly("1", 3, 2));
    FLOWN.clone()
}

fn fly(seed: &str, runs: u32, jobs: usize) -> Comparison {
    let flights = Flights::load(&[Override::seed(seed)], runs).unwrap();
    let jobs = NonZeroUsize::new(jobs).unwrap();
    flights
        .fly(Engine::Events, jobs, |_| None, |_, _| {})
        .unwrap()
}

fn number(html: &Html, selector: &str) -> usize {
    html.select(&Selector::parse(selector).unwrap()).count()
}

#[test]
fn table_compares_our_runs_with_the_thesis() {
    let text = table(&comparison(), Colour::Never);
    assert!(
        text.lines().all(|line| line.chars().count() <= 80),
        "{text}"
    );
    insta::assert_snapshot!(text);
}

#[test]
fn broken_rule_is_shown_with_the_command_that_repeats_it() {
    let mut comparison = comparison();
    let (faulty, _) = crate::output::sample::faulty();
    comparison.experiments[2].report.violations = faulty.violations;
    let text = table(&comparison, Colour::Never);
    assert!(!text.contains("none broken"), "{text}");
    assert!(
        text.contains("muster sim thesis-3 --seed 1 --engine events"),
        "{text}"
    );
    assert!(table(&comparison, Colour::Always).contains('\x1b'));
}

#[test]
fn broken_rule_in_a_further_run_is_shown() {
    let mut comparison = comparison();
    assert_eq!(comparison.further.len(), 4 * 2);
    let (faulty, _) = crate::output::sample::faulty();
    comparison.further[7].violations = faulty.violations;
    let text = table(&comparison, Colour::Never);
    assert!(
        text.contains("muster sim ancestor --seed 3 --engine events"),
        "{text}"
    );
    assert!(!html::page(&comparison).contains("✓"));
}

#[test]
fn waits_are_means_over_the_runs_for_any_number_of_jobs() {
    let (two, three) = (fly("2", 2, 1), comparison());
    let one = Wait::of(&three.settling, &[]);
    assert_eq!((one.lowest_run_s, one.highest_run_s), (None, None));
    let runs = [
        one.mean_s.unwrap(),
        two.waits.settling.lowest_run_s.unwrap(),
        two.waits.settling.highest_run_s.unwrap(),
    ];
    let Wait {
        mean_s,
        lowest_run_s,
        highest_run_s,
        ..
    } = three.waits.settling;
    assert!((mean_s.unwrap() - runs.iter().sum::<f64>() / 3.0).abs() < 1e-12);
    assert_eq!(lowest_run_s, runs.into_iter().reduce(f64::min));
    assert_eq!(highest_run_s, runs.into_iter().reduce(f64::max));
    assert_eq!(three.waits_runs.seeds, [1, 2, 3]);
}

#[test]
fn page_has_a_counterpart_of_every_figure() {
    let page = html::page(&comparison());
    let html = Html::parse_document(&page);
    assert_eq!(html.errors, Vec::<std::borrow::Cow<'static, str>>::new());
    let drones = 5 + 15 + 9 + 7 + 11;
    assert_eq!(number(&html, "figure svg"), 2 * 5 + 2 + 1);
    assert_eq!(number(&html, "g.bars"), 2 * drones + 2 * 5 + 15);
    for figure in [20, 21, 23, 24, 26, 27, 29, 30, 32, 33, 34, 35, 36] {
        assert!(page.contains(&format!("figure {figure}")), "{figure}");
    }
    for outside in [
        "http://", "https://", "<script", "@import", "url(", " src=", "<link",
    ] {
        assert!(!page.contains(outside), "{outside}");
    }
}

#[test]
fn drone_without_flight_time_has_no_bar() {
    let mut comparison = comparison();
    for drone in &mut comparison.settling.drones {
        drone.waypoint_delay_s = None;
    }
    comparison.experiments[0].report.drones[3].flight_time_s = None;
    let html = Html::parse_document(&html::page(&comparison));
    let missing: Vec<_> = html
        .select(&Selector::parse("g.bars text").unwrap())
        .flat_map(|element| element.text())
        .collect();
    assert_eq!(missing.len(), 16, "{missing:?}");
}

#[test]
fn comparison_is_two_files_and_does_not_replace_a_file() {
    let home = tempfile::tempdir().unwrap();
    let comparison = comparison();
    let written = write(&home.path().join("runs/thesis"), &comparison).unwrap();
    assert!(written.iter().all(|path| path.is_file()));
    let json = std::fs::read(&written[1]).unwrap();
    let json: serde_json::Value = serde_json::from_slice(&json).unwrap();
    assert_eq!(json["experiments"].as_array().map(Vec::len), Some(5));
    let taken = home.path().join("taken");
    std::fs::write(&taken, "mine").unwrap();
    let refused = write(&taken, &comparison).unwrap_err();
    assert!(matches!(refused, WriteError::NotAFolder { .. }));
    assert_eq!(std::fs::read_to_string(&taken).unwrap(), "mine");
}
