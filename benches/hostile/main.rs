//! Hostile traffic during a mission: `cargo bench --bench hostile`, with another number of datagrams as in
//! `cargo bench --bench hostile -- 100000`. Five processes fly; the one that leads is sent random bytes, truncated,
//! replayed, oversized and forged frames as fast as this machine can.

#![allow(
    clippy::unwrap_used,
    reason = "it measures what a test checks, with the same code, and ends where it can't"
)]
#![expect(clippy::print_stdout, reason = "this is a program that prints a table")]

#[path = "../../tests/processes/attack.rs"]
mod attack;
#[path = "../../tests/processes/fleet.rs"]
#[expect(dead_code, reason = "tests of processes use all of it")]
mod fleet;
#[path = "../../tests/processes/network.rs"]
#[expect(dead_code, reason = "its drones are on one machine")]
mod network;

use std::process::ExitCode;
use std::time::Duration;

use self::attack::Attack;

/// How many datagrams are sent, unless another number is given.
const DATAGRAMS: u64 = 1_000_000;
/// The least share of what the other drones say that is to get through.
const DELIVERY_MIN: f64 = 0.9;
/// How much more memory the drone may hold than before, in KiB.
const MEMORY_MAX_KIB: u64 = 4_096;

fn main() -> ExitCode {
    let number = std::env::args().find_map(|it| it.parse().ok());
    let outcome = attack::fly(Attack {
        volleys: 1,
        datagrams: number.unwrap_or(DATAGRAMS),
        pause: Duration::ZERO,
    });
    println!("\n sent to the master of five drones in flight");
    for (kind, n) in outcome.sent {
        println!(" {kind:<26}{n:>12}");
    }
    #[expect(clippy::cast_precision_loss, reason = "it is told in thousands")]
    let rate = outcome.hostile() as f64 / outcome.lasted.as_secs_f64();
    let lasted = outcome.lasted.as_secs_f64();
    println!(
        " {:<26}{:>12}   in {lasted:.1} s, {rate:.0} a second",
        "together",
        outcome.hostile()
    );
    let (least, most) = (outcome.genuine.start(), outcome.genuine.end());
    println!(" {:<26}{:>12}   to {most}", "by the other drones", least);

    println!("\n counted by it");
    for (reason, n) in outcome.counted.iter().filter(|(_, n)| **n > 0) {
        println!(" {:<26}{n:>12}", reason.replace('_', " "));
    }
    println!(" {:<26}{:>12}", "let in", outcome.let_in);
    println!(" {:<26}{:>12}", "together", outcome.accounted());

    let [calm, fire] = outcome.delivery.map(|it| it * 100.0);
    println!("\n delivery of what the others say: {calm:.1} % before, {fire:.1} % under fire");
    let [before, after] = outcome.memory_kib;
    println!(" memory: {before} KiB before, at most {after} KiB until after it");
    let is_first_epoch = |leader: &Vec<_>| leader.len() == 1;
    let checks = [
        ("what was sent is what was counted", outcome.is_balanced()),
        ("nothing hostile was let in", outcome.let_in <= *most),
        (
            "nothing hostile was leader",
            outcome.leader.iter().all(is_first_epoch) && outcome.orders_refused == 0,
        ),
        ("the others were heard", outcome.delivery[1] >= DELIVERY_MIN),
        ("memory stayed flat", after < before + MEMORY_MAX_KIB),
        (
            "all five flew their mission",
            outcome.exit_codes == [Some(0); 5],
        ),
    ];
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
