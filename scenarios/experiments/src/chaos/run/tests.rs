use std::num::NonZeroUsize;

use super::super::search::Request;
use super::*;

/// Small swarms with a lossless radio.
const SIMPLE: [&str; 4] = [
    "formation.drones=5",
    "radio.model=range",
    "radio.loss=0",
    "radio.burst_loss=0",
];

fn search(seeds: &str) -> Search {
    let scenario = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/..")).join("chaos.toml");
    Search::load(&Request {
        scenario,
        set: SIMPLE.iter().map(|it| it.parse().unwrap()).collect(),
        seeds: seeds.parse().unwrap(),
        keeps_going: false,
    })
    .unwrap()
}

fn options(jobs: usize) -> RunOptions {
    RunOptions {
        jobs: NonZeroUsize::new(jobs).unwrap(),
        run_limit: RUN_LIMIT,
    }
}

fn searched(seeds: &str, dir: &Path, jobs: usize) -> (u64, f64, Coverage) {
    let searched = run(&search(seeds), dir, options(jobs), &|fly| fly(), |_| ()).unwrap();
    assert!(searched.finding.is_none());
    (searched.plans, searched.simulated_s, searched.coverage)
}

#[test]
fn resumed_search_gives_the_same_result() {
    let [whole, parts] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let (plans, simulated_s, coverage) = searched("0..30", whole.path(), 2);
    assert_eq!(plans, 30);
    searched("0..10", parts.path(), 1);
    let resumed = searched("0..30", parts.path(), 1);
    assert!((resumed.1 - simulated_s).abs() < 1e-6);
    assert_eq!((resumed.0, resumed.2), (plans, coverage));
}

#[test]
fn plan_that_exceeds_its_time_limit_is_a_finding() {
    let folder = tempfile::tempdir().unwrap();
    let options = RunOptions {
        run_limit: Duration::ZERO,
        ..options(2)
    };
    let searched = run(
        &search("3..9"),
        folder.path(),
        options,
        &|fly| fly(),
        |_| (),
    );
    let finding = searched.unwrap().finding.unwrap();
    let what = "the run did not end within 0 s of wall-clock time";
    assert_eq!((finding.seed, finding.violation.rule), (3, 10));
    assert_eq!(finding.violation.what, what);
    assert_eq!(finding.faults.1, 0, "every smaller plan exceeds it too");
    let repeats = search("3..9").command("3..4".parse().unwrap());
    assert_eq!(finding.command, format!("{repeats} --run-limit 0"));
    assert!(finding.scenario.exists());
}

#[test]
fn search_that_keeps_going_lists_the_plans_that_break_a_rule() {
    let folder = tempfile::tempdir().unwrap();
    let mut search = search("3..9");
    search.request.keeps_going = true;
    let options = |seconds| RunOptions {
        run_limit: Duration::from_secs(seconds),
        ..options(2)
    };
    let searched = run(&search, folder.path(), options(0), &|fly| fly(), |_| ()).unwrap();
    let broken: Vec<_> = searched
        .broken
        .iter()
        .map(|it| (it.seed, it.rule))
        .collect();
    assert_eq!(broken, [3, 4, 5, 6, 7, 8].map(|seed| (seed, 10)));
    assert!(searched.finding.is_none() && searched.plans == 6);
    search.request.seeds = "3..12".parse().unwrap();
    let more = run(&search, folder.path(), options(60), &|fly| fly(), |_| ()).unwrap();
    assert_eq!(
        (more.plans, more.broken),
        (9, searched.broken),
        "the search resumed"
    );
}

#[test]
fn drones_too_close_in_an_accepted_exposure_do_not_end_a_search() {
    // A drone is landed by its flight controller in take-off, onto another.
    let searched_in = |file: &str, seeds: &str, set: &str, keeps_going| {
        let scenario = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/..")).join(file);
        let search = Search::load(&Request {
            scenario,
            set: vec![set.parse().unwrap()],
            seeds: seeds.parse().unwrap(),
            keeps_going,
        });
        let folder = tempfile::tempdir().unwrap();
        run(
            &search.unwrap(),
            folder.path(),
            options(1),
            &|fly| fly(),
            |_| (),
        )
        .unwrap()
    };
    let searched =
        |seeds: &str, set: &str, keeps_going| searched_in("chaos.toml", seeds, set, keeps_going);
    let seeds = "323520..323521";
    let accepting = searched(seeds, "limits.altitude_max_m=80", false);
    assert!(accepting.finding.is_none() && accepting.broken.is_empty());
    let [plan] = &accepting.accepted[..] else {
        panic!("{:?}", accepting.accepted);
    };
    assert_eq!(plan.seed, 323_520);
    assert!(plan.exposures.contains(&"killed".to_owned()), "{plan:?}");
    let text = super::super::table(&accepting, muster_scenarios::report::Colour::Never);
    assert!(
        text.starts_with("OK: 1 plan, no rule broken outside of accepted exposures;")
            && text.contains("seed 323520: drones 10 and 13"),
        "{text}"
    );
    // In a plan that accepts nothing they break rule 4.
    let refusing = searched(seeds, "limits={ altitude_max_m = 80 }", true);
    assert_eq!(refusing.accepted, []);
    assert_eq!(refusing.broken[0].rule, 4);
    // One waits on a leg in lockstep, and another flies through it. They are exposed to `apart`, too, but neither flies alone.
    let late = searched("322156..322157", "limits.altitude_max_m=80", false);
    assert_eq!(late.accepted[0].exposures, ["late"]);
    // Neither of the two comes down, and both fly alone.
    let apart = searched("308855..308856", "limits.altitude_max_m=80", false);
    assert_eq!(apart.accepted[0].exposures, ["apart", "both-apart"]);
    // In the only layer above the others, on different legs.
    let accept = "limits.accept=[\"late\", \"apart\", \"both-apart\", \"descends\", \"killed\"]";
    let planted = "tests/data/planted.toml";
    let alone = searched_in(planted, "52954745..52954746", accept, false);
    assert_eq!(alone.accepted[0].exposures, ["both-apart"]);
}

#[test]
fn folder_of_another_search_is_refused_and_unchanged() {
    let dir = tempfile::tempdir().unwrap();
    searched("0..2", dir.path(), 1);
    let kept = fs::read(dir.path().join(state::CHAOS_JSON)).unwrap();
    let refused = run(
        &search("5..7"),
        dir.path(),
        options(1),
        &|fly| fly(),
        |_| (),
    );
    let message = refused.unwrap_err().to_string();
    assert!(message.contains("another search"), "{message}");
    assert_eq!(fs::read(dir.path().join(state::CHAOS_JSON)).unwrap(), kept);
}
