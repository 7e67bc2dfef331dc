//! Agents: the examples and the crate that `muster new agent` writes do what they are for, with both engines alike.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "agents/contract.rs"]
mod contract;
#[path = "../examples/agents/all.rs"]
mod examples;
#[path = "agents/leaving.rs"]
mod leaving;
#[path = "../src/command/new/agent/lib.rs.txt"]
#[allow(unreachable_pub, reason = "in its own crate it is reachable")]
mod template;

use std::collections::BTreeSet;
use std::fs;
use std::panic;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use assert_cmd::Command;
use muster::agent::{Agent, Context, Destination, Reliability, Telemetry, TimerId};
use muster::report::{MarkKind, Report};
use muster::{Engine, Ned, NodeId, Run, Sim, Stop, Velocity};

/// The agents of the examples, and of the crate that `muster new agent` writes.
fn install() {
    // Another test of this program may have installed them.
    let _ = examples::agents().and(template::agents()).install();
}

fn scenario(name: &str) -> Sim {
    install();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/agents");
    Sim::load(folder.join(name).with_extension("toml")).unwrap()
}

/// Flies with both engines, which agree.
fn fly(sim: &Sim) -> Run {
    let run = sim.run().unwrap();
    let with_actors = sim.clone().engine(Engine::Actors).run().unwrap().report;
    assert_eq!(run.report.trace, with_actors.trace);
    let violations = &run.report.violations;
    assert!(violations.is_empty(), "{violations:?}");
    run
}

/// The largest value of a name that a drone reported.
fn highest(report: &Report, name: &str) -> f64 {
    let values = report.observed.iter().filter(|it| it.name == name);
    values.map(|it| it.value).fold(0.0, f64::max)
}

#[test]
fn lanes_report_all_finds_although_the_leader_is_lost() {
    for seed in 1..=2 {
        let report = fly(&scenario("lanes").seed(seed)).report;
        assert!(report.mission_completed, "seed {seed}");
        assert!(!report.elections.is_empty(), "seed {seed}");
        let finds = highest(&report, "finds");
        assert!((2.5..3.5).contains(&finds), "seed {seed}: {finds}");
    }
}

#[test]
fn drone_on_a_lane_stops_for_a_dead_one_above() {
    install();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/agents");
    let report = fly(&Sim::load(folder.join("comes-down-above-a-lane.toml")).unwrap()).report;
    assert!(report.min_separation_m.unwrap() > 5.0);
    assert!(highest(&report, "finds") > 2.5);
}

#[test]
fn drone_without_position_waits_for_one_that_passes_below_it() {
    install();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/agents");
    let report = fly(&Sim::load(folder.join("passes-below-a-lost-drone.toml")).unwrap()).report;
    assert!(highest(&report, "finds") > 2.5);
}

#[test]
fn drones_on_lanes_without_contact_land() {
    install();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/agents");
    let jammed = Sim::load(folder.join("jammed-on-a-lane.toml")).unwrap();
    let report = fly(&jammed).report;
    assert!(!report.mission_completed);
    let alone = jammed.set("failsafe.alone", "carry-on").unwrap();
    let broken = alone.run().unwrap().report.violations;
    assert_eq!(broken.first().map(|it| it.rule), Some(4));
}

#[test]
fn restarted_process_continues_its_task_with_all_drones_on_task() {
    install();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/agents");
    let report = fly(&Sim::load(folder.join("restart.toml")).unwrap()).report;
    assert!(
        report.agent_failures.is_empty(),
        "{:?}",
        report.agent_failures
    );
    assert!(report.mission_completed);
    assert!(report.elections.is_empty());
    assert!(highest(&report, "finds") > 2.5);
}

#[test]
fn pursuers_surround_the_target() {
    let report = fly(&scenario("pursuit")).report;
    assert!(report.mission_completed);
    let before_landing = |at_s: &f64| *at_s > 200.0;
    let distances = report.observed.iter().filter(|it| before_landing(&it.at_s));
    let (near, all) = distances.fold((0, 0), |(near, all), it| {
        (near + u32::from(it.value < 45.0), all + 1)
    });
    assert!(
        near * 10 > all * 8,
        "{near} of {all} looks are near the ring of 30 m"
    );
}

#[test]
fn flock_reaches_its_place_together() {
    let Run { report, flight } = fly(&scenario("flocking"));
    assert!(report.mission_completed);
    assert!(report.min_separation_m.unwrap() > 5.0);
    let place = Ned::new(300.0, 150.0, 0.0);
    for drone in flight.drones {
        let (_, last) = drone.track.last().unwrap();
        let distance_m = last.horizontal_distance_m(place);
        assert!(distance_m < 80.0, "it lands {distance_m} m from the place");
    }
}

#[test]
fn mule_carries_the_measurements_of_lonely_sensors_to_the_base() {
    let report = fly(&scenario("mule")).report;
    let delivered = report.observed.iter().filter(|it| it.drone == 0);
    let delivered = delivered.map(|it| it.value).fold(0.0, f64::max);
    assert!(delivered > 300.0, "{delivered} measurements");
}

#[test]
fn auctioned_tasks_are_done_although_a_member_is_lost() {
    for seed in 1..=2 {
        let report = fly(&scenario("auction").seed(seed)).report;
        assert!(report.mission_completed, "seed {seed}");
        assert!(highest(&report, "done") > 7.5, "seed {seed}");
    }
}

#[test]
fn crate_that_muster_new_agent_writes_flies() {
    let folder = tempfile::tempdir().unwrap();
    Command::cargo_bin("muster")
        .unwrap()
        .current_dir(folder.path())
        .args(["new", "agent", "my-search"])
        .assert()
        .success();
    let created = folder.path().join("my-search");
    let source = fs::read_to_string(created.join("src/lib.rs")).unwrap();
    assert!(source.contains("my-search.toml") && !source.contains("NAME"));
    assert!(created.join("src/bin/my-searchd.rs").is_file());
    // The agent of the crate is compiled as a part of this test, under the name that stands for all.
    install();
    let scenario = created.join("my-search.toml");
    let unknown = Sim::load(&scenario).unwrap().run().unwrap_err().to_string();
    assert!(unknown.contains("needs the agent `my-search`"), "{unknown}");
    let text = fs::read_to_string(&scenario).unwrap();
    fs::write(
        &scenario,
        text.replace("name = \"my-search\"", "name = \"NAME\""),
    )
    .unwrap();
    let report = fly(&Sim::load(&scenario).unwrap()).report;
    assert!(report.mission_completed);
    let corners = report.observed.iter().map(|it| it.value as u32);
    assert_eq!(corners.collect::<BTreeSet<_>>().len(), 5);
    fs::write(
        &scenario,
        text.replace("name = \"my-search\"", "name = \"lanes\""),
    )
    .unwrap();
    let refused = Sim::load(&scenario).unwrap_err().to_string();
    assert!(refused.contains("refuses its parameters"), "{refused}");
}

#[test]
fn errors_in_what_an_agent_takes_show_their_place_and_what_it_takes() {
    install();
    let lanes = fs::read_to_string("examples/agents/lanes.toml").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let scenario = folder.path().join("search.toml");
    let missions = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios/missions");
    let lanes = lanes.replace("../../scenarios/missions", missions.to_str().unwrap());
    let refused = |from: &str, to: &str| {
        assert!(lanes.contains(from), "{from}");
        fs::write(&scenario, lanes.replace(from, to)).unwrap();
        let refused = Sim::load(&scenario).unwrap_err().to_string();
        // Lines are as wide as the terminal.
        let words = refused.split_whitespace().filter(|it| *it != "│");
        words.collect::<Vec<_>>().join(" ")
    };
    let cases = [
        (
            "length_m = 200",
            "lenght_m = 200",
            "did you mean `length_m`?",
        ),
        (
            "length_m = 200",
            "lenght_m = 200",
            "the agent takes corner_m, length_m, lanes,",
        ),
        ("length_m = 200", "length_m = \"x\"", "expected a number"),
        ("lane_m = 20\n", "", "missing field `lane_m`"),
    ];
    for (from, to, said) in cases {
        let refused = refused(from, to);
        assert!(refused.contains(said), "{refused}");
    }
    let without = lanes.split("[agent]").next().unwrap();
    let missing = refused(&lanes, without);
    assert!(missing.contains("needs a table `[agent]`"), "{missing}");
    assert!(missing.contains("kind = \"agent\" · "), "{missing}");
    let misspelt = refused("length_m = 200", "lenght_m = 200");
    let line = lanes.lines().position(|it| it == "length_m = 200").unwrap() + 1;
    assert!(
        misspelt.contains(&format!("search.toml:{line}:1")),
        "{misspelt}"
    );
}

#[test]
fn existing_folder_is_not_touched_by_muster_new_agent() {
    let folder = tempfile::tempdir().unwrap();
    let of_cargo = ["build", "deps", "examples", "incremental"];
    let others = [".", "Search", "1st", "muster", "fn", "std", "serde"];
    for name in of_cargo.into_iter().chain(others) {
        let run = Command::cargo_bin("muster")
            .unwrap()
            .current_dir(folder.path())
            .args(["new", "agent", name])
            .assert();
        run.code(2);
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

/// A scenario for agents that a test builds.
fn plain() -> Sim {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/agents");
    Sim::load(folder.join("plain.toml")).unwrap()
}

#[test]
fn missing_agents_of_another_swarm_are_refused() {
    install();
    let folder = tempfile::tempdir().unwrap();
    let plain = fs::read_to_string("tests/agents/plain.toml").unwrap();
    let missions = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios/missions");
    let plain = plain.replace("../../scenarios/missions", missions.to_str().unwrap());
    let joins = "[[swarms]]\nscenario = \"other.toml\"\nnorth_m = 2000\neast_m = 0\n";
    let other = plain.replace("name = \"plain\"", "name = \"unknown\"");
    fs::write(folder.path().join("other.toml"), other).unwrap();
    let path = folder.path().join("two.toml");
    fs::write(&path, format!("{plain}\n{joins}")).unwrap();
    let sim = Sim::load(path).unwrap().agents(|_| Box::new(Lazy)).unwrap();
    let refused = sim.run().unwrap_err().to_string();
    assert!(refused.contains("needs the agent `unknown`"), "{refused}");
}

#[test]
fn field_that_is_set_again_has_its_last_value_and_is_shown_once() {
    let sim = Sim::load("thesis-1")
        .unwrap()
        .set("radio.loss", 0.5)
        .unwrap();
    let sim = sim.set("formation.drones", 3).unwrap().seed(5);
    let report = sim.set("radio.loss", 0.1).unwrap().seed(7).run().unwrap();
    let command = &report.report.command;
    assert!(
        command.ends_with(
            "sim thesis-1 --seed 7 --engine events --set formation.drones=3 --set radio.loss=0.1"
        ),
        "{command}"
    );
}

#[test]
fn report_with_agents_of_a_program_has_no_command_that_repeats_it() {
    let sim = plain().agents(|_| Box::new(Landing)).unwrap();
    let report = sim.set("radio.loss", 0.2).unwrap().run().unwrap().report;
    let command = report.command;
    assert!(
        command.starts_with("# flown by a program with agents of its own: "),
        "{command}"
    );
    assert!(
        command.ends_with("plain.toml, seed 1, radio.loss=0.2"),
        "{command}"
    );
}

#[test]
fn run_ends_early_where_a_stop_is_wanted() {
    let asked = Arc::new(AtomicU32::new(0));
    let counted = Arc::clone(&asked);
    let stop = Stop::when(move || counted.fetch_add(1, Ordering::Relaxed) > 0);
    let sim = plain().agents(|_| Box::new(Lazy)).unwrap();
    assert!(sim.run_until(&stop).unwrap().is_none());
    assert!(asked.load(Ordering::Relaxed) < 5);
    let never = Stop::when(|| false);
    let run = sim.run_until(&never).unwrap().unwrap();
    assert_eq!(run.report.trace, sim.run().unwrap().report.trace);
}

#[test]
fn files_are_read_once_and_agents_are_built_once_a_drone() {
    static BUILT: AtomicU32 = AtomicU32::new(0);
    let folder = tempfile::tempdir().unwrap();
    let plain = fs::read_to_string("tests/agents/plain.toml").unwrap();
    let missions = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios/missions");
    let plain = plain.replace("../../scenarios/missions", missions.to_str().unwrap());
    let path = folder.path().join("plain.toml");
    // The seed decides the places.
    fs::write(&path, plain.replace("linear", "random")).unwrap();
    let new = |_| -> Box<dyn Agent> {
        BUILT.fetch_add(1, Ordering::Relaxed);
        Box::new(Landing)
    };
    let sim = Sim::load(&path).unwrap().agents(new).unwrap();
    let first = sim.clone().seed(2).run().unwrap().report.trace;
    assert_eq!(BUILT.load(Ordering::Relaxed), 6, "one is built as a trial");
    fs::write(&path, "").unwrap();
    assert_eq!(sim.clone().seed(2).run().unwrap().report.trace, first);
    assert_ne!(sim.clone().seed(3).run().unwrap().report.trace, first);
    let set = sim.clone().set("seed", 2).unwrap();
    assert_eq!(set.run().unwrap().report.trace, first);
    let large = sim.seed(u64::MAX).run().unwrap_err().to_string();
    assert!(large.contains("the number is too"), "{large}");
}

/// Lands at once.
struct Landing;

impl Agent for Landing {
    fn start(&mut self, context: &mut Context<'_>) {
        context.land();
    }
}

struct Lazy;

impl Agent for Lazy {
    fn start(&mut self, _context: &mut Context<'_>) {}
}

#[test]
fn agent_that_does_nothing_is_landed_when_the_flight_time_is_over() {
    let report = fly(&plain().agents(|_| Box::new(Lazy)).unwrap()).report;
    assert!(!report.mission_completed);
}

/// Fails on each telemetry.
struct Failing;

impl Agent for Failing {
    fn start(&mut self, _context: &mut Context<'_>) {}

    fn telemetry(&mut self, _telemetry: &Telemetry, context: &mut Context<'_>) {
        context.go_to(Ned::new(f64::NAN, 0.0, 0.0));
    }
}

#[test]
fn agent_that_keeps_failing_is_given_up_and_the_others_fly_on() {
    let sim = plain().agents(|id| {
        if id == NodeId(1) {
            Box::new(Failing)
        } else {
            Box::new(Lazy)
        }
    });
    let Run { report, flight } = fly(&sim.unwrap());
    let failures = report.agent_failures.iter();
    let failures: Vec<_> = failures.map(|it| (it.drone, it.what.as_str())).collect();
    let expected = "the destination Ned([[NaN, 0.0, 0.0]]) is not finite";
    assert_eq!(failures, [(1, expected); 6]);
    let marks = flight
        .history
        .marks
        .iter()
        .filter(|it| it.kind == MarkKind::AgentFailure);
    let marks: Vec<_> = marks
        .map(|it| (it.nodes.as_slice(), it.text.as_str()))
        .collect();
    let text = format!("the agent of drone 1 failed: {expected}");
    assert_eq!(marks, [(&[1][..], text.as_str()); 6]);
}

/// Fails with other words each time.
struct Talking(&'static AtomicU32);

impl Agent for Talking {
    fn start(&mut self, context: &mut Context<'_>) {
        context.land();
        let word = self.0.fetch_add(1, Ordering::Relaxed);
        panic::resume_unwind(Box::new(format!("at {word}")));
    }
}

#[test]
fn words_of_a_failed_agent_are_no_part_of_the_trace() {
    static WORDS: AtomicU32 = AtomicU32::new(0);
    let sim = plain().agents(|_| Box::new(Talking(&WORDS))).unwrap();
    let runs = [fly(&sim), fly(&sim)].map(|run| run.report);
    assert_eq!(runs[0].trace, runs[1].trace);
    assert_ne!(runs[0].agent_failures, runs[1].agent_failures);
}

/// Sends as much as it may to everybody, all the time.
struct Flooding;

impl Agent for Flooding {
    fn start(&mut self, context: &mut Context<'_>) {
        self.timer(TimerId(0), context);
    }

    fn timer(&mut self, timer: TimerId, context: &mut Context<'_>) {
        while context
            .send(Destination::All, &[7; 1_000], Reliability::BestEffort)
            .is_ok()
        {}
        context.set_timer(timer, Duration::from_millis(1));
    }
}

#[test]
fn agent_that_floods_the_swarm_breaks_no_rule_and_starts_no_election() {
    let sim = plain().agents(|id| {
        if id == NodeId(1) {
            Box::new(Flooding)
        } else {
            Box::new(Lazy)
        }
    });
    let report = fly(&sim.unwrap()).report;
    assert!(report.elections.is_empty(), "{:?}", report.elections);
}

/// Follows a place that moves north, and reports from a slot.
struct Tracking;

impl Agent for Tracking {
    fn start(&mut self, _context: &mut Context<'_>) {}

    fn telemetry(&mut self, telemetry: &Telemetry, context: &mut Context<'_>) {
        if telemetry.position.north_m() > 200.0 {
            context.land();
        }
        context.track(telemetry.position, Velocity::new(5.0, 0.0, 0.0));
    }
}

#[test]
fn tracked_place_leads_the_drones_away_and_they_land_there() {
    let report = fly(&plain().agents(|_| Box::new(Tracking)).unwrap()).report;
    assert!(report.mission_completed);
}
