use std::io;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use indicatif::ProgressBar;
use muster_daemon::config::TransportName;
use muster_deploy::hosts::Hosts;
use muster_deploy::swarm::{self, Prepared, Request, SwarmError};
use muster_experiments::output;
use muster_runtime::diagnostic::BadInput;
use muster_scenarios::report::Report;
use muster_scenarios::scenario::{self, Override, Scenario};

use super::overrides::Overrides;
use super::recordings::Recordings;
use super::sim::print;
use super::{Failure, Outcome, folder, terminal};

/// Fly a scenario in real time, with one process per drone.
///
/// Each drone is a musterd process on this machine or, with --hosts, on others. The processes exchange signed frames over
/// UDP or QUIC; the vehicles are simulated, in this process if they have flight controllers. The scenario's faults are
/// injected into the processes: SIGKILL for a kill, SIGSTOP for a hang. The scenario's radio model decides which drones
/// hear each other. The rules of the simulation are checked, except those about the input of a drone and about RC. No process
/// is left at the end, even after an error. Ctrl-C ends the flight at once; the report of what was flown is written, and the
/// exit code is 1.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  muster swarm swarm-short --unlimited-range --json | jq .mission_completed
  muster swarm swarm-short --prepare my-swarm")]
pub(crate) struct Arguments {
    /// A scenario file, or the name of a shipped scenario (`muster list`).
    #[arg(value_name = "SCENARIO")]
    scenario: PathBuf,
    #[command(flatten)]
    overrides: Overrides,
    /// Transport: UDP datagrams, or a QUIC connection to each drone.
    #[arg(long, value_enum, default_value_t = Transport::Udp)]
    transport: Transport,
    /// Let every drone hear every other; ignore the scenario's radio range and losses.
    #[arg(long)]
    unlimited_range: bool,
    /// Hosts file: assigns drones to other machines and says how to reach those
    #[arg(long, value_name = "FILE")]
    hosts: Option<PathBuf>,
    /// Print the report as one JSON object instead of the table.
    #[arg(long)]
    json: bool,
    /// Output folder, with a subfolder per drone [default: runs/SCENARIO-swarm, with -2, -3, … appended if it is used]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Only write keys, and a file for each drone's musterd, into a new folder; start nothing
    #[arg(long, value_name = "DIR", conflicts_with_all = ["firmware", "json", "out", "unlimited_range"])]
    prepare: Option<PathBuf>,
    /// Path of musterd, or of your agent's [default: next to this program, by its name and a d]
    #[arg(long, value_name = "PROGRAM")]
    musterd: Option<PathBuf>,
    /// Betaflight's software build, which is then the flight controllers' firmware instead of our simulation; needs root, for
    /// a network namespace each
    #[arg(long, value_name = "PROGRAM")]
    firmware: Option<PathBuf>,
    #[command(flatten)]
    recordings: Recordings,
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

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let overrides = arguments.overrides.all(&arguments.scenario)?;
    let scenario = scenario::load(&arguments.scenario, &overrides)?;
    let hosts = arguments.hosts.as_deref();
    let hosts = hosts.map(|path| Hosts::load(path, scenario.plan.nodes()));
    let hosts = hosts.transpose()?;
    if let Some(folder) = &arguments.prepare {
        return prepare(arguments, (&scenario, &overrides), (folder, hosts.as_ref()));
    }
    let out = arguments.out.clone().unwrap_or_else(|| {
        // No flight in real time repeats, so each gets a folder.
        output::numbered(&folder::default_for(&arguments.scenario, "swarm"), |_| {
            false
        })
    });
    folder::check_writable(&out)?;
    arguments.recordings.check(&out)?;
    let musterd = musterd(arguments)?;
    let bar = terminal::progress_bar("{msg:>12} {bar:40.cyan/dim} {percent:>3} %");
    let mut watcher = |progress| show(&bar, progress);
    let request = Request {
        path: &arguments.scenario,
        overrides: &overrides,
        scenario: &scenario,
        musterd: &musterd,
        hosts: hosts.as_ref(),
        transport: arguments.transport.into(),
        folder: &out.join("drones"),
        firmware: arguments.firmware.as_deref(),
        emulates_radio: !arguments.unlimited_range,
    };
    // The hidden bar, without a terminal, prints nothing.
    bar.println(format!(
        "Show the drones with: muster status {} --watch",
        out.display()
    ));
    let flown = swarm::fly(&request, Some(&mut watcher));
    bar.finish_and_clear();
    let (report, mut flight) = flown?;
    if arguments.unlimited_range {
        flight.forget_links();
    }
    let written = output::write(&out, &report, &flight)?;
    let recordings = arguments.recordings.write(&report, &flight)?;
    if arguments.json {
        let json = serde_json::to_string::<Report>(&report).map_err(io::Error::from)?;
        terminal::print(&format!("{json}\n"))?;
    } else {
        print(&report, &written, &recordings)?;
    }
    match Outcome::from(&report) {
        Outcome::MissionIncomplete if report.interrupted => Err(Failure::Interrupted),
        outcome => Ok(outcome),
    }
}

/// Writes the files of a flight and shows how to start its processes.
fn prepare(
    arguments: &Arguments,
    (scenario, overrides): (&Scenario, &[Override]),
    (folder, hosts): (&Path, Option<&Hosts>),
) -> Result<Outcome, Failure> {
    folder::check_writable(folder)?;
    let files = swarm::prepare(&Request {
        path: &arguments.scenario,
        overrides,
        scenario,
        musterd: Path::new("musterd"),
        firmware: None,
        hosts,
        transport: arguments.transport.into(),
        folder,
        emulates_radio: false,
    })?;
    let name = scenario::scenario_file(&arguments.scenario)?;
    let scenario_file = (folder.join("scenario")).join(name.file_name().unwrap_or_default());
    let leader = scenario.plan.centre();
    let mut text = format!(
        "wrote {}: the keys of a fleet, and a file for each of {} processes\nStart them, the leader last:\n",
        folder.display(),
        files.len()
    );
    let drones = files.iter().filter_map(|it| Some((it.id, it.controller?)));
    for (id, address) in drones {
        let scenario = scenario_file.display();
        text.push_str(&format!(
            "  muster fc simulate --listen {address} --scenario {scenario} --drone {id}\n"
        ));
    }
    let (leads, others): (Vec<_>, Vec<_>) = files.iter().partition(|it| it.id == leader);
    for Prepared { id, file, .. } in others.into_iter().chain(leads) {
        let fly = if *id == leader { " --fly" } else { "" };
        text.push_str(&format!("  musterd --config {}{fly}\n", file.display()));
    }
    text.push_str(&format!(
        "Watch them with: muster status {} --watch\n",
        folder.display()
    ));
    terminal::print(&text)?;
    Ok(Outcome::Success)
}

/// The daemon's program: the argument, or the one next to this program whose name has a `d` more.
fn musterd(arguments: &Arguments) -> Result<PathBuf, BadInput> {
    let found = match &arguments.musterd {
        Some(given) => given.clone(),
        None => beside().unwrap_or_else(|| PathBuf::from("musterd")),
    };
    if found.is_file() {
        return Ok(found);
    }
    let name = found.file_name().unwrap_or_default().display();
    let (message, help) = match &arguments.musterd {
        Some(_) => (
            "does not exist".to_owned(),
            "--musterd takes the path of the program musterd, or of your agent's",
        ),
        None => (
            format!("the program {name} is not beside this one"),
            "for muster's own protocols `cargo install --locked --path runtime/daemon` puts it there; or give its path \
             with --musterd",
        ),
    };
    Err(BadInput::without_excerpt(&found, message, help))
}

fn beside() -> Option<PathBuf> {
    let own = std::env::current_exe().ok()?;
    let mut name = own.file_name()?.to_owned();
    name.push("d");
    Some(own.with_file_name(name))
}

fn show(bar: &ProgressBar, progress: muster_scenarios::engine::Progress) {
    bar.set_length(progress.total);
    bar.set_position(progress.done);
    bar.set_message(format!("{} s", progress.simulated_s));
}
