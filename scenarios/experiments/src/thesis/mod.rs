//! The thesis's five experiments, simulated and compared with its figures.

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
use muster_scenarios::engine::{self, Engine, RunError, Watcher};
use muster_scenarios::scenario::{Override, Scenario, load};

/// Tables 9 to 13 of the thesis.
const TABLES: &str = include_str!("tables-9-13.csv");

/// The shipped scenario of the ancestor's swarm, with its settling time.
const ANCESTOR: &str = "ancestor";
/// Index of the experiment with published waits, from 0.
const WITH_WAITS: usize = 1;
/// Default number of runs over which the waits are averaged, because waits of one run scatter.
pub const RUNS: u32 = 20;
/// Maximum number of such runs.
pub const RUNS_MAX: u32 = 1_000;

/// Published figures of one experiment. Times are in seconds.
#[derive(Debug, Clone, PartialEq, serde::Deserialize)]
pub struct Published {
    /// Name of the shipped scenario.
    pub scenario: String,
    /// Description of the swarm.
    pub swarm: String,
    /// Number of the table.
    pub table: u8,
    /// Flight time of the master; the same in all experiments.
    pub master_s: f64,
    /// Longest flight time.
    pub maximum_s: f64,
    /// Mean flight time.
    pub mean_s: f64,
    /// Mean number of messages received.
    pub messages_received: f64,
}

impl Published {
    /// Flight time of a member with its slot `distance_m` metres from the master's slot, by the law of the tables.
    ///
    /// It flies to its landing place beside the master at 10 m/s. 12.4 s are for acceleration, deceleration and orders.
    #[must_use]
    pub fn member_s(&self, distance_m: f64) -> f64 {
        self.master_s + distance_m / 10.0 + 12.4
    }
}

/// Published figures, by experiment.
#[must_use]
pub fn published() -> Vec<Published> {
    let mut tables = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .from_reader(TABLES.as_bytes());
    tables
        .deserialize()
        .collect::<Result<_, _>>()
        .expect("the built-in file is valid")
}

/// The scenarios of a comparison.
#[derive(Debug)]
pub struct Flights {
    experiments: Vec<(Published, Scenario)>,
    /// The second experiment, with a master that waits for its neighbours only.
    neighbours: Scenario,
    /// The same with the ancestor's settling time.
    settling: Scenario,
    /// The ancestor's swarm.
    ancestor: Scenario,
    /// Number of runs over which the waits are averaged, from 1 to [`RUNS_MAX`].
    runs: u32,
}

impl Flights {
    /// Loads the built-in scenarios with `overrides`. The waits are averaged over `runs` runs, clamped to 1–[`RUNS_MAX`].
    ///
    /// # Errors
    /// If a scenario with these overrides is invalid.
    pub fn load(overrides: &[Override], runs: u32) -> Result<Self, BadInput> {
        let experiments = published()
            .into_iter()
            .map(|published| {
                let scenario = load(Path::new(&published.scenario), overrides)?;
                Ok((published, scenario))
            })
            .collect::<Result<Vec<_>, BadInput>>()?;
        let ancestor = load(Path::new(ANCESTOR), overrides)?;
        let with_waits = |fields: &[&str]| {
            let fields = fields.iter().map(|field| field.parse());
            let fields = fields.map(|field| field.expect("the field exists"));
            let overrides: Vec<_> = overrides.iter().cloned().chain(fields).collect();
            load(Path::new(&experiments[WITH_WAITS].0.scenario), &overrides)
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

    /// Seed of the five experiments, and first seed of the waits.
    #[must_use]
    pub const fn seed(&self) -> u64 {
        self.neighbours.seed
    }

    /// Runs the five experiments in sequence. Calls `watcher` before each run to get its watcher.
    ///
    /// # Errors
    /// If the engine can't be started.
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

    /// Runs all scenarios with the first seed in sequence. Calls `watcher` before each run to get its watcher.
    ///
    /// Then runs the scenarios of the waits with further seeds, `jobs` at a time, always on the events engine, which gives
    /// the same flights faster. Calls `progress` with the number of finished runs and of all runs after each.
    ///
    /// # Errors
    /// If the engine can't be started.
    pub fn fly(
        &self,
        engine: Engine,
        jobs: NonZeroUsize,
        mut watcher: impl FnMut(&Scenario) -> Option<Watcher>,
        progress: impl FnMut(usize, usize),
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
        ] = further::fly(with_waits, &seeds[1..], jobs, progress)?;
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

#[cfg(test)]
mod tests;
