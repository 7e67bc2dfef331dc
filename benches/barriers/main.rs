//! Cost of a barrier by formation, radio and policy: `cargo bench --bench barriers`. Each combination runs the mission of
//! `scenarios/barriers.toml` with many seeds and is compared with the bounds of policy `tree`.
//!
//! `-- --seeds 0..20 --only csma --parameters fast --jobs 2` runs fewer seeds and combinations, with another parameter set.

#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "this is a program that prints a table"
)]

use std::error::Error;
use std::ops::Range;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use muster_scenarios::engine::{self, Engine};
use muster_scenarios::report::{Barrier, Report};
use muster_scenarios::scenario::{self, Override};

/// A name with its fields.
type Named = (&'static str, &'static [&'static str]);

const FORMATIONS: [Named; 7] = [
    (
        "line 15",
        &[
            "formation.kind=linear",
            "formation.drones=15",
            "formation.spacing_m=160",
            "radio.range_m=300",
        ],
    ),
    (
        "line 15 tight",
        &[
            "formation.kind=linear",
            "formation.drones=15",
            "formation.spacing_m=160",
            "radio.range_m=170",
        ],
    ),
    (
        "grid 25",
        &[
            "formation.kind=regular-matrix",
            "formation.drones=25",
            "formation.spacing_m=100",
            "radio.range_m=200",
        ],
    ),
    (
        "mesh 19",
        &[
            "formation.kind=compact-mesh",
            "formation.drones=19",
            "formation.spacing_m=100",
            "radio.range_m=150",
        ],
    ),
    (
        "circle 21",
        &[
            "formation.kind=circular",
            "formation.drones=21",
            "formation.spacing_m=90",
            "radio.range_m=300",
        ],
    ),
    (
        "split-up 17",
        &[
            "formation.kind=split-up",
            "formation.drones=17",
            "formation.clusters=5",
            "formation.spacing_m=60",
            "radio.range_m=300",
        ],
    ),
    (
        "random 30",
        &[
            "formation.kind=random",
            "formation.drones=30",
            "formation.spacing_m=60",
            "radio.range_m=120",
            "limits.separation_vertical_m=1",
        ],
    ),
];

const RADIOS: [Named; 7] = [
    ("ideal", &["radio.medium=ideal", "radio.model=range"]),
    (
        "loss 0.2",
        &["radio.medium=ideal", "radio.model=range", "radio.loss=0.2"],
    ),
    ("csma", &["radio.medium=csma", "radio.model=range"]),
    ("csma 80211a", &["radio.medium=csma", "radio.model=80211a"]),
    (
        "csma nakagami",
        &["radio.medium=csma", "radio.model=nakagami"],
    ),
    (
        "ideal nakagami",
        &["radio.medium=ideal", "radio.model=nakagami"],
    ),
    (
        "bursts",
        &[
            "radio.medium=ideal",
            "radio.model=range",
            "radio.burst_every_ms=380",
            "radio.burst_ms=20",
        ],
    ),
];

const POLICIES: [&str; 2] = ["tree", "flood"];

/// Results of all runs of a combination under one policy.
#[derive(Debug, Default)]
struct Measured {
    /// Barrier waits in milliseconds with their seeds, in ascending order.
    waits_ms: Vec<(f64, u64)>,
    hops: Vec<u16>,
    drones: usize,
    received: f64,
    runs: u64,
    elections: usize,
    over_budget: u64,
    /// Seeds of runs with a violation, an election or an incomplete mission, with the reason.
    broken: Vec<(u64, String)>,
}

impl Measured {
    fn add(&mut self, seed: u64, report: &Report) {
        let wait = |it: &Barrier| (it.wait_s() * 1e3, seed);
        self.waits_ms.extend(report.barriers.iter().map(wait));
        self.hops
            .extend(report.drones.iter().filter_map(|it| it.hops).max());
        self.drones = report.drones.len();
        self.received += report.means.messages_received;
        self.runs += 1;
        self.elections += report.elections.len();
        let over_budget = report
            .dropped
            .get("over budget")
            .copied()
            .unwrap_or_default();
        self.over_budget += over_budget;
        for (number, what) in [
            (report.elections.len() as u64, "elections"),
            (over_budget, "over budget"),
        ] {
            if number > 0 {
                self.broken.push((seed, format!("{number} {what}")));
            }
        }
        if let Some(violation) = report.violations.first() {
            self.broken.push((seed, format!("rule {}", violation.rule)));
        } else if !report.mission_completed {
            self.broken.push((seed, "incomplete".to_owned()));
        }
    }

    /// The wait that this share of all waits does not exceed.
    fn quantile(&self, share: f64) -> f64 {
        let last = self.waits_ms.len().saturating_sub(1);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            clippy::cast_precision_loss,
            reason = "an index"
        )]
        let at = (share * last as f64).ceil() as usize;
        self.waits_ms.get(at).map_or(f64::NAN, |wait| wait.0)
    }

    /// Hops of the farthest drone in the median run.
    fn hops(&self) -> f64 {
        let mut hops = self.hops.clone();
        hops.sort_unstable();
        hops.get(hops.len() / 2)
            .copied()
            .map_or(f64::NAN, f64::from)
    }

    #[expect(clippy::cast_precision_loss, reason = "small counts")]
    fn bounds_ms(&self) -> [f64; 2] {
        let (hops, drones) = (self.hops(), self.drones as f64);
        [
            10.0 + 8.0 * hops + drones,
            60.0 + 30.0 * hops + 3.0 * drones,
        ]
    }

    #[expect(clippy::cast_precision_loss, reason = "small counts")]
    fn received(&self) -> f64 {
        self.received / self.runs as f64
    }
}

struct Arguments {
    seeds: Range<u64>,
    only: Vec<String>,
    set: Vec<String>,
    jobs: usize,
    /// Whether `flood` is run too, for comparison.
    compares: bool,
}

fn arguments() -> Result<Arguments, Box<dyn Error>> {
    let mut arguments = Arguments {
        seeds: 0..100,
        only: Vec::new(),
        set: Vec::new(),
        jobs: std::thread::available_parallelism()?.get(),
        compares: true,
    };
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        match word.as_str() {
            "--bench" => continue,
            "--tree-only" => {
                arguments.compares = false;
                continue;
            }
            _ => {}
        }
        let value = words
            .next()
            .ok_or_else(|| format!("{word} needs a value"))?;
        match word.as_str() {
            "--seeds" => {
                let (first, end) = value.split_once("..").ok_or("--seeds needs FIRST..END")?;
                arguments.seeds = first.parse()?..end.parse()?;
            }
            "--only" => arguments.only.push(value),
            "--set" => arguments.set.push(value),
            "--parameters" => arguments.set.push(format!("protocol.parameters={value}")),
            "--jobs" => arguments.jobs = value.parse()?,
            _ => return Err(format!(
                "unknown argument {word}; accepted: --seeds, --only, --set, --parameters, --jobs, --tree-only"
            )
            .into()),
        }
    }
    Ok(arguments)
}

fn fly(arguments: &Arguments, set: &[String]) -> Result<Measured, Box<dyn Error>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios/barriers.toml");
    let set: Vec<Override> = set
        .iter()
        .chain(&arguments.set)
        .map(|it| it.parse())
        .collect::<Result<_, _>>()?;
    let next = AtomicU64::new(arguments.seeds.start);
    let reports = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..arguments.jobs {
            scope.spawn(|| {
                loop {
                    let seed = next.fetch_add(1, Ordering::Relaxed);
                    if seed >= arguments.seeds.end {
                        return;
                    }
                    let mut set = set.clone();
                    set.push(Override::seed(&seed.to_string()));
                    let report = match scenario::load(&path, &set) {
                        Ok(scenario) => engine::run(&scenario, Engine::Events, None)
                            .map(|it| it.0)
                            .map_err(|it| it.to_string()),
                        Err(error) => Err(error.to_string()),
                    };
                    if let Ok(mut reports) = reports.lock() {
                        reports.push((seed, report));
                    }
                }
            });
        }
    });
    let mut reports = reports.into_inner()?;
    reports.sort_by_key(|it| it.0);
    let mut measured = Measured::default();
    for (seed, report) in reports {
        measured.add(seed, &report?);
    }
    measured.waits_ms.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(measured)
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments = arguments()?;
    println!(
        "{:30} hops    p50  bound     p99   bound flood p50 flood p99    msgs   flood elect budget  longest: seed",
        ""
    );
    let mut missed = 0;
    for formation in FORMATIONS {
        for radio in RADIOS {
            let name = format!("{}, {}", formation.0, radio.0);
            if arguments.only.iter().all(|it| name.contains(it.as_str())) {
                missed += usize::from(!measure(&arguments, formation, radio)?);
            }
        }
    }
    println!("{missed} combinations miss a bound");
    Ok(())
}

/// Runs one combination and prints its line. Returns whether it meets all bounds.
fn measure(
    arguments: &Arguments,
    (formation, formation_fields): Named,
    (radio, radio_fields): Named,
) -> Result<bool, Box<dyn Error>> {
    let mut results = Vec::new();
    for policy in &POLICIES[..1 + usize::from(arguments.compares)] {
        eprint!("\r  {formation}, {radio}, {policy} …\x1b[K");
        let policy = format!("protocol.policy={policy}");
        let set = formation_fields
            .iter()
            .chain(radio_fields)
            .map(|it| (*it).to_owned())
            .chain([policy])
            .collect::<Vec<_>>();
        results.push(fly(arguments, &set)?);
    }
    eprint!("\r\x1b[K");
    let tree = &results[0];
    let not_measured = Measured::default();
    let flood = results.get(1).unwrap_or(&not_measured);
    let [p50_max, p99_max] = tree.bounds_ms();
    let quantiles = [tree, flood].map(|it| [it.quantile(0.5), it.quantile(0.99)]);
    let [[p50, p99], [flood_p50, flood_p99]] = quantiles;
    let holds = p50 <= p50_max.min(flood_p50)
        && p99 <= p99_max.min(flood_p99)
        && (!arguments.compares || tree.received() <= flood.received() / 2.0)
        && tree.elections == 0
        && tree.over_budget == 0
        && tree.broken.is_empty();
    println!(
        "{formation:<14} {radio:<15} {:>4} {p50:>6.1} {p50_max:>6.0} {p99:>7.1} {p99_max:>7.0} {flood_p50:>9.1} \
         {flood_p99:>9.1} {:>7.0} {:>7.0} {:>5} {:>6} {:>7.1}: {} {}{}",
        tree.hops(),
        tree.received(),
        flood.received(),
        tree.elections,
        tree.over_budget,
        tree.waits_ms.last().map_or(f64::NAN, |it| it.0),
        tree.waits_ms.last().map_or(0, |it| it.1),
        tree.broken
            .iter()
            .take(3)
            .map(|it| format!("{}: {}; ", it.0, it.1))
            .collect::<String>(),
        if holds { "" } else { "MISSED" },
    );
    Ok(holds)
}
