//! Cost of the simulation: `cargo bench`. Compares it with other simulators, if available, in one run on one machine. Then
//! shows how the cost per drone grows with the swarm.
//!
//! Each figure is measured in a separate process: processor time of the run without loading and reporting, and peak memory.

#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "this is a program that prints a table"
)]

mod peers;

use std::error::Error;
use std::fs;
use std::path::Path;
use std::process::Command;

use muster_experiments::output::{Scaling, scaling};
use muster_scenarios::engine::{self, Engine};
use muster_scenarios::scenario::{self, Override};

/// Argument that measures one scenario in this process.
const MEASURE: &str = "--measure";
/// Modes of such a process: with rule checks, without, or without and on the actors engine.
const CHECKED: &str = "checked";
const UNCHECKED: &str = "unchecked";
const ACTORS: &str = "actors";
/// Swarm sizes of the last table.
const SIZES: [u32; 8] = [10, 15, 30, 100, 300, 1_000, 3_000, 10_000];
/// Two sizes between which the growth is printed.
const GROWTH: [u32; 2] = [15, 10_000];
/// Repetitions of each measurement, also of the peers; the fastest counts.
const TIMES: usize = 3;
/// Minimum processor time of a measurement, in seconds. A scenario is repeated until then, because the first milliseconds
/// of a process are not representative.
const MEASUREMENT_MIN_S: f64 = 0.3;

/// Cost of one run.
#[derive(Debug, Clone, Copy)]
struct Cost {
    /// Processor time, in seconds.
    cpu_s: f64,
    /// Simulated seconds of all drones.
    drone_s: f64,
    drones: u32,
    /// Peak memory, in KiB.
    memory_kib: f64,
    /// Frames received by all drones.
    received: f64,
}

impl Cost {
    /// Simulated drone-seconds per second of processor time.
    fn pace(&self) -> f64 {
        self.drone_s / self.cpu_s
    }

    /// Microseconds of processor time per drone-second.
    fn cpu_us(&self) -> f64 {
        self.cpu_s / self.drone_s * 1e6
    }

    /// Frames received per drone-second.
    fn received_per_s(&self) -> f64 {
        self.received / self.drone_s
    }
}

/// A measured scenario: a file and its overrides.
struct Measured {
    name: &'static str,
    /// Arguments of the peers' programs: number of drones and geometry; `None` if there is no equivalent.
    peer: Option<(u32, &'static str)>,
    file: &'static str,
    set: &'static [&'static str],
}

const MEASURED: [Measured; 6] = [
    Measured {
        name: "15 in line, flood, 200 ms",
        peer: Some((15, "line")),
        file: "line-15-flood.toml",
        set: &[],
    },
    Measured {
        name: "15 in line, tree",
        peer: None,
        file: "line-15-tree.toml",
        set: &[],
    },
    Measured {
        name: "grid of 100, tree, 200 ms",
        peer: Some((100, "grid")),
        file: "grid-1000.toml",
        set: &["formation.drones=100", "protocol.heartbeat_ms=200"],
    },
    Measured {
        name: "grid of 100, tree",
        peer: None,
        file: "grid-1000.toml",
        set: &["formation.drones=100"],
    },
    Measured {
        name: "grid of 1,000, tree, 200 ms",
        peer: Some((1_000, "grid")),
        file: "grid-1000.toml",
        set: &["protocol.heartbeat_ms=200"],
    },
    Measured {
        name: "grid of 1,000, tree",
        peer: None,
        file: "grid-1000.toml",
        set: &[],
    },
];

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    if let Some(at) = arguments.iter().position(|it| it == MEASURE) {
        return measure(&arguments[at + 1..]);
    }
    compare()?;
    measure_actors()?;
    measure_controllers()?;
    measure_growth()
}

/// Runs a scenario in this process, repeatedly if it is short, and prints the cost of one run.
fn measure(arguments: &[String]) -> Result<(), Box<dyn Error>> {
    let [mode, file, set @ ..] = arguments else {
        return Err("missing arguments; accepted: MODE FILE [KEY=VALUE…]".into());
    };
    let set: Vec<Override> = set.iter().map(|it| it.parse()).collect::<Result<_, _>>()?;
    let mut scenario = scenario::load(Path::new(file), &set)?;
    scenario.unchecked = mode != CHECKED;
    let drones = scenario.plan.layout.formation().drones();
    let engine = match mode.as_str() {
        ACTORS => Engine::Actors,
        _ => Engine::Events,
    };
    let before_s = cpu_s()?;
    let mut runs = 0.0;
    let (report, spent_s) = loop {
        let (report, _) = engine::run(&scenario, engine, None)?;
        runs += 1.0;
        let spent_s = cpu_s()? - before_s;
        if spent_s >= MEASUREMENT_MIN_S {
            break (report, spent_s);
        }
    };
    if !report.violations.is_empty() || !report.mission_completed {
        return Err(format!("{file}: mission not completed or a rule broken").into());
    }
    let received: u64 = report.drones.iter().map(|it| it.messages_received).sum();
    println!(
        "{} {} {drones} {} {received}",
        spent_s / runs,
        report.simulated_s,
        memory_kib()?
    );
    Ok(())
}

/// Processor time of this process's main thread so far, in seconds.
fn cpu_s() -> Result<f64, Box<dyn Error>> {
    let schedstat = fs::read_to_string("/proc/self/schedstat")?;
    let nanos: f64 = schedstat.split(' ').next().unwrap_or_default().parse()?;
    Ok(nanos / 1e9)
}

/// Peak memory of this process, in KiB.
fn memory_kib() -> Result<f64, Box<dyn Error>> {
    let status = fs::read_to_string("/proc/self/status")?;
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let peak = peak.and_then(|line| line.split_whitespace().next());
    Ok(peak.ok_or("no VmHWM in /proc/self/status")?.parse()?)
}

/// Cost of a run, measured in a separate process.
fn cost(file: &str, set: &[&str], mode: &str) -> Result<Cost, Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut best: Option<Cost> = None;
    for _ in 0..TIMES {
        let output = Command::new(std::env::current_exe()?)
            .args([MEASURE, mode])
            .arg(root.join("scenarios/scale").join(file))
            .args(set)
            .output()?;
        if !output.status.success() {
            return Err(String::from_utf8_lossy(&output.stderr).into());
        }
        let text = String::from_utf8(output.stdout)?;
        let numbers: Vec<f64> = text
            .split_whitespace()
            .map(str::parse)
            .collect::<Result<_, _>>()?;
        let [cpu_s, simulated_s, drones, memory_kib, received] = numbers[..] else {
            return Err(format!("not a measurement: {text}").into());
        };
        let cost = Cost {
            cpu_s,
            drone_s: simulated_s * drones,
            drones: text.split_whitespace().nth(2).unwrap_or_default().parse()?,
            memory_kib,
            received,
        };
        if best.is_none_or(|best| cost.cpu_s < best.cpu_s) {
            best = Some(cost);
        }
    }
    best.ok_or_else(|| "no measurement was made".into())
}

fn compare() -> Result<(), Box<dyn Error>> {
    let peers = peers::prepare();
    println!("\nSimulated drone-seconds per second of processor time, on one core\n");
    println!(
        "{:<30}{:>12}{:>12}{:>10}{:>12}{:>12}{:>16}",
        "", "unchecked", "checked", "KiB/drone", "gradysim", "simulacra", "vs simulacra"
    );
    for measured in &MEASURED {
        eprint!("\r  measuring {} …\x1b[K", measured.name);
        let unchecked = cost(measured.file, measured.set, UNCHECKED)?;
        let checked = cost(measured.file, measured.set, CHECKED)?;
        let of_peers = measured
            .peer
            .map(|(drones, shape)| peers.paces(drones, shape));
        let [gradysim, simulacra] = of_peers.unwrap_or_default();
        let share = simulacra.map(|simulacra| unchecked.pace() / simulacra);
        let [gradysim, simulacra] = [gradysim, simulacra].map(or_dash);
        eprint!("\r\x1b[K");
        println!(
            "{:<30}{:>12}{:>12}{:>10}{:>12}{:>12}{:>16}",
            measured.name,
            whole(unchecked.pace()),
            whole(checked.pace()),
            whole(unchecked.memory_kib / f64::from(unchecked.drones)),
            gradysim,
            simulacra,
            share.map_or_else(|| "–".to_owned(), |share| format!("{share:.3}"))
        );
    }
    println!(
        "\nEach drone of the peers sends 64 bytes every 200 ms, like ours in the rows with 200 ms. simulacra is an event\n\
         kernel only: no positions, no losses, no swarm protocol."
    );
    Ok(())
}

/// Measures the actors engine: a thousand drones in virtual time.
fn measure_actors() -> Result<(), Box<dyn Error>> {
    eprint!("\r  measuring the actors …\x1b[K");
    let cost = cost("grid-1000.toml", &[], ACTORS)?;
    eprint!("\r\x1b[K");
    println!(
        "\nGrid of 1,000 on the actors engine, rule checks off: {} drone-seconds per second, {:.1} times faster than \
         real time",
        whole(cost.pace()),
        cost.pace() / f64::from(cost.drones)
    );
    Ok(())
}

/// Measures drones that fly by simulated flight controllers, and lose their master.
fn measure_controllers() -> Result<(), Box<dyn Error>> {
    eprint!("\r  measuring flight controllers …\x1b[K");
    let cost = cost("../flight-controllers.toml", &[], CHECKED)?;
    eprint!("\r\x1b[K");
    println!(
        "\nFifteen flight controllers, rules checked: {} drone-seconds per second, {:.1} times faster than real time",
        whole(cost.pace()),
        cost.pace() / f64::from(cost.drones)
    );
    Ok(())
}

/// Measures the cost per drone by swarm size.
fn measure_growth() -> Result<(), Box<dyn Error>> {
    println!("\nPolicy tree in a grid, rule checks off\n");
    println!(
        "{:>8}{:>16}{:>18}{:>18}{:>14}{:>12}",
        "drones", "drone-s/CPU-s", "µs/drone-s", "frames/drone-s", "KiB/drone", "MiB"
    );
    let mut costs = Vec::new();
    for drones in SIZES {
        eprint!("\r  measuring {drones} drones …\x1b[K");
        let set = format!("formation.drones={drones}");
        let cost = cost("grid-1000.toml", &[&set], UNCHECKED)?;
        eprint!("\r\x1b[K");
        println!(
            "{drones:>8}{:>16}{:>18.1}{:>18.1}{:>14.1}{:>12.1}",
            whole(cost.pace()),
            cost.cpu_us(),
            cost.received_per_s(),
            cost.memory_kib / f64::from(drones),
            cost.memory_kib / 1_024.0
        );
        costs.push(cost);
    }
    print_growth(&costs)?;
    let points: Vec<Scaling> = costs
        .iter()
        .map(|cost| Scaling {
            drones: cost.drones,
            cpu_us: cost.cpu_us(),
            memory_kib: cost.memory_kib / f64::from(cost.drones),
        })
        .collect();
    let page = Path::new(env!("CARGO_TARGET_TMPDIR")).join("scaling.html");
    fs::write(&page, scaling(&points))?;
    println!("\n wrote {}", page.display());
    Ok(())
}

/// Prints the growth of the cost per drone from a small grid and from a line to the largest grid.
fn print_growth(costs: &[Cost]) -> Result<(), Box<dyn Error>> {
    let line = cost("line-15-tree.toml", &[], UNCHECKED)?;
    let of = |drones: u32| costs.iter().find(|cost| cost.drones == drones);
    let [Some(small), Some(large)] = GROWTH.map(of) else {
        return Err("a size of GROWTH is not in SIZES".into());
    };
    for (from, cost) in [("grid", small), ("line", &line)] {
        println!(
            "\nFrom {} in a {from} to {} in a grid: {:.1} times the processor time per drone-second, {:.1} times the \
             frames received.",
            cost.drones,
            whole(f64::from(large.drones)),
            large.cpu_us() / cost.cpu_us(),
            large.received_per_s() / cost.received_per_s()
        );
    }
    Ok(())
}

fn or_dash(pace: Option<f64>) -> String {
    pace.map_or_else(|| "–".to_owned(), whole)
}

/// A whole number with thousands separators.
fn whole(value: f64) -> String {
    let digits = format!("{value:.0}");
    let mut text = String::new();
    for (at, digit) in digits.chars().enumerate() {
        if at > 0 && (digits.len() - at).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}
