//! Faults of the protocol, planted one at a time: the search finds each, and makes what it found small.

use std::num::NonZeroUsize;
use std::path::Path;

use muster_machines::flaw::{Flaw, plant};
use muster_scenarios::campaign::Effort;
use muster_scenarios::chaos::{self, Request, Search};
use muster_scenarios::engine::{self, Engine};
use muster_scenarios::scenario;

use crate::support::{fly, scenario as shipped};

/// In how many plans each is to be found, and how many faults may be left of the plan that finds it.
const PLANS: u64 = 2_000;
/// Likewise, of what keeps ways apart.
const APART_PLANS: u64 = 500;
const FAULTS_MAX: usize = 3;

const PLANTED: [Flaw; 14] = [
    Flaw::NeverStepsDown,
    Flaw::CountsEchoes,
    Flaw::ObeysAnyMaster,
    Flaw::ForgetsOneMember,
    Flaw::LandsOnOnePoint,
    Flaw::LosesCheckpoints,
    Flaw::TurnsToWorseBallots,
    Flaw::ReopensWaypoints,
    Flaw::RejoinsWhileLanding,
    Flaw::BelievesAnySender,
    Flaw::LeavesWhatFails,
    Flaw::NeverClaims,
    Flaw::BelievesTheUnproven,
    Flaw::DeadlineInThePast,
];

/// What takes hundreds of plans to be found.
const HIDDEN: [Flaw; 4] = [
    Flaw::ForgetsLayers,
    Flaw::ObeysOneWayNeighbours,
    Flaw::AcceptsEarlierLives,
    Flaw::OverlooksWhoReturns,
];

#[test]
fn the_search_finds_every_planted_fault_and_makes_its_plan_small() {
    assert_found("tests/data/planted.toml", &[], PLANS, &PLANTED);
}

/// What keeps ways apart by heights, without giving way to each other.
#[test]
#[ignore = "takes a minute: cargo test --release -p muster-scenarios --test flights each_way -- --ignored"]
fn the_search_finds_each_way_to_come_too_near() {
    let heights = [
        Flaw::TakesOffInOneLayer,
        Flaw::GoesToLandInOneLayer,
        Flaw::ForgetsLayers,
    ];
    // Over links that hear each other well: elsewhere some plans need that drones give way.
    let alone = [
        "safety.avoid=false",
        "protocol.kind=muscop",
        "formation.spacing_m=60",
        "radio.model=range",
        "radio.loss=0",
        "radio.burst_loss=0",
    ];
    assert_found("chaos.toml", &alone, APART_PLANS, &heights);
    let changes = "changes=[{ waypoint = 1, kind = \"compact-matrix\" }, { waypoint = 3, kind = \"linear\" }]";
    let crosses = [&alone[..], &[changes]].concat();
    assert_found(
        "chaos.toml",
        &crosses,
        APART_PLANS,
        &[Flaw::CrossesInOneSector],
    );
}

#[test]
#[ignore = "takes minutes: cargo test --release -p muster-scenarios --test flights hidden -- --ignored"]
fn the_search_finds_hidden_faults_too() {
    assert_found("tests/data/planted.toml", &[], PLANS, &HIDDEN);
}

/// The search does not find this flaw: links that fade are grey, and no rule says how long a waypoint may take. It takes many
/// times as long.
#[test]
fn over_fading_links_routes_by_hops_make_waypoints_take_long() {
    let (waits_ms, elections) = fading_flights();
    assert!(waits_ms < 40.0, "{waits_ms} ms");
    assert_eq!(elections, 0);
    let _planted = plant(Flaw::RoutesByHops);
    let (by_hops_ms, _) = fading_flights();
    assert!(by_hops_ms > waits_ms * 4.0, "{by_hops_ms} ms");
}

/// How long waypoints take that nobody is late for, in the median, and how many elections there are, of flights in which
/// nothing fails.
fn fading_flights() -> (f64, usize) {
    let (mut waits_ms, mut elections) = (Vec::new(), 0);
    for seed in 0..20 {
        let seed = format!("seed={seed}");
        let scenario = shipped("tests/data/planted-radio.toml", &[&*seed]);
        let report = fly(&scenario, Engine::Events);
        assert_eq!(report.violations, [], "{seed}");
        waits_ms.extend(report.barriers.iter().map(|it| it.wait_s() * 1e3));
        elections += report.elections.len();
    }
    waits_ms.sort_by(f64::total_cmp);
    (waits_ms[waits_ms.len() / 2], elections)
}

fn assert_found(scenario: &str, set: &[&str], plans: u64, planted: &[Flaw]) {
    let scenario = Path::new(env!("CARGO_MANIFEST_DIR")).join(scenario);
    let jobs = std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
    for flaw in planted.iter().copied() {
        let folder = tempfile::tempdir().unwrap();
        let search = Search::load(&Request {
            scenario: scenario.clone(),
            set: set.iter().map(|it| it.parse().unwrap()).collect(),
            seeds: format!("0..{plans}").parse().unwrap(),
            keeps_going: false,
        });
        let around = |fly: &mut dyn FnMut()| {
            let _planted = plant(flaw);
            fly();
        };
        let effort = Effort {
            jobs,
            run_limit: chaos::RUN_LIMIT,
        };
        let searched =
            chaos::run(&search.unwrap(), folder.path(), effort, &around, |_| ()).unwrap();
        let Some(finding) = searched.finding else {
            panic!("{flaw:?} is not found in {plans} plans");
        };
        let left = finding.faults.1;
        assert!(left <= FAULTS_MAX, "{flaw:?}: {left} faults are left");
        // It is what was planted that breaks the rule.
        let (report, _) = engine::run(
            &scenario::load(&finding.scenario, &[]).unwrap(),
            Engine::Events,
            None,
        )
        .unwrap();
        assert_eq!(report.violations, [], "{flaw:?}");
    }
}
