//! What a process of fifteen takes of a computer: `cargo bench --bench footprint`. Fifteen drones that all hear each other
//! speak five times a second, first over UDP, then over QUIC; takes four minutes.
//!
//! Processor time and memory are what the system says of each process. Starting up, and finding each other, is told apart
//! from flying.

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
/// By then all drones have found each other and none has landed.
const STEADY_AFTER: Duration = Duration::from_secs(20);
/// How often the system is asked.
const PERIOD: Duration = Duration::from_millis(500);
/// The unit in which Linux tells processor time, whatever its own clock does.
const TICKS_A_S: f64 = 100.0;

fn main() -> Result<(), Box<dyn Error>> {
    println!(
        "A process of fifteen, all in range, which speak five times a second\n\n{:<6}{:>10}{:>28}{:>28}{:>24}",
        "", "heard", "of a core in flight, %", "of a core in all, %", "memory, MiB"
    );
    println!(
        "{:<6}{:>10}{:>16}{:>12}{:>16}{:>12}{:>12}{:>12}",
        "", "a second", "median", "most", "median", "most", "median", "most"
    );
    for transport in ["udp", "quic"] {
        eprint!("\r  flying over {transport} …\x1b[K");
        let flight = fly(transport)?;
        eprint!("\r\x1b[K");
        let heard_a_s = flight.heard_a_s;
        print!("{transport:<6}{heard_a_s:>10.1}");
        let in_flight = flight.processes.iter().map(Taken::in_flight_percent);
        let in_all = flight.processes.iter().map(Taken::in_all_percent);
        let memory = flight.processes.iter().map(|it| it.memory_mib);
        let [a, b] = median_and_most(in_flight.collect());
        let [c, d] = median_and_most(in_all.collect());
        let [e, f] = median_and_most(memory.collect());
        println!("{a:>16.2}{b:>12.2}{c:>16.2}{d:>12.2}{e:>12.1}{f:>12.1}");
    }
    Ok(())
}

/// What a flight came to.
struct Flight {
    processes: Vec<Taken>,
    /// Frames that a drone took in in a second, on average.
    heard_a_s: f64,
}

/// What one process took.
struct Taken {
    began: Instant,
    /// When it was looked at first in flight, and last, and how much processor time it had taken by then, in seconds.
    steady: Option<(Instant, f64)>,
    last: (Instant, f64),
    /// The most that it held.
    memory_mib: f64,
}

impl Taken {
    fn in_flight_percent(&self) -> f64 {
        let (since, before_s) = self.steady.unwrap_or((self.began, 0.0));
        let (until, after_s) = self.last;
        (after_s - before_s) / (until - since).as_secs_f64() * 100.0
    }

    fn in_all_percent(&self) -> f64 {
        let (until, spent_s) = self.last;
        spent_s / (until - self.began).as_secs_f64() * 100.0
    }

    /// It is looked at once more.
    fn look(&mut self, spent_s: f64, memory_mib: f64) {
        let now = Instant::now();
        self.last = (now, spent_s);
        self.memory_mib = self.memory_mib.max(memory_mib);
        if now - self.began >= STEADY_AFTER {
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
        look_at_all(&out, &mut processes);
        thread::sleep(PERIOD);
    };
    if !status.success() {
        return Err(format!("{SCENARIO} over {transport} ended with {status}").into());
    }
    let report: Value = serde_json::from_slice(&fs::read(out.join("report.json"))?)?;
    let drones = report["drones"].as_array().ok_or("no drones")?;
    let heard = |drone: &Value| -> Option<f64> {
        Some(drone["messages_received"].as_f64()? / drone["flight_time_s"].as_f64()?)
    };
    let heard: Option<f64> = drones.iter().map(heard).sum();
    #[expect(clippy::cast_precision_loss, reason = "they are few")]
    let heard_a_s = heard.ok_or("a drone that heard nothing")? / drones.len() as f64;
    Ok(Flight {
        processes: processes.into_values().collect(),
        heard_a_s,
    })
}

/// Looks at all drones' processes whose files are in `folder`; one that ends meanwhile is as it was when it was last seen.
fn look_at_all(folder: &Path, processes: &mut BTreeMap<u32, Taken>) {
    let folder = folder.to_string_lossy();
    for process in fs::read_dir("/proc").into_iter().flatten().flatten() {
        let Some(id) = process.file_name().to_str().and_then(|it| it.parse().ok()) else {
            continue;
        };
        let command = fs::read_to_string(process.path().join("cmdline")).unwrap_or_default();
        let mut words = command.split('\0').skip(1);
        let is_drone = words.next() == Some("--config")
            && words.next().is_some_and(|file| file.starts_with(&*folder));
        if is_drone && let Some((spent_s, memory_mib)) = taken(&process.path()) {
            let now = Instant::now();
            let process = processes.entry(id).or_insert(Taken {
                began: now,
                steady: None,
                last: (now, spent_s),
                memory_mib,
            });
            process.look(spent_s, memory_mib);
        }
    }
}

/// How much processor time a process has taken, in seconds, and the most memory that it has held, in MiB.
fn taken(process: &Path) -> Option<(f64, f64)> {
    let stat = fs::read_to_string(process.join("stat")).ok()?;
    // The program's name may have blanks in it; what follows has none.
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks = |nth: usize| fields.get(nth)?.parse::<f64>().ok();
    let spent_s = (ticks(11)? + ticks(12)?) / TICKS_A_S;
    let status = fs::read_to_string(process.join("status")).ok()?;
    let most = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))?;
    let most_kib: f64 = most.split_whitespace().next()?.parse().ok()?;
    Some((spent_s, most_kib / 1024.0))
}

fn median_and_most(mut values: Vec<f64>) -> [f64; 2] {
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1);
    [last / 2, last].map(|at| values.get(at).copied().unwrap_or(f64::NAN))
}
