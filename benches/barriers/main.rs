//! What a waypoint costs, by formation, radio and policy: `cargo bench --bench barriers`. Each cell flies the mission of
//! `scenarios/barriers.toml` with many seeds and is held against the bounds that `tree` is to keep.
//!
//! `-- --seeds 0..20 --only csma --parameters fast --jobs 2` flies less, or with another set of parameters.

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

/// A name and the fields that it stands for.
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

/// What came of all flights of a cell by one policy.
#[derive(Debug, Default)]
struct Cell {
    /// Waits at waypoints, in milliseconds, in rising order, each with its seed.
    waits_ms: Vec<(f64, u64)>,
    hops: Vec<u16>,
    drones: usize,
    received: f64,
    flights: u64,
    elections: usize,
    over_budget: u64,
    /// Seeds of flights that broke a rule or did not fly their mission to its end, each with what was wrong.
    broken: Vec<(u64, String)>,
}

impl Cell {
    fn take(&mut self, seed: u64, report: &Report) {
        let wait = |it: &Barrier| (it.wait_s() * 1e3, seed);
        self.waits_ms.extend(report.barriers.iter().map(wait));
        self.hops
            .extend(report.drones.iter().filter_map(|it| it.hops).max());
        self.drones = report.drones.len();
        self.received += report.means.messages_received;
        self.flights += 1;
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

    /// The wait that this share of all waits do not exceed.
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

    /// The hops of the farthest drone, in the median flight.
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
        self.received / self.flights as f64
    }
}

struct Arguments {
    seeds: Range<u64>,
    only: Vec<String>,
    set: Vec<String>,
    jobs: usize,
    /// Whether `flood` is flown too, to compare with.
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
                "unknown argument {word}; accepted: --seeds, --only, --set, --parameters, --jobs"
            )
            .into()),
        }
    }
    Ok(arguments)
}

fn fly(arguments: &Arguments, set: &[String]) -> Result<Cell, Box<dyn Error>> {
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
    let mut cell = Cell::default();
    for (seed, report) in reports {
        cell.take(seed, &report?);
    }
    cell.waits_ms.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(cell)
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments = arguments()?;
    println!(
        "{:30} hops    p50  bound     p99   bound flood p50 flood p99    msgs   flood elect budget  longest: seed",
        ""
    );
    let mut missed = 0;
    for (formation, place) in FORMATIONS {
        for (radio, model) in RADIOS {
            let name = format!("{formation}, {radio}");
            if !arguments.only.is_empty()
                && !arguments.only.iter().all(|it| name.contains(it.as_str()))
            {
                continue;
            }
            let mut cells = Vec::new();
            for policy in &POLICIES[..1 + usize::from(arguments.compares)] {
                eprint!("\r  {name}, {policy} …\x1b[K");
                let policy = format!("protocol.policy={policy}");
                let set = place
                    .iter()
                    .chain(model)
                    .map(|it| (*it).to_owned())
                    .chain([policy])
                    .collect::<Vec<_>>();
                cells.push(fly(&arguments, &set)?);
            }
            eprint!("\r\x1b[K");
            let tree = &cells[0];
            let unbound = Cell::default();
            let flood = cells.get(1).unwrap_or(&unbound);
            let [p50_max, p99_max] = tree.bounds_ms();
            let quantiles = [tree, flood].map(|it| [it.quantile(0.5), it.quantile(0.99)]);
            let [[p50, p99], [flood_p50, flood_p99]] = quantiles;
            let holds = p50 <= p50_max.min(flood_p50)
                && p99 <= p99_max.min(flood_p99)
                && (!arguments.compares || tree.received() <= flood.received() / 2.0)
                && tree.elections == 0
                && tree.over_budget == 0
                && tree.broken.is_empty();
            missed += usize::from(!holds);
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
        }
    }
    println!("{missed} cells miss a bound");
    Ok(())
}
