//! What flying in simulation costs: `cargo bench`. Ours and, where they are at hand, others that do the like, in one run
//! on one machine; then how what a drone costs grows with its swarm.
//!
//! Each figure is taken in a process of its own: its processor time while a scenario is flown, read and reported apart,
//! and the most memory that it held.

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

use muster_scenarios::engine::{self, Engine};
use muster_scenarios::report::{Scaling, scaling};
use muster_scenarios::scenario::{self, Override};

/// What this program is told to measure one run in this process.
const MEASURE: &str = "--measure";
/// How such a process is told to fly: with all rules checked, with none, or with none and by the supervision tree.
const CHECKED: &str = "checked";
const UNCHECKED: &str = "unchecked";
const ACTORS: &str = "actors";
/// The sizes of the last table.
const SIZES: [u32; 8] = [10, 15, 30, 100, 300, 1_000, 3_000, 10_000];
/// Between which of them the growth is said.
const GROWTH: [u32; 2] = [15, 10_000];
/// How often each run is measured, the peers' too; the fastest counts.
const TIMES: usize = 3;
/// A scenario is flown again and again until the flights took as much together: the first few milliseconds of a process say
/// little of what follows. In seconds of processor time.
const LONG_S: f64 = 0.3;

/// What one run cost.
#[derive(Debug, Clone, Copy)]
struct Cost {
    /// Seconds of processor time.
    cpu_s: f64,
    /// Simulated seconds, all drones together.
    drone_s: f64,
    drones: u32,
    /// KiB, at the most.
    memory_kib: f64,
    /// Frames that the drones took in, all together.
    heard: f64,
}

impl Cost {
    /// Simulated seconds of a drone in a second of processor time.
    fn pace(&self) -> f64 {
        self.drone_s / self.cpu_s
    }

    /// Microseconds of processor time a second of a drone.
    fn cpu_us(&self) -> f64 {
        self.cpu_s / self.drone_s * 1e6
    }

    /// Frames that a drone takes in in a second.
    fn heard_a_s(&self) -> f64 {
        self.heard / self.drone_s
    }
}

/// What is flown: a file and what is set in it.
struct Flown {
    name: &'static str,
    /// As the peers' programs call it: how many drones, and how they stand.
    like: Option<(u32, &'static str)>,
    file: &'static str,
    set: &'static [&'static str],
}

const FLOWN: [Flown; 6] = [
    Flown {
        name: "15 in line, flood, 200 ms",
        like: Some((15, "line")),
        file: "line-15-flood.toml",
        set: &[],
    },
    Flown {
        name: "15 in line, tree",
        like: None,
        file: "line-15-tree.toml",
        set: &[],
    },
    Flown {
        name: "grid of 100, tree, 200 ms",
        like: Some((100, "grid")),
        file: "grid-1000.toml",
        set: &["formation.drones=100", "protocol.heartbeat_ms=200"],
    },
    Flown {
        name: "grid of 100, tree",
        like: None,
        file: "grid-1000.toml",
        set: &["formation.drones=100"],
    },
    Flown {
        name: "grid of 1,000, tree, 200 ms",
        like: Some((1_000, "grid")),
        file: "grid-1000.toml",
        set: &["protocol.heartbeat_ms=200"],
    },
    Flown {
        name: "grid of 1,000, tree",
        like: None,
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
    fly_actors()?;
    grow()
}

/// Flies a scenario in this process, more than once if it is short, and prints what one flight cost.
fn measure(arguments: &[String]) -> Result<(), Box<dyn Error>> {
    let [mode, file, set @ ..] = arguments else {
        return Err("nothing to measure".into());
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
    let mut flights = 0.0;
    let (report, spent_s) = loop {
        let (report, _) = engine::run(&scenario, engine, None)?;
        flights += 1.0;
        let spent_s = cpu_s()? - before_s;
        if spent_s >= LONG_S {
            break (report, spent_s);
        }
    };
    if !report.violations.is_empty() || !report.mission_completed {
        return Err(format!("{file} was not flown to its end").into());
    }
    let heard: u64 = report.drones.iter().map(|it| it.messages_received).sum();
    println!(
        "{} {} {drones} {} {heard}",
        spent_s / flights,
        report.simulated_s,
        memory_kib()?
    );
    Ok(())
}

/// The processor time of this process's only busy thread so far, in seconds.
fn cpu_s() -> Result<f64, Box<dyn Error>> {
    let schedstat = fs::read_to_string("/proc/self/schedstat")?;
    let nanos: f64 = schedstat.split(' ').next().unwrap_or_default().parse()?;
    Ok(nanos / 1e9)
}

/// The most memory that this process has held, in KiB.
fn memory_kib() -> Result<f64, Box<dyn Error>> {
    let status = fs::read_to_string("/proc/self/status")?;
    let most = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let most = most.and_then(|line| line.split_whitespace().next());
    Ok(most.ok_or("no VmHWM in /proc/self/status")?.parse()?)
}

/// What a run costs that is made by a process of its own.
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
        let [cpu_s, simulated_s, drones, memory_kib, heard] = numbers[..] else {
            return Err(format!("not a measurement: {text}").into());
        };
        let cost = Cost {
            cpu_s,
            drone_s: simulated_s * drones,
            drones: text.split_whitespace().nth(2).unwrap_or_default().parse()?,
            memory_kib,
            heard,
        };
        if best.is_none_or(|best| cost.cpu_s < best.cpu_s) {
            best = Some(cost);
        }
    }
    best.ok_or_else(|| "nothing was measured".into())
}

fn compare() -> Result<(), Box<dyn Error>> {
    let peers = peers::ready();
    println!("\nSimulated seconds of a drone in a second of processor time, on one core\n");
    println!(
        "{:<30}{:>12}{:>12}{:>10}{:>12}{:>12}{:>16}",
        "", "unchecked", "checked", "KiB/drone", "gradysim", "simulacra", "of simulacra's"
    );
    for flown in &FLOWN {
        eprint!("\r  measuring {} …\x1b[K", flown.name);
        let unchecked = cost(flown.file, flown.set, UNCHECKED)?;
        let checked = cost(flown.file, flown.set, CHECKED)?;
        let of_peers = flown.like.map(|(drones, shape)| peers.paces(drones, shape));
        let [gradysim, simulacra] = of_peers.unwrap_or_default();
        let share = simulacra.map(|simulacra| unchecked.pace() / simulacra);
        let [gradysim, simulacra] = [gradysim, simulacra].map(or_nothing);
        eprint!("\r\x1b[K");
        println!(
            "{:<30}{:>12}{:>12}{:>10}{:>12}{:>12}{:>16}",
            flown.name,
            whole(unchecked.pace()),
            whole(checked.pace()),
            whole(unchecked.memory_kib / f64::from(unchecked.drones)),
            gradysim,
            simulacra,
            share.map_or_else(|| "–".to_owned(), |share| format!("{share:.3}"))
        );
    }
    println!(
        "\nEvery drone of the peers' says 64 bytes each 200 ms, as ours do in the rows with 200 ms; simulacra is a bare\n\
         kernel of events, without places, losses or anything that a swarm does."
    );
    Ok(())
}

/// What the supervision tree costs where nobody awaits it: a thousand drones in virtual time.
fn fly_actors() -> Result<(), Box<dyn Error>> {
    eprint!("\r  measuring the actors …\x1b[K");
    let cost = cost("grid-1000.toml", &[], ACTORS)?;
    eprint!("\r\x1b[K");
    println!(
        "\nThe grid of 1,000 by the actors, no rules checked: {} a second, {:.1} times faster than real time",
        whole(cost.pace()),
        cost.pace() / f64::from(cost.drones)
    );
    Ok(())
}

/// How what a drone costs grows with its swarm.
fn grow() -> Result<(), Box<dyn Error>> {
    println!("\nPolicy tree in a grid, no rules checked\n");
    println!(
        "{:>8}{:>16}{:>18}{:>18}{:>14}{:>12}",
        "drones", "drone-s/CPU-s", "µs a drone-s", "heard a drone-s", "KiB a drone", "MiB"
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
            cost.heard_a_s(),
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

/// Says how much more a drone costs in the largest of these swarms than in a small one, in a grid and in line.
fn print_growth(costs: &[Cost]) -> Result<(), Box<dyn Error>> {
    let line = cost("line-15-tree.toml", &[], UNCHECKED)?;
    let of = |drones: u32| costs.iter().find(|cost| cost.drones == drones);
    let [Some(small), Some(large)] = GROWTH.map(of) else {
        return Err("a size between which the growth is said was not measured".into());
    };
    for (from, cost) in [("grid", small), ("line", &line)] {
        println!(
            "\nFrom {} in a {from} to {} in a grid a second of a drone costs {:.1} times as much; it hears {:.1} times as \
             many frames.",
            cost.drones,
            whole(f64::from(large.drones)),
            large.cpu_us() / cost.cpu_us(),
            large.heard_a_s() / cost.heard_a_s()
        );
    }
    Ok(())
}

fn or_nothing(pace: Option<f64>) -> String {
    pace.map_or_else(|| "–".to_owned(), whole)
}

/// A whole number with its thousands apart.
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
