//! Hostile traffic during a mission: `cargo bench --bench hostile`, or `cargo bench --bench hostile -- 100000` for another
//! number of datagrams. Five processes fly. The master receives random bytes and truncated, replayed, oversized and forged
//! frames as fast as this machine can send them.

#![allow(
    clippy::unwrap_used,
    reason = "it shares the code of a test, and stops if it can't measure"
)]
#![expect(clippy::print_stdout, reason = "this is a program that prints a table")]

#[path = "../../tests/processes/attack.rs"]
mod attack;
#[path = "../../tests/processes/fleet.rs"]
#[expect(dead_code, reason = "the process tests use all of it")]
mod fleet;
#[path = "../../tests/processes/network.rs"]
#[expect(dead_code, reason = "all drones run on one machine")]
mod network;

use std::process::ExitCode;
use std::time::Duration;

use self::attack::{Attack, Outcome};

/// Default number of datagrams.
const DATAGRAMS: u64 = 1_000_000;
/// Minimum delivery ratio of the other drones' frames.
const DELIVERY_MIN: f64 = 0.9;
/// Maximum growth of the drone's memory, in KiB.
const MEMORY_MAX_KIB: u64 = 4_096;

fn main() -> ExitCode {
    let number = std::env::args().find_map(|it| it.parse().ok());
    let outcome = attack::fly(Attack {
        volleys: 1,
        datagrams: number.unwrap_or(DATAGRAMS),
        pause: Duration::ZERO,
    });
    print(&outcome);
    let checks = checks(&outcome);
    println!();
    for (what, holds) in checks {
        println!(" {} {what}", if holds { "yes" } else { "NO " });
    }
    if checks.iter().all(|(_, holds)| *holds) {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}

/// Prints what was sent, what the master counted, and what it cost the others and the master.
fn print(outcome: &Outcome) {
    println!("\n sent to the master of five drones in flight");
    for (kind, n) in outcome.sent {
        println!(" {kind:<26}{n:>12}");
    }
    #[expect(clippy::cast_precision_loss, reason = "only the thousands are shown")]
    let rate = outcome.hostile() as f64 / outcome.duration.as_secs_f64();
    let lasted = outcome.duration.as_secs_f64();
    println!(
        " {:<26}{:>12}   in {lasted:.1} s, {rate:.0} per second",
        "total",
        outcome.hostile()
    );
    let (least, most) = (outcome.genuine.start(), outcome.genuine.end());
    println!(" {:<26}{:>12}   to {most}", "by the other drones", least);

    println!("\n counted by the master");
    for (reason, n) in outcome.counted.iter().filter(|(_, n)| **n > 0) {
        println!(" {:<26}{n:>12}", reason.replace('_', " "));
    }
    println!(" {:<26}{:>12}", "accepted", outcome.let_in);
    println!(" {:<26}{:>12}", "total", outcome.accounted());

    let [before, during] = outcome.delivery.map(|it| it * 100.0);
    println!(
        "\n delivery ratio of the others' frames: {before:.1} % before, {during:.1} % during the attack"
    );
    let [before, after] = outcome.memory_kib;
    println!(" memory: {before} KiB before, at most {after} KiB during and after it");
}

/// What must hold, and whether it does.
fn checks(outcome: &Outcome) -> [(&'static str, bool); 6] {
    let most = outcome.genuine.end();
    let [before, after] = outcome.memory_kib;
    let is_first_epoch = |ballots: &Vec<_>| ballots.len() == 1;
    [
        ("all sent datagrams are counted", outcome.is_balanced()),
        ("no hostile frame was accepted", outcome.let_in <= *most),
        (
            "no hostile order was followed",
            outcome.ballots.iter().all(is_first_epoch) && outcome.orders_refused == 0,
        ),
        (
            "the others were received",
            outcome.delivery[1] >= DELIVERY_MIN,
        ),
        ("memory did not grow", after < before + MEMORY_MAX_KIB),
        (
            "all five completed the mission",
            outcome.exit_codes == [Some(0); 5],
        ),
    ]
}
