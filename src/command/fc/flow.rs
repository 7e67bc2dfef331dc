use std::io::{self, IsTerminal};
use std::time::{Duration, Instant};

use clap::Args;
use muster_msp::FlowReading;
use muster_port::{Address, FlowPort};
use serde_json::json;

use super::{ControllerError, Failure, Outcome};
use crate::command::{numbers, terminal};

/// Between two views on a terminal.
const REPAINT: Duration = Duration::from_millis(200);
/// Between two lines.
const LINE: Duration = Duration::from_secs(1);

/// Show what an optical flow module says, live.
///
/// The module is one that sends MSP by itself, on a serial port of its own. A drone's file names it as `flow`. It must be
/// mounted so that motion forward shows as positive y, and motion to the right as negative x.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Serial port or TCP address of the module.
    #[arg(value_name = "DEVICE", value_parser = super::address)]
    address: Address,
    /// Print JSON.
    #[arg(long)]
    json: bool,
    /// Stop after that long; until interrupted if absent
    #[arg(long, value_name = "S", value_parser = numbers::whole::<u64>(1..=u64::from(u32::MAX)), allow_negative_numbers = true)]
    seconds: Option<u64>,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let address = &arguments.address;
    let mut port = FlowPort::open(address).map_err(|source| ControllerError::Open {
        address: address.clone(),
        source,
    })?;
    let repaints = !arguments.json && io::stdout().is_terminal();
    let every = if repaints { REPAINT } else { LINE };
    let started = Instant::now();
    let end = arguments.seconds.map(Duration::from_secs);
    let mut due = Duration::ZERO;
    while end.is_none_or(|end| started.elapsed() < end) {
        due += every;
        let mut view = View::default();
        while started.elapsed() < due {
            let read = port.read(|reading| view.take(&reading));
            read.map_err(|source| ControllerError::Read {
                address: address.clone(),
                source,
            })?;
        }
        let noise_bytes = port.counts().noise_bytes;
        let text = match (arguments.json, repaints) {
            (true, _) => view.in_json(every, noise_bytes),
            (false, true) => format!(
                "{}{}",
                terminal::CLEAR,
                view.lines(every, noise_bytes).join("\n")
            ),
            (false, false) => view.lines(every, noise_bytes).join("; "),
        };
        if !terminal::print_to_reader(&format!("{text}\n"))? {
            break;
        }
    }
    Ok(Outcome::Success)
}

/// What a module said since the last view.
#[derive(Default)]
struct View {
    /// The newest rates about x and y, in rad/s, and their quality.
    rates: Option<([f64; 2], u8)>,
    /// The newest distance in metres, if there was one, and its quality.
    distance: Option<(Option<f64>, u8)>,
    readings: u32,
}

impl View {
    fn take(&mut self, reading: &FlowReading) {
        self.readings += 1;
        let thousandth = |value: i32| f64::from(value) / 1_000.0;
        match reading {
            FlowReading::Rates(it) => {
                self.rates = Some(([it.x_mradps, it.y_mradps].map(thousandth), it.quality));
            }
            FlowReading::Range(it) => {
                let distance = (it.distance_mm >= 0).then(|| thousandth(it.distance_mm));
                self.distance = Some((distance, it.quality));
            }
        }
    }

    fn per_second(&self, every: Duration) -> f64 {
        f64::from(self.readings) / every.as_secs_f64()
    }

    fn lines(&self, every: Duration, noise_bytes: u64) -> Vec<String> {
        let rates = self
            .rates
            .map_or("no rates".to_owned(), |([x, y], quality)| {
                format!("x {x:+.2} y {y:+.2} rad/s, quality {quality} of 255")
            });
        let distance = match self.distance {
            None => "no distance".to_owned(),
            Some((None, _)) => "distance out of range".to_owned(),
            Some((Some(metres), quality)) => {
                format!("distance {metres:.2} m, quality {quality} of 255")
            }
        };
        let per_second = self.per_second(every);
        let port = format!("{per_second:.0} readings/s, {noise_bytes} bytes of noise");
        vec![rates, distance, port]
    }

    fn in_json(&self, every: Duration, noise_bytes: u64) -> String {
        json!({
            "x_radps": self.rates.map(|([x, _], _)| x),
            "y_radps": self.rates.map(|([_, y], _)| y),
            "quality": self.rates.map(|(_, quality)| quality),
            "distance_m": self.distance.and_then(|(distance, _)| distance),
            "distance_quality": self.distance.map(|(_, quality)| quality),
            "readings_per_second": self.per_second(every),
            "noise_bytes": noise_bytes,
        })
        .to_string()
    }
}
