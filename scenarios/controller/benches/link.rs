//! Cost of a link to a flight controller, and of the simulated controller: `cargo bench -p muster-controller --bench link`. A drone
//! hovers for a minute 20 m high, with GPS.

#![expect(
    clippy::print_stdout,
    clippy::disallowed_methods,
    clippy::unwrap_used,
    reason = "this is a program that measures times and prints a table"
)]

#[allow(dead_code, reason = "a hover needs no faults")]
#[path = "../tests/controller/flown.rs"]
mod flown;

use std::time::{Duration, Instant};

use muster_controller::{Config, Settings};
use muster_machines::geodetic::Geodetic;
use muster_machines::machine::{Machine, Output};
use muster_machines::msp::controller::Receiver;
use muster_machines::msp::{ControllerLink, Event, Input, Transmit};
use muster_machines::time::Timestamp;

use crate::flown::Flown;

const HOVER: Duration = Duration::from_secs(60);

/// A link whose calls are timed.
struct Timed {
    link: ControllerLink,
    deadline: Option<Timestamp>,
    steps: Vec<Duration>,
    inputs: Vec<Duration>,
}

impl Machine for Timed {
    type Input = Input;
    type Transmit = Transmit;
    type Event = Event;

    fn handle_input(&mut self, now: Timestamp, input: Input) {
        let started = Instant::now();
        self.link.handle_input(now, input);
        self.inputs.push(started.elapsed());
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        if self.deadline.is_some_and(|at| at <= now) {
            let started = Instant::now();
            self.link.handle_timeout(now);
            self.steps.push(started.elapsed());
        }
    }

    fn poll_output(&mut self) -> Output<Transmit, Event> {
        let output = self.link.poll_output();
        if let Output::Idle { deadline } = output {
            self.deadline = deadline;
        }
        output
    }
}

fn main() {
    let simulated = |settings: Settings| {
        let valencia = Geodetic::new(39.48, -0.34, 20.0).unwrap();
        Config::new(valencia, settings)
    };
    let mut flown = Flown::new(Receiver::Sole, 10, None, simulated, |link| Timed {
        link,
        deadline: None,
        steps: Vec::new(),
        inputs: Vec::new(),
    });
    flown.link.steps.clear();
    flown.link.inputs.clear();
    let started = Instant::now();
    flown.run(HOVER);
    let ms_a_second = started.elapsed().as_secs_f64() * 1e3 / HOVER.as_secs_f64();
    println!(
        "{:<28}{:>10}{:>12}{:>14}",
        "", "a second", "median µs", "99 of 100 µs"
    );
    row("control step", &mut flown.link.steps);
    row("answer of the controller", &mut flown.link.inputs);
    println!(
        "\nLink, port, simulated controller and aircraft: {ms_a_second:.3} ms for a second of flight"
    );
}

fn row(name: &str, times: &mut [Duration]) {
    times.sort_unstable();
    let us = |share: f64| times[(share * (times.len() - 1) as f64) as usize].as_secs_f64() * 1e6;
    let a_second = times.len() as f64 / HOVER.as_secs_f64();
    println!(
        "{name:<28}{a_second:>10.0}{:>12.2}{:>14.2}",
        us(0.5),
        us(0.99)
    );
}
