//! Planted flaws of the protocol: the search finds each one and shrinks its plan.

use std::num::NonZeroUsize;

use muster_experiments::campaign::RunOptions;
use muster_experiments::chaos::{self, Request, Search};
use muster_machines::flaw::{Flaw, plant};
use muster_scenarios::engine::{self, Engine};
use muster_scenarios::scenario;

use crate::support;

/// Maximum number of plans to find a flaw.
const PLANS: u64 = 2_000;
/// The same for hidden flaws.
const HIDDEN_PLANS: u64 = 4_000;
/// The same for flaws of the altitude layers.
const LAYER_PLANS: u64 = 500;
/// Maximum number of faults left after shrinking.
const FAULTS_MAX: usize = 3;

const PLANTED: [Flaw; 14] = [
    Flaw::NeverStepsDown,
    Flaw::AcceptsRepeatedHeartbeats,
    Flaw::FollowsAnyBallot,
    Flaw::IgnoresLastMember,
    Flaw::LandsOnOnePoint,
    Flaw::LosesCheckpoints,
    Flaw::PrefersWorseBallots,
    Flaw::ReopensWaypoints,
    Flaw::RejoinsWhileLanding,
    Flaw::SkipsSignatureCheck,
    Flaw::IgnoresFailedActors,
    Flaw::NeverClaims,
    Flaw::SkipsFreshnessProof,
    Flaw::SetsPastDeadline,
];

/// Flaws that take more plans to find.
const HIDDEN: [Flaw; 3] = [
    Flaw::SkipsLayers,
    Flaw::AcceptsEarlierIncarnations,
    Flaw::IgnoresReturnedMembers,
];

#[test]
fn search_finds_and_shrinks_every_planted_flaw() {
    assert_found("tests/data/planted.toml", &[], PLANS, &PLANTED);
}

/// Flaws of the altitude layers, tested without deconfliction.
#[test]
#[ignore = "takes a minute: cargo test --release -p muster-experiments --features flaws --test experiments layers -- --ignored"]
fn search_finds_every_flaw_of_the_altitude_layers() {
    let layers = [
        Flaw::TakesOffInOneLayer,
        Flaw::FliesToLandingInOneLayer,
        Flaw::SkipsLayers,
    ];
    // Lossless links: with losses some plans need deconfliction. No exposures are accepted, which these flaws would hide in.
    let lossless = [
        "limits={ altitude_max_m = 80, separation_vertical_m = 0.6 }",
        "safety.avoid=false",
        "protocol.kind=muscop",
        "formation.spacing_m=60",
        "radio.model=range",
        "radio.loss=0",
        "radio.burst_loss=0",
    ];
    assert_found("chaos.toml", &lossless, LAYER_PLANS, &layers);
    let changes = "changes=[{ waypoint = 1, kind = \"compact-matrix\" }, { waypoint = 3, kind = \"linear\" }]";
    let crosses = [&lossless[..], &[changes]].concat();
    assert_found(
        "chaos.toml",
        &crosses,
        LAYER_PLANS,
        &[Flaw::CrossesInOneSector],
    );
}

#[test]
#[ignore = "takes minutes: cargo test --release -p muster-experiments --features flaws --test experiments hidden -- --ignored"]
fn search_finds_hidden_flaws() {
    assert_found("tests/data/planted.toml", &[], HIDDEN_PLANS, &HIDDEN);
    // One-way links seldom divide a swarm, but in a line each may.
    let lines = [
        "protocol.policy=tree",
        "chaos.vary={ \"formation.drones\" = [5, 8, 11, 14] }",
    ];
    let flaw = [Flaw::AcceptsOneWayLinks];
    assert_found("tests/data/planted.toml", &lines, HIDDEN_PLANS, &flaw);
}

/// The search does not find this flaw, because no rule limits the barrier wait on fading links. The wait is many times longer.
#[test]
fn routing_by_hop_count_lengthens_barriers_on_fading_links() {
    let (waits_ms, elections) = fading_flights();
    assert!(waits_ms < 40.0, "{waits_ms} ms");
    assert_eq!(elections, 0);
    let _planted = plant(Flaw::RoutesByHops);
    let (by_hops_ms, _) = fading_flights();
    assert!(by_hops_ms > waits_ms * 4.0, "{by_hops_ms} ms");
}

/// Median barrier wait in milliseconds and number of elections, of 20 flights without faults over fading links.
fn fading_flights() -> (f64, usize) {
    let (mut waits_ms, mut elections) = (Vec::new(), 0);
    for seed in 0..20 {
        let seed = format!("seed={seed}");
        let scenario = support::scenario("tests/data/planted-radio.toml", &[&*seed]);
        let (report, _) = engine::run(&scenario, Engine::Events, None).unwrap();
        assert_eq!(report.violations, [], "{seed}");
        waits_ms.extend(report.barriers.iter().map(|it| it.wait_s() * 1e3));
        elections += report.elections.len();
    }
    waits_ms.sort_by(f64::total_cmp);
    (waits_ms[waits_ms.len() / 2], elections)
}

fn assert_found(scenario: &str, set: &[&str], plans: u64, planted: &[Flaw]) {
    let scenario = support::shipped(scenario);
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
        let options = RunOptions {
            jobs,
            run_limit: chaos::RUN_LIMIT,
        };
        let searched =
            chaos::run(&search.unwrap(), folder.path(), options, &around, |_| ()).unwrap();
        let Some(finding) = searched.finding else {
            panic!("{flaw:?} is not found in {plans} plans");
        };
        let left = finding.faults.1;
        assert!(left <= FAULTS_MAX, "{flaw:?}: {left} faults are left");
        // Without the planted flaw, the scenario breaks no rule.
        let (report, _) = engine::run(
            &scenario::load(&finding.scenario, &[]).unwrap(),
            Engine::Events,
            None,
        )
        .unwrap();
        assert_eq!(report.violations, [], "{flaw:?}");
    }
}
