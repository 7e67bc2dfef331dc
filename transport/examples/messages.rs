//! Measures messages over the simulated medium: latency and delivery on a line, a large message, and a sender beyond its
//! budget.
//!
//! `cargo run --release -p muster-transport --example messages`

#![allow(clippy::print_stdout, reason = "printing is its purpose")]

#[path = "../tests/messages/figures.rs"]
mod figures;
#[path = "../tests/messages/swarm.rs"]
mod swarm;

use muster_machines::routing::Reliability;

fn main() {
    print_latency();
    print_large_messages();
    print_greedy_sender();
}

fn print_latency() {
    println!(
        "64 B from the first of 15 in line, 160 m apart, to the leader; 802.11a, range 300 m\n"
    );
    println!(
        "{:>16} {:>13} {:>6} {:>9} {:>7} {:>7} {:>7} {:>9} {:>6}",
        "medium",
        "reliability",
        "leader",
        "arrived",
        "p50 ms",
        "p99 ms",
        "max ms",
        "frames",
        "acked"
    );
    let media = [
        ("nakagami 1", swarm::fading(1.0)),
        ("nakagami 3", swarm::fading(3.0)),
        ("nakagami 5", swarm::fading(5.0)),
        ("loss 0 %", swarm::lossy(0.0)),
        ("loss 20 %", swarm::lossy(0.2)),
        ("UDP, loss 20 %", swarm::unreported(0.2)),
    ];
    for (name, config) in media {
        for leader in [7, 14] {
            for reliability in [Reliability::BestEffort, Reliability::Acknowledged] {
                let it = figures::latency(config, leader, reliability, 2_000, 1);
                println!(
                    "{name:>16} {:>13} {leader:>6} {:>7.2} % {:>7.1} {:>7.1} {:>7.0} {:>9.1} {:>5.2} %{}",
                    format!("{reliability:?}"),
                    it.arrived * 100.0,
                    it.median.as_secs_f64() * 1e3,
                    it.p99.as_secs_f64() * 1e3,
                    it.longest.as_secs_f64() * 1e3,
                    it.frames as f64 / 2_000.0,
                    it.acknowledged * 100.0,
                    warning(it.twice + it.over_budget),
                );
            }
        }
    }
}

fn print_large_messages() {
    println!("\n1 MB in pieces over 3 hops\n");
    for (name, config) in [
        ("loss 0 %", swarm::lossy(0.0)),
        ("loss 20 %", swarm::lossy(0.2)),
        ("UDP, loss 0 %", swarm::unreported(0.0)),
        ("UDP, loss 20 %", swarm::unreported(0.2)),
        ("nakagami 3", swarm::fading(3.0)),
    ] {
        let it = figures::large(config, 3, 1_000_000, 1);
        let took = it.took.map_or("never".to_owned(), |it| {
            format!("{:.1} s", it.as_secs_f64())
        });
        println!(
            "{name:>16} whole after {took}, acknowledged: {}, {:.2} bytes sent a byte{}",
            it.is_acknowledged,
            it.bytes_a_byte,
            warning(it.over_budget)
        );
    }
}

fn print_greedy_sender() {
    println!("\nThirteen senders of one message a second, without and with one that sends 400\n");
    for (name, config) in [
        ("nakagami 3", swarm::fading(3.0)),
        ("loss 20 %", swarm::lossy(0.2)),
        ("UDP, loss 20 %", swarm::unreported(0.2)),
    ] {
        for is_greedy in [false, true] {
            let it = figures::beside(config, is_greedy, 1);
            println!(
                "{name:>16} {} of {} arrived, p50 {:.1} ms; the greedy one {:.1} a second{}",
                it.arrived,
                it.sent,
                it.median.as_secs_f64() * 1e3,
                it.greedy_hz,
                warning(it.over_budget)
            );
        }
    }
}

fn warning(count: usize) -> String {
    if count == 0 {
        String::new()
    } else {
        format!("; {count} frames over a budget, or messages received twice")
    }
}
