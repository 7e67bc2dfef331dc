use std::io;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use indicatif::ProgressBar;
use muster_daemon::config::TransportName;
use muster_deploy::swarm::{self, Hosts, Request, SwarmError};
use muster_runtime::diagnostic::BadInput;
use muster_scenarios::report::{self, Report};
use muster_scenarios::scenario;

use crate::sim::print;
use crate::{Ended, Failure, folder, terminal};

/// Fly a scenario with a process for each drone, in real time.
///
/// Each drone is a musterd of its own on this machine or, by --hosts, on others, which speaks UDP or QUIC with the others, signed; its
/// vehicle is simulated.
/// The scenario's faults befall the processes (one that is killed gets SIGKILL, one that hangs SIGSTOP), drones hear each
/// other as the scenario's radio would carry, and the rules of a simulation are checked: all but those about what a drone
/// is told. Ends as it began: with no process left, whatever happens to it.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  muster swarm scenarios/hardware/swarm-short.toml --unlimited-range --json | jq .mission_completed")]
pub(crate) struct Arguments {
    /// The scenario file.
    scenario: PathBuf,
    /// How frames move: datagrams to each other drone, or a connection with each.
    #[arg(long, value_enum, default_value_t = Transport::Udp)]
    transport: Transport,
    /// Let every drone hear every other, whatever the scenario's radio would carry.
    #[arg(long)]
    unlimited_range: bool,
    /// A file that says which drones' processes run on which other machines, and how those are reached
    #[arg(long, value_name = "FILE")]
    hosts: Option<PathBuf>,
    /// Print one JSON object on standard output, and nothing else there.
    #[arg(long)]
    json: bool,
    /// The folder to write the report to, with a folder for each drone [default: runs/SCENARIO-swarm]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// The program that drones run [default: the musterd beside this program]
    #[arg(long, value_name = "PROGRAM")]
    musterd: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Transport {
    Udp,
    Quic,
}

impl From<Transport> for TransportName {
    fn from(transport: Transport) -> Self {
        match transport {
            Transport::Udp => Self::Udp,
            Transport::Quic => Self::Quic,
        }
    }
}

impl From<SwarmError> for Failure {
    fn from(error: SwarmError) -> Self {
        match error {
            SwarmError::Refused(input) => input.into(),
            error => Self::Swarm(Box::new(error)),
        }
    }
}

pub(crate) fn run(arguments: &Arguments) -> Result<Ended, Failure> {
    let scenario = scenario::load(&arguments.scenario, &[])?;
    let hosts = arguments.hosts.as_deref();
    let hosts = hosts.map(|path| Hosts::load(path, scenario.plan.nodes()));
    let hosts = hosts.transpose()?;
    let out = arguments
        .out
        .clone()
        .unwrap_or_else(|| folder::of(&arguments.scenario, "swarm"));
    folder::check(&out)?;
    let musterd = musterd(arguments)?;
    let bar = terminal::progress_bar("{msg:>12} {bar:40.cyan/dim} {percent:>3} %");
    let mut watcher = |progress| show(&bar, progress);
    let request = Request {
        path: &arguments.scenario,
        scenario: &scenario,
        musterd: &musterd,
        hosts: hosts.as_ref(),
        transport: arguments.transport.into(),
        folder: &out.join("drones"),
        emulates_radio: !arguments.unlimited_range,
    };
    // On a terminal only.
    bar.println(format!(
        "muster status {} --watch shows each drone meanwhile",
        out.display()
    ));
    let flown = swarm::fly(&request, Some(&mut watcher));
    bar.finish_and_clear();
    let (report, flight) = flown?;
    let written = report::write(&out, &report, &flight)?;
    if arguments.json {
        let json = serde_json::to_string::<Report>(&report).map_err(io::Error::from)?;
        terminal::print(&format!("{json}\n"))?;
    } else {
        print(&report, &written)?;
    }
    Ok(Ended::from(&report))
}

/// The daemon, which stands beside this program wherever both were put.
fn musterd(arguments: &Arguments) -> Result<PathBuf, BadInput> {
    let beside = || Some(std::env::current_exe().ok()?.with_file_name("musterd"));
    let found = arguments.musterd.clone().or_else(beside);
    let found = found.unwrap_or_else(|| PathBuf::from("musterd"));
    if found.is_file() {
        return Ok(found);
    }
    let help = "--musterd takes the path of the daemon's program, which is built with this one";
    Err(BadInput::without_excerpt(&found, "is not there", help))
}

fn show(bar: &ProgressBar, progress: muster_scenarios::engine::Progress) {
    bar.set_length(progress.total);
    bar.set_position(progress.done);
    bar.set_message(format!("{} s", progress.simulated_s));
}
