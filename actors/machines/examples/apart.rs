//! Compares the separation model (`formation/phases.rs`, `formation/exposure.rs`) with motion sampled at 20 Hz, with
//! random delays, stops and landings. Prints a summary; exit code 1 if two drones came closer than predicted.
//!
//! ```sh
//! cargo run --release -p muster-machines --example apart
//! cargo run --release -p muster-machines --example apart -- 4000 100
//! ```
//!
//! Arguments: first seed (default 0) and number of plans (default 10000).

#![allow(clippy::print_stdout, reason = "a command-line program")]

#[path = "../tests/apart/sampled/mod.rs"]
mod sampled;

use std::process::ExitCode;

use sampled::Tally;

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1).map(|it| it.parse::<u64>());
    let mut next = |default: u64| match arguments.next() {
        None => Some(default),
        Some(number) => number.ok(),
    };
    let (Some(first), Some(plans)) = (next(0), next(10_000)) else {
        println!("the arguments must be two whole numbers: first seed and number of plans");
        return ExitCode::from(2);
    };
    let mut tally = Tally::default();
    for seed in first..first.saturating_add(plans) {
        tally.add(&sampled::compare(seed));
    }
    println!("{tally}");
    for violations in tally.violations.iter().take(20) {
        println!("{violations}");
    }
    if tally.violations.is_empty() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}
