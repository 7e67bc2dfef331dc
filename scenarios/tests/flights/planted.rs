//! Faults of the protocol, planted one at a time: the search finds each, and makes what it found small.

use std::num::NonZeroUsize;
use std::path::Path;

use muster_machines::flaw::{Flaw, plant};
use muster_scenarios::chaos::{self, Request, Search};

/// In how many plans each is to be found, and how many faults may be left of the plan that finds it.
const PLANS: u64 = 2_000;
const FAULTS_MAX: usize = 3;

/// What is planted, and the rule that it breaks.
const PLANTED: [(Flaw, &[u8]); 16] = [
    (Flaw::NeverStepsDown, &[1]),
    (Flaw::CountsEchoes, &[1]),
    (Flaw::ObeysAnyMaster, &[1]),
    (Flaw::ForgetsOneMember, &[3, 4]),
    (Flaw::LandsOnOnePoint, &[4]),
    (Flaw::LosesCheckpoints, &[1, 2, 3]),
    (Flaw::ForgetsLayers, &[4]),
    (Flaw::ObeysOneWayNeighbours, &[1]),
    (Flaw::AcceptsEarlierLives, &[2]),
    (Flaw::TurnsToWorseBallots, &[1]),
    (Flaw::ReopensWaypoints, &[3, 5]),
    (Flaw::RejoinsWhileLanding, &[3, 4, 5]),
    (Flaw::BelievesAnySender, &[2]),
    (Flaw::LeavesWhatFails, &[1, 5]),
    (Flaw::OverlooksWhoReturns, &[3]),
    (Flaw::NeverClaims, &[1]),
];

/// Each was found first by this many plans; a search from there on is short, and any change that hides one shows.
#[test]
fn the_search_finds_every_planted_fault_and_makes_its_plan_small() {
    let scenario = Path::new(env!("CARGO_MANIFEST_DIR")).join("chaos.toml");
    let jobs = std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
    let mut missed = Vec::new();
    for (flaw, rules) in PLANTED {
        let folder = tempfile::tempdir().unwrap();
        let search = Search::load(&Request {
            scenario: scenario.clone(),
            set: Vec::new(),
            seeds: format!("0..{PLANS}").parse().unwrap(),
        });
        let around = |fly: &mut dyn FnMut()| {
            let _planted = plant(flaw);
            fly();
        };
        let searched = chaos::run(&search.unwrap(), folder.path(), jobs, &around, |_| ()).unwrap();
        let found = searched.finding.map(|it| (it.violation.rule, it.faults.1));
        println!("{flaw:?}: {found:?} after {} plans", searched.plans);
        match found {
            Some((rule, faults)) if rules.contains(&rule) && faults <= FAULTS_MAX => {}
            found => missed.push((flaw, found)),
        }
    }
    assert_eq!(missed, []);
}
