//! The thesis's five experiments, flown here and set beside what it says of them.

mod compare;
mod further;
mod html;
mod table;
mod write;

pub use compare::{Comparison, Delays, Experiment, Quantity, SingleHop, Wait, Waits, WaitsRuns};
pub use table::table;
pub use write::{THESIS_HTML, THESIS_JSON, write};

use std::num::NonZeroUsize;
use std::path::Path;

use muster_runtime::diagnostic::BadInput;

use crate::engine::{self, Engine, RunError, Watcher};
use crate::scenario::{Override, Scenario, load_from};

/// What the tables 9 to 13 say.
const TABLES: &str = include_str!("tables-9-13.csv");

/// The scenarios of the experiments, in their order.
const SCENARIOS: [&str; 5] = [
    include_str!("../../thesis-1.toml"),
    include_str!("../../thesis-2.toml"),
    include_str!("../../thesis-3.toml"),
    include_str!("../../thesis-4.toml"),
    include_str!("../../thesis-5.toml"),
];
/// The ancestor's swarm, with vehicles that take as long to come to rest as its own.
const ANCESTOR: (&str, &str) = ("ancestor.toml", include_str!("../../ancestor.toml"));
/// The mission that they share.
const MISSION: &str = include_str!("../../missions/albufera.plan");
/// The experiment whose waits at the waypoints the thesis measures, counted from 0.
const WITH_WAITS: usize = 1;
/// How many runs the waits are the means of, unless another number is asked for: those of one run scatter.
pub const RUNS: u32 = 20;
/// The most of them.
pub const RUNS_MAX: u32 = 1_000;

/// What the thesis says of one of its experiments. Times are in seconds.
#[derive(Debug, Clone, PartialEq, serde::Deserialize)]
pub struct Published {
    /// The scenario's file, among the shipped ones.
    pub scenario: String,
    /// Who flies, in words.
    pub swarm: String,
    /// The number of the table.
    pub table: u8,
    /// The flight time that the master has in all of them.
    pub master_s: f64,
    /// The longest flight time.
    pub maximum_s: f64,
    /// The mean of the flight times.
    pub mean_s: f64,
    /// The mean of the messages that drones received.
    pub messages_received: f64,
}

impl Published {
    /// How long a slave flies whose slot is `distance_m` metres from the master's: the law that the tables obey. It
    /// flies to its place beside the master at 10 m/s, and speeds up, slows down and is told to in 12.4 s.
    #[must_use]
    pub fn slave_s(&self, distance_m: f64) -> f64 {
        self.master_s + distance_m / 10.0 + 12.4
    }
}

/// What the thesis says, experiment by experiment.
#[must_use]
pub fn published() -> Vec<Published> {
    let mut tables = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .from_reader(TABLES.as_bytes());
    tables
        .deserialize()
        .collect::<Result<_, _>>()
        .expect("the file is a part of the program")
}

/// The flights that a comparison takes.
#[derive(Debug)]
pub struct Flights {
    experiments: Vec<(Published, Scenario)>,
    /// The second experiment once more, its master waiting for its neighbours only.
    neighbours: Scenario,
    /// Likewise, its vehicles coming to rest as the ancestor's.
    settling: Scenario,
    /// The ancestor's swarm.
    ancestor: Scenario,
    /// How many runs the waits are the means of; at least one.
    runs: u32,
}

impl Flights {
    /// The shipped scenarios, which are a part of the program, each with `overrides`. The waits are the means of `runs`
    /// runs, of which there is one at least and [`RUNS_MAX`] at most.
    ///
    /// # Errors
    /// When a scenario with these fields can't be used.
    pub fn load(overrides: &[Override], runs: u32) -> Result<Self, BadInput> {
        let experiments = published()
            .into_iter()
            .zip(SCENARIOS)
            .map(|(published, text)| {
                let scenario = shipped(&published.scenario, text, overrides)?;
                Ok((published, scenario))
            })
            .collect::<Result<Vec<_>, BadInput>>()?;
        let ancestor = shipped(ANCESTOR.0, ANCESTOR.1, overrides)?;
        let with_waits = |fields: &[&str]| {
            let fields = fields.iter().map(|field| field.parse());
            let fields = fields.map(|field| field.expect("there is such a field"));
            let overrides: Vec<_> = overrides.iter().cloned().chain(fields).collect();
            let name = &experiments[WITH_WAITS].0.scenario;
            shipped(name, SCENARIOS[WITH_WAITS], &overrides)
        };
        let barrier = "protocol.barrier=neighbours";
        let settle = format!("vehicle.settle_ms={}", ancestor.plan.settle.as_millis());
        Ok(Self {
            neighbours: with_waits(&[barrier])?,
            settling: with_waits(&[barrier, &settle])?,
            ancestor,
            experiments,
            runs: runs.clamp(1, RUNS_MAX),
        })
    }

    /// The seed of the five experiments, and the first of those of the waits.
    #[must_use]
    pub const fn seed(&self) -> u64 {
        self.neighbours.seed
    }

    /// Flies the five experiments, one after the other; `watcher` is asked before each for whoever watches it.
    ///
    /// # Errors
    /// When the engine can't be started.
    pub fn fly_experiments(
        &self,
        engine: Engine,
        mut watcher: impl FnMut(&Scenario) -> Option<Watcher>,
    ) -> Result<Vec<Experiment>, RunError> {
        let experiments = self.experiments.iter().map(|(published, scenario)| {
            let (report, _) = engine::run(scenario, engine, watcher(scenario))?;
            Ok(Experiment::new(published, scenario, report))
        });
        experiments.collect()
    }

    /// Flies all with the first seed, one after the other; `watcher` is asked before each for whoever watches it. Then
    /// flies those whose waits are compared with the seeds after it, `jobs` at once and always on the event heap, which
    /// gives the same flights sooner; `told` hears after each how many of how many are done.
    ///
    /// # Errors
    /// When the engine can't be started.
    pub fn fly(
        &self,
        engine: Engine,
        jobs: NonZeroUsize,
        mut watcher: impl FnMut(&Scenario) -> Option<Watcher>,
        told: impl FnMut(usize, usize),
    ) -> Result<Comparison, RunError> {
        let experiments = self.fly_experiments(engine, &mut watcher)?;
        let mut fly = |scenario: &Scenario| {
            let (report, _) = engine::run(scenario, engine, watcher(scenario))?;
            Ok(report)
        };
        let neighbours = fly(&self.neighbours)?;
        let settling = fly(&self.settling)?;
        let ancestor = fly(&self.ancestor)?;
        let strict = &experiments[WITH_WAITS].report;
        let seeds = further::seeds(self.seed(), self.runs);
        let with_waits = [
            &self.experiments[WITH_WAITS].1,
            &self.neighbours,
            &self.settling,
            &self.ancestor,
        ];
        let [
            further_strict,
            further_neighbours,
            further_settling,
            further_ancestor,
        ] = further::fly(with_waits, &seeds[1..], jobs, told)?;
        Ok(Comparison {
            seed: self.seed(),
            engine,
            waits_runs: WaitsRuns {
                seeds,
                engine_after_first: further::ENGINE,
            },
            waits: Waits {
                thesis: Wait::THESIS,
                strict: Wait::of(strict, &further_strict),
                neighbours: Wait::of(&neighbours, &further_neighbours),
                settling: Wait::of(&settling, &further_settling),
            },
            single_hop: SingleHop {
                ancestor: Delays::ANCESTOR,
                ours: Delays::of(&ancestor, &further_ancestor),
            },
            experiments,
            neighbours,
            settling,
            ancestor,
            further: [
                further_strict,
                further_neighbours,
                further_settling,
                further_ancestor,
            ]
            .concat(),
        })
    }
}

/// A shipped scenario from its text.
fn shipped(name: &str, text: &str, overrides: &[Override]) -> Result<Scenario, BadInput> {
    let path = Path::new("scenarios").join(name);
    load_from(&path, overrides, &|asked| {
        let text = if asked == path { text } else { MISSION };
        Ok(text.to_owned())
    })
}

#[cfg(test)]
mod tests;
