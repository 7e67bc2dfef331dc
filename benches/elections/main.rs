//! Time from the kill of the master to the next one: `cargo bench --bench elections`. Fifty kills with five processes and
//! fifty with fifteen, in real time. If available, etcd tuned to 10 and 100 ms, in the same run. Takes 15 minutes.
//!
//! An idle processor of a virtual machine may wake up tens of milliseconds late. So all processors are kept busy during all
//! measurements.

#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "this is a program that prints a table"
)]

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread;

use serde_json::Value;

/// Number of kills of etcd's leader, as in the scenarios.
const KILLS: &str = "50";

fn main() -> Result<(), Box<dyn Error>> {
    if let Err(why) = keep_processors_busy() {
        println!("Processors may sleep: {why}.\n");
    }
    println!(
        "Milliseconds from SIGKILL of the master\n\n{:<24}{:>7}{:>32}{:>32}",
        "", "", "until a new leader", "until all agree"
    );
    println!(
        "{:<24}{:>7}{:>12}{:>10}{:>10}{:>12}{:>10}{:>10}",
        "", "kills", "median", "99th", "max", "median", "99th", "max"
    );
    let mut broken = vec![];
    for processes in [5, 15] {
        eprint!("\r  killing masters of {processes} processes …\x1b[K");
        let flight = fly(processes)?;
        eprint!("\r\x1b[K");
        row(
            &format!("{processes} processes, lan"),
            &flight.led,
            &flight.agreed,
        );
        broken.extend(flight.broken);
    }
    match etcd() {
        Ok((led, agreed)) => row("etcd, 3 nodes, 10/100", &led, &agreed),
        Err(why) => println!("etcd is skipped: {why}."),
    }
    println!(
        "\nProcesses: measured from their logs, including up to 5 ms of delay of the injected fault. etcd: its nodes are \
         polled every 2 ms."
    );
    if broken.is_empty() {
        return Ok(());
    }
    Err(format!("runs with violations or errors:\n{}", broken.join("\n")).into())
}

/// Keeps each processor busy with a thread of idle priority, until this program ends.
fn keep_processors_busy() -> Result<(), Box<dyn Error>> {
    for _ in 0..thread::available_parallelism()?.get() {
        let spawner = thread::spawn(|| {
            let thread = std::fs::read_link("/proc/thread-self")?;
            let id = thread.file_name().unwrap_or_default();
            let policy = Command::new("chrt")
                .args(["--idle", "--pid", "0"])
                .arg(id)
                .stderr(Stdio::null())
                .status();
            if !policy?.success() {
                return Err(std::io::Error::other("chrt failed"));
            }
            thread::spawn(|| {
                loop {
                    std::hint::spin_loop();
                }
            });
            Ok(())
        });
        spawner.join().map_err(|_| "a thread ended")??;
    }
    Ok(())
}

/// Result of one scenario.
struct Flight {
    led: Times,
    agreed: Times,
    /// Violations and errors.
    broken: Vec<String>,
}

/// Number of times with their median, 99th percentile and maximum.
struct Times {
    count: usize,
    ms: [f64; 3],
}

impl Times {
    fn of_seconds(times: impl Iterator<Item = Option<f64>>) -> Option<Self> {
        let mut times: Vec<f64> = times.collect::<Option<_>>()?;
        times.sort_by(f64::total_cmp);
        let last = times.len().checked_sub(1)?;
        let percentile_ms = |percent: usize| times[last * percent / 100] * 1e3;
        Some(Self {
            count: times.len(),
            ms: [50, 99, 100].map(percentile_ms),
        })
    }
}

fn row(name: &str, led: &Times, agreed: &Times) {
    let [a, b, c] = led.ms;
    let [d, e, f] = agreed.ms;
    let count = led.count;
    println!("{name:<24}{count:>7}{a:>12.1}{b:>10.1}{c:>10.1}{d:>12.1}{e:>10.1}{f:>10.1}");
}

/// Runs a scenario with so many processes that kills the master repeatedly.
fn fly(processes: u32) -> Result<Flight, Box<dyn Error>> {
    let scenario = format!("scenarios/hardware/elections-{processes}.toml");
    let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("elections-{processes}"));
    let run = Command::new(env!("CARGO_BIN_EXE_muster"))
        .arg("swarm")
        .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join(&scenario))
        .args(["--json", "--out"])
        .arg(&out)
        .output()?;
    let report: Value = serde_json::from_slice(&run.stdout).map_err(|_| {
        let error = String::from_utf8_lossy(&run.stderr);
        format!("{scenario} failed: {error}")
    })?;
    let elections = report["elections"].as_array().ok_or("no elections")?;
    let times = |field: &str| Times::of_seconds(elections.iter().map(|it| it[field].as_f64()));
    let violations = report["violations"].as_array().ok_or("no violations")?;
    let describe = |it: &Value| format!("{scenario}, {} s: {}", it["at_s"], it["what"]);
    let mut broken: Vec<_> = violations.iter().map(describe).collect();
    if !run.status.success() {
        broken.push(format!("{scenario} ended with {}", run.status));
    }
    Ok(Flight {
        broken,
        led: times("led_after_s").ok_or("an election found no master")?,
        agreed: times("settled_after_s").ok_or("an election found no agreed master")?,
    })
}

/// The same for etcd, measured by a program outside this project.
fn etcd() -> Result<(Times, Times), Box<dyn Error>> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/peers");
    let folder = std::env::var_os("MUSTER_PEERS").map_or(beside, PathBuf::from);
    let program = folder.join("etcd_kill.py");
    if !program.is_file() {
        return Err(format!("{} does not exist", program.display()).into());
    }
    Command::new("etcd")
        .arg("--version")
        .output()
        .map_err(|error| format!("etcd can't be run: {error}"))?;
    eprint!("\r  killing etcd's leaders …\x1b[K");
    let run = Command::new("python3")
        .arg(program)
        .args(["10", "100", KILLS])
        .arg(Path::new(env!("CARGO_TARGET_TMPDIR")).join("etcd"))
        .output()?;
    eprint!("\r\x1b[K");
    let measured: Value = serde_json::from_slice(&run.stdout)
        .map_err(|_| String::from_utf8_lossy(&run.stderr).into_owned())?;
    let count = measured["kills"].as_u64().ok_or("no kills")?;
    let times = |field: &str| -> Result<Times, Box<dyn Error>> {
        let ms = ["p50", "p99", "max"].map(|it| measured[field][it].as_f64());
        let [Some(p50), Some(p99), Some(max)] = ms else {
            return Err("no times".into());
        };
        Ok(Times {
            count: usize::try_from(count)?,
            ms: [p50, p99, max],
        })
    };
    Ok((times("new_leader_first")?, times("new_leader_both")?))
}
