//! Processor time and memory of one process of fifteen: `cargo bench --bench footprint`. Fifteen drones in range of each
//! other send five frames per second, first over UDP, then over QUIC. Takes four minutes.
//!
//! The values are those of the operating system. Flight is measured separately from start-up and discovery.

#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "this is a program that prints a table"
)]

use std::collections::BTreeMap;
use std::error::Error;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use serde_json::Value;

const SCENARIO: &str = "scenarios/hardware/footprint-15.toml";
/// Start of the flight measurement: all drones have discovered each other and none has landed.
const STEADY_AFTER: Duration = Duration::from_secs(20);
/// Sampling period.
const PERIOD: Duration = Duration::from_millis(500);
/// Unit of processor time in `/proc`: clock ticks per second.
const TICKS_PER_S: f64 = 100.0;

fn main() -> Result<(), Box<dyn Error>> {
    println!(
        "One process of fifteen, all in range, five frames per second each\n\n{:<6}{:>10}{:>28}{:>28}{:>24}",
        "", "received", "core in flight, %", "core in total, %", "memory, MiB"
    );
    println!(
        "{:<6}{:>10}{:>16}{:>12}{:>16}{:>12}{:>12}{:>12}",
        "", "per second", "median", "max", "median", "max", "median", "max"
    );
    for transport in ["udp", "quic"] {
        eprint!("\r  running over {transport} …\x1b[K");
        let flight = fly(transport)?;
        eprint!("\r\x1b[K");
        let received_per_s = flight.received_per_s;
        print!("{transport:<6}{received_per_s:>10.1}");
        let in_flight = flight.processes.iter().map(Usage::in_flight_percent);
        let in_total = flight.processes.iter().map(Usage::in_total_percent);
        let memory = flight.processes.iter().map(|it| it.memory_mib);
        let [a, b] = median_and_max(in_flight.collect());
        let [c, d] = median_and_max(in_total.collect());
        let [e, f] = median_and_max(memory.collect());
        println!("{a:>16.2}{b:>12.2}{c:>16.2}{d:>12.2}{e:>12.1}{f:>12.1}");
    }
    Ok(())
}

/// Result of one run.
struct Flight {
    processes: Vec<Usage>,
    /// Mean number of frames received per drone and second.
    received_per_s: f64,
}

/// Processor time and memory of one process.
struct Usage {
    started: Instant,
    /// First sample in flight, and last sample: time and processor time so far, in seconds.
    steady: Option<(Instant, f64)>,
    last: (Instant, f64),
    /// Peak memory.
    memory_mib: f64,
}

impl Usage {
    fn in_flight_percent(&self) -> f64 {
        let (since, before_s) = self.steady.unwrap_or((self.started, 0.0));
        let (until, after_s) = self.last;
        (after_s - before_s) / (until - since).as_secs_f64() * 100.0
    }

    fn in_total_percent(&self) -> f64 {
        let (until, spent_s) = self.last;
        spent_s / (until - self.started).as_secs_f64() * 100.0
    }

    /// Adds a sample.
    fn sample(&mut self, spent_s: f64, memory_mib: f64) {
        let now = Instant::now();
        self.last = (now, spent_s);
        self.memory_mib = self.memory_mib.max(memory_mib);
        if now - self.started >= STEADY_AFTER {
            self.steady.get_or_insert(self.last);
        }
    }
}

fn fly(transport: &str) -> Result<Flight, Box<dyn Error>> {
    let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("footprint-{transport}"));
    let mut swarm = Command::new(env!("CARGO_BIN_EXE_muster"))
        .arg("swarm")
        .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join(SCENARIO))
        .args(["--transport", transport, "--out"])
        .arg(&out)
        .stdout(Stdio::null())
        .spawn()?;
    let mut processes = BTreeMap::new();
    let status = loop {
        if let Some(status) = swarm.try_wait()? {
            break status;
        }
        sample_all(&out, &mut processes);
        thread::sleep(PERIOD);
    };
    if !status.success() {
        return Err(format!("{SCENARIO} over {transport} ended with {status}").into());
    }
    let report: Value = serde_json::from_slice(&fs::read(out.join("report.json"))?)?;
    let drones = report["drones"].as_array().ok_or("no drones")?;
    let received = |drone: &Value| -> Option<f64> {
        Some(drone["messages_received"].as_f64()? / drone["flight_time_s"].as_f64()?)
    };
    let received: Option<f64> = drones.iter().map(received).sum();
    #[expect(clippy::cast_precision_loss, reason = "the number of drones is small")]
    let received_per_s = received.ok_or("a drone has no flight time")? / drones.len() as f64;
    Ok(Flight {
        processes: processes.into_values().collect(),
        received_per_s,
    })
}

/// Samples all drone processes with a configuration file in `folder`. An ended process keeps its last sample.
fn sample_all(folder: &Path, processes: &mut BTreeMap<u32, Usage>) {
    let folder = folder.to_string_lossy();
    for process in fs::read_dir("/proc").into_iter().flatten().flatten() {
        let Some(id) = process.file_name().to_str().and_then(|it| it.parse().ok()) else {
            continue;
        };
        let command = fs::read_to_string(process.path().join("cmdline")).unwrap_or_default();
        let mut words = command.split('\0').skip(1);
        let is_drone = words.next() == Some("--config")
            && words.next().is_some_and(|file| file.starts_with(&*folder));
        if is_drone && let Some((spent_s, memory_mib)) = usage(&process.path()) {
            let now = Instant::now();
            let process = processes.entry(id).or_insert(Usage {
                started: now,
                steady: None,
                last: (now, spent_s),
                memory_mib,
            });
            process.sample(spent_s, memory_mib);
        }
    }
}

/// Processor time of a process in seconds, and its peak memory in MiB; `None` if it has ended.
fn usage(process: &Path) -> Option<(f64, f64)> {
    let stat = fs::read_to_string(process.join("stat")).ok()?;
    // The program's name may contain spaces; the fields after it don't.
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks = |nth: usize| fields.get(nth)?.parse::<f64>().ok();
    let spent_s = (ticks(11)? + ticks(12)?) / TICKS_PER_S;
    let status = fs::read_to_string(process.join("status")).ok()?;
    let most = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))?;
    let most_kib: f64 = most.split_whitespace().next()?.parse().ok()?;
    Some((spent_s, most_kib / 1024.0))
}

fn median_and_max(mut values: Vec<f64>) -> [f64; 2] {
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1);
    [last / 2, last].map(|at| values.get(at).copied().unwrap_or(f64::NAN))
}
