//! An agent that takes too long in a process: counted, logged and shown, and the swarm flies on.

use std::ffi::OsString;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use muster::agent::{Agent, Context, Telemetry};
use muster::{AgentFactory, AgentSpec, Agents, NodeId};
use muster_daemon::config::DroneConfig;
use muster_daemon::daemon::{self, Ended, Start};

use super::fleet::{Fleet, Process, SCENARIO, replace, run_command};

/// Names the drone's file to the test that is a drone.
const FILE: &str = "MUSTER_TEST_DRONE";
const SLOW: NodeId = NodeId(1);
const LOOPS_FOR: Duration = Duration::from_millis(200);
/// Calls until the drones land.
const CALLS: u32 = 20;

/// Loops at each call if it is that of the slow drone.
struct Looping {
    is_slow: bool,
    calls: u32,
}

impl Agent for Looping {
    fn start(&mut self, _context: &mut Context<'_>) {}

    fn telemetry(&mut self, _telemetry: &Telemetry, context: &mut Context<'_>) {
        let began = Instant::now();
        while self.is_slow && began.elapsed() < LOOPS_FOR {
            std::hint::spin_loop();
        }
        self.calls += 1;
        if self.calls == CALLS {
            context.land();
        }
    }
}

/// The process of a drone: `musterd` with this agent.
#[test]
#[ignore = "a process of the test below"]
fn drone() {
    let new = |spec: &AgentSpec| {
        Ok::<_, String>(Looping {
            is_slow: spec.id == SLOW,
            calls: 0,
        })
    };
    let agents = Agents::default().with("looping", AgentFactory::new(new));
    agents.install().unwrap();
    let file: OsString = std::env::var_os(FILE).expect("the test below starts this one");
    let config = DroneConfig::load(Path::new(&file)).unwrap();
    let start = Start {
        fly: config.leads(),
        ..Start::default()
    };
    assert_eq!(daemon::run(config, start).unwrap(), Ended::Completed);
}

fn start(fleet: &Fleet, id: u32) -> Process {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command
        .args(["--exact", "real_time::slow_agent::drone", "--ignored"])
        .env(FILE, fleet.file(id))
        .stdout(Stdio::null());
    Process::start(id, command)
}

#[test]
fn agent_that_loops_for_200_ms_is_counted_logged_and_shown_and_the_swarm_lands() {
    let fleet = Fleet::new();
    let missions = concat!(env!("CARGO_MANIFEST_DIR"), "/scenarios/missions");
    let scenario = fs::read_to_string(SCENARIO).unwrap();
    let scenario = scenario
        .replace("../missions", missions)
        .replace("[protocol]", "[protocol]\nkind = \"agent\"");
    let path = fleet.path("looping.toml");
    fs::write(&path, scenario + "\n[agent]\nname = \"looping\"\n").unwrap();
    for id in 0..5 {
        replace(&fleet.file(id), SCENARIO, path.to_str().unwrap());
    }
    let mut drones: Vec<_> = (0..5).map(|id| start(&fleet, id)).collect();

    let slow = &mut drones[SLOW.0 as usize];
    slow.wait_for("the agent is slow", |line| {
        line["method"] == "telemetry" && line["took_ms"].as_u64().is_some_and(|it| it >= 200)
    });
    let status = fleet.status(SLOW.0);
    assert!(status["agent"]["slow_calls"].as_u64().unwrap() > 0);
    assert!(status["agent"]["longest_call_s"].as_f64().unwrap() >= 0.2);
    let (_, metrics) = fleet.get(SLOW.0, "/metrics");
    let counted = metrics
        .lines()
        .find_map(|line| line.strip_prefix("muster_agent_slow_calls_total "));
    assert!(counted.unwrap().parse::<u64>().unwrap() > 0, "{metrics}");
    let mut command = Command::new(env!("CARGO_BIN_EXE_muster"));
    let (_, table) = run_command(command.args(["status", &fleet.address(SLOW.0)]));
    assert!(table.contains("drone 1 its agent is slow"), "{table}");
    for drone in &mut drones {
        assert_eq!(drone.end(), Some(0));
    }
}
