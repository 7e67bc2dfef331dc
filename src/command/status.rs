use std::io::{self, IsTerminal};
use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use muster_deploy::status::{Answer, Target, ask_all, table, targets};
use serde_json::{Value, json};

use super::{Failure, Outcome, terminal};

/// Refresh period of `--watch`.
const PERIOD: Duration = Duration::from_secs(1);

/// Show the status of drones' processes.
///
/// One row per drone: state, leader, hops, position, battery, restarts and dropped frames. Drones answer if their file has
/// a table `[observe]`. The timeout is two seconds; the row of a silent drone says "no answer" and the exit code is 1.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  muster status 127.0.0.1:9100 pi-3.local:9100
  muster status runs/swarm-short-swarm --watch")]
pub(crate) struct Arguments {
    /// Addresses with ports, drone files, or output folders of muster swarm.
    #[arg(required = true, value_name = "ADDRESS|FILE|FOLDER")]
    drones: Vec<PathBuf>,
    /// Print the full status of all drones as one JSON object.
    #[arg(long)]
    json: bool,
    /// Refresh every second until interrupted.
    #[arg(long)]
    watch: bool,
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let targets = all_targets(arguments)?;
    loop {
        let answers = ask_all(&targets);
        let has_reader = show(arguments, &answers)?;
        if !arguments.watch {
            return match answers.iter().filter(|it| it.status.is_err()).count() {
                0 => Ok(Outcome::Success),
                silent => Err(Failure::NoAnswer(silent, answers.len())),
            };
        }
        if !has_reader {
            return Ok(Outcome::Success);
        }
        std::thread::sleep(PERIOD);
    }
}

fn all_targets(arguments: &Arguments) -> Result<Vec<Target>, Failure> {
    let (mut all, mut unusable) = (Vec::new(), Vec::new());
    for argument in &arguments.drones {
        match targets(argument) {
            Ok(found) => all.extend(found),
            Err(error) => unusable.push(error),
        }
    }
    if unusable.is_empty() {
        Ok(all)
    } else {
        Err(Failure::Input(unusable))
    }
}

/// Prints the status. Returns whether the pipe has a reader.
fn show(arguments: &Arguments, answers: &[Answer]) -> io::Result<bool> {
    if arguments.json {
        let drones: Vec<_> = answers.iter().map(in_json).collect();
        return terminal::print_to_reader(&format!("{}\n", json!({ "drones": drones })));
    }
    let repaints = arguments.watch && io::stdout().is_terminal();
    let clear = if repaints { terminal::CLEAR } else { "" };
    let table = table(answers, terminal::colour(&io::stdout()));
    terminal::print_to_reader(&format!("{clear}{table}"))
}

fn in_json(answer: &Answer) -> Value {
    let error = answer.status.as_ref().err().map(ToString::to_string);
    json!({
        "address": answer.target.address,
        "status": answer.status.as_ref().ok(),
        "error": error,
    })
}
