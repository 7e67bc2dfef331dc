//! Compares the model of who may be where (`formation/phases.rs`, `formation/exposure.rs`) with motion that is sampled at
//! 20 Hz, with random delays, stops and descents; prints what there was to it and ends with exit code 1 if two drones came
//! nearer than the model says.
//!
//! ```sh
//! cargo run --release -p muster-machines --example apart
//! cargo run --release -p muster-machines --example apart -- 4000 100
//! ```
//!
//! Arguments: the first seed (0) and how many plans (10000).

#![allow(clippy::print_stdout, reason = "it is there to print")]

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
        println!("takes the first seed and how many plans, two whole numbers");
        return ExitCode::from(2);
    };
    let mut tally = Tally::default();
    for seed in first..first.saturating_add(plans) {
        tally.add(&sampled::compare(seed));
    }
    println!("{tally}");
    for broken in tally.broken.iter().take(20) {
        println!("{broken}");
    }
    if tally.broken.is_empty() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}
