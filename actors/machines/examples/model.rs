//! Searches the model of election and merging, prints how much there was to it and which rules hold, and ends with
//! exit code 1 if one does not.
//!
//! ```sh
//! cargo run --release -p muster-machines --example model
//! cargo run --release -p muster-machines --example model -- --nodes 4 --depth 12 --crashes 1 --splits 1
//! ```
//!
//! Without arguments: the cases below, and what is broken on purpose. Others are composed of `--nodes N` (3),
//! `--depth STEPS` (all), `--crashes N`, `--failures N` (of actors), `--splits N`, `--one-way N`, `--suspicions N` (0
//! each), `--mailboxes`: each actor takes its messages when it comes to it, and `--settling`: every state is followed
//! until nothing changes any more, too.

#![allow(clippy::print_stdout, reason = "it is there to print")]
#![allow(
    clippy::disallowed_methods,
    reason = "how long a search takes is no part of the model"
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

/// Searched to the end, the last two apart; the whole takes some minutes.
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
        let number = number.ok_or_else(|| format!("{name}: a number from 0 to 255 is missing"))?;
        match name {
            "--nodes" if (2..=8).contains(&number) => case.nodes = number.into(),
            "--nodes" => return Err("--nodes: from 2 to 8".to_owned()),
            "--depth" => case.depth = NonZeroUsize::new(number.into()),
            "--crashes" => case.faults.crashes = number,
            "--failures" => case.faults.failures = number,
            "--splits" => case.faults.splits = number,
            "--one-way" => case.faults.one_way = number,
            "--suspicions" => case.faults.suspicions = number,
            _ => {
                return Err(format!(
                    "{name}: not an argument; they are named at the head of examples/model.rs"
                ));
            }
        }
    }
    Ok(case)
}

/// Prints a line for each search as it ends.
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
        let holds = found.broken.is_empty() && (found.missing.is_empty() || !found.is_exhausted);
        all_hold &= holds;
        println!(
            "{}",
            match (holds, case.settles) {
                (true, true) => "1a 1b 1c hold; settles",
                (true, false) => "1a 1b 1c hold",
                (false, _) => "BROKEN",
            }
        );
        for (name, steps) in &found.broken {
            println!("      {name}: {steps}");
        }
        for name in &found.missing {
            println!("      not met with: {name}");
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
        let is_found = found.broken.iter().any(|(name, _)| name == rule);
        all_hold &= is_found;
        let verdict = if is_found { "is found" } else { "IS NOT FOUND" };
        println!("{flaw:?}, broken on purpose, {verdict}: {rule}");
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
