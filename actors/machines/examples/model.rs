//! Searches the model of elections and merging partitions. Prints the size of each search and the rules that hold; exit
//! code 1 if a rule is violated.
//!
//! ```sh
//! cargo run --release -p muster-machines --example model
//! cargo run --release -p muster-machines --example model -- --nodes 4 --depth 12 --crashes 1 --splits 1
//! ```
//!
//! Without arguments it runs the cases below and the deliberate flaws. With arguments it runs one case: `--nodes N`
//! (3), `--depth STEPS` (all), `--crashes N`, `--failures N` (of actors), `--splits N`, `--one-way N`, `--suspicions N`
//! (0 each), `--mailboxes` (actors handle their messages in any order), `--settling` (also follows every state until
//! nothing changes).

#![allow(clippy::print_stdout, reason = "a command-line program")]
#![allow(
    clippy::disallowed_methods,
    reason = "the duration of a search is not part of the model"
)]

#[path = "../tests/model/swarm/mod.rs"]
mod swarm;

use std::num::NonZeroUsize;
use std::process::ExitCode;
use std::time::Instant;

use swarm::{Faults, Flaw, Found, Pace, Swarm, search};

const NONE: Faults = Faults::NONE;

/// One search.
#[derive(Debug, Clone, Copy)]
struct Case {
    nodes: u32,
    faults: Faults,
    pace: Pace,
    depth: Option<NonZeroUsize>,
    settles: bool,
}

/// All searched completely, except the last two; takes some minutes in all.
const CASES: [&str; 14] = [
    "--nodes 3 --splits 1 --settling",
    "--nodes 3 --crashes 1 --splits 1",
    "--nodes 3 --crashes 1 --failures 1",
    "--nodes 3 --failures 1 --splits 1",
    "--nodes 3 --crashes 1 --suspicions 1",
    "--nodes 3 --splits 1 --suspicions 1",
    "--nodes 3 --crashes 1 --one-way 1",
    "--nodes 3 --splits 2",
    "--nodes 3 --crashes 2",
    "--nodes 2 --crashes 1 --mailboxes",
    "--nodes 4 --splits 1",
    "--nodes 4 --crashes 1",
    "--nodes 4 --crashes 1 --splits 1 --depth 12",
    "--nodes 3 --crashes 1 --splits 1 --mailboxes --depth 14",
];

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let cases: Result<Vec<Case>, String> = if arguments.is_empty() {
        CASES.iter().map(|case| parse(case.split(' '))).collect()
    } else {
        parse(arguments.iter().map(String::as_str)).map(|case| vec![case])
    };
    match cases {
        Ok(cases) if arguments.is_empty() => run(&cases, &Flaw::ALL),
        Ok(cases) => run(&cases, &[]),
        Err(problem) => {
            println!("{problem}");
            ExitCode::from(2)
        }
    }
}

fn parse<'a>(mut arguments: impl Iterator<Item = &'a str>) -> Result<Case, String> {
    let mut case = Case {
        nodes: 3,
        faults: NONE,
        pace: Pace::Prompt,
        depth: None,
        settles: false,
    };
    while let Some(name) = arguments.next() {
        match name {
            "--mailboxes" => {
                case.pace = Pace::Mailboxes;
                continue;
            }
            "--settling" => {
                case.settles = true;
                continue;
            }
            _ => {}
        }
        let number = arguments.next().and_then(|it| it.parse::<u8>().ok());
        let number = number.ok_or_else(|| format!("{name} needs a number from 0 to 255"))?;
        match name {
            "--nodes" if (2..=8).contains(&number) => case.nodes = number.into(),
            "--nodes" => return Err(format!("--nodes must be from 2 to 8, found {number}")),
            "--depth" => case.depth = NonZeroUsize::new(number.into()),
            "--crashes" => case.faults.crashes = number,
            "--failures" => case.faults.failures = number,
            "--splits" => case.faults.splits = number,
            "--one-way" => case.faults.one_way = number,
            "--suspicions" => case.faults.suspicions = number,
            _ => {
                return Err(format!(
                    "unknown argument {name}; arguments are listed at the top of examples/model.rs"
                ));
            }
        }
    }
    Ok(case)
}

/// Runs all searches and prints a line for each.
fn run(cases: &[Case], flaws: &[(Flaw, Faults, Pace, &str)]) -> ExitCode {
    println!(
        "{:>5} {:<36} {:<9} {:>10} {:>10} {:>5} {:<9} {:>7}  rules",
        "nodes", "faults allowed", "actors", "reached", "states", "depth", "exhausted", "seconds"
    );
    let mut all_hold = true;
    for case in cases {
        let mut swarm = Swarm::new(case.nodes, case.faults, case.pace);
        if case.settles {
            swarm = swarm.that_settles();
        }
        let found = print(*case, swarm);
        let holds =
            found.violated.is_empty() && (found.unreached.is_empty() || !found.is_exhausted);
        all_hold &= holds;
        println!(
            "{}",
            match (holds, case.settles) {
                (true, true) => "1a 1b 1c hold; settles",
                (true, false) => "1a 1b 1c hold",
                (false, _) => "VIOLATED",
            }
        );
        for (name, steps) in &found.violated {
            println!("      {name}: {steps}");
        }
        for name in &found.unreached {
            println!("      never reached: {name}");
        }
    }
    for (flaw, faults, pace, rule) in flaws {
        let case = Case {
            nodes: 3,
            faults: *faults,
            pace: *pace,
            depth: None,
            settles: false,
        };
        let found = print(case, Swarm::new(3, *faults, *pace).with(*flaw));
        let is_found = found.violated.iter().any(|(name, _)| name == rule);
        all_hold &= is_found;
        let result = if is_found { "detected" } else { "NOT DETECTED" };
        println!("deliberate flaw {flaw:?} {result}: {rule}");
    }
    if all_hold {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}

fn print(case: Case, swarm: Swarm) -> Found {
    let start = Instant::now();
    let found = search(swarm, case.depth);
    print!(
        "{:>5} {:<36} {:<9} {:>10} {:>10} {:>5} {:<9} {:>7.1}  ",
        case.nodes,
        case.faults.to_string(),
        match case.pace {
            Pace::Prompt => "prompt",
            Pace::Mailboxes => "mailboxes",
        },
        found.reached,
        found.states,
        found.depth,
        if found.is_exhausted { "yes" } else { "no" },
        start.elapsed().as_secs_f64(),
    );
    found
}
