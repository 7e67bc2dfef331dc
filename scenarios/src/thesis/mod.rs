//! The thesis's five experiments, flown here and set beside what it says of them.

mod compare;
mod html;
mod table;
mod write;

pub use compare::{Comparison, Delays, Experiment, Quantity, SingleHop, Wait, Waits};
pub use table::table;
pub use write::{THESIS_HTML, THESIS_JSON, write};

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
}

impl Flights {
    /// The shipped scenarios, which are a part of the program, each with `overrides`.
    ///
    /// # Errors
    /// When a scenario with these fields can't be used.
    pub fn load(overrides: &[Override]) -> Result<Self, BadInput> {
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
        let settle = format!("vehicle.settle_ms={}", ancestor.settle.as_millis());
        Ok(Self {
            neighbours: with_waits(&[barrier])?,
            settling: with_waits(&[barrier, &settle])?,
            ancestor,
            experiments,
        })
    }

    /// The seed of every one.
    #[must_use]
    pub const fn seed(&self) -> u64 {
        self.neighbours.seed
    }

    /// Flies all, one after the other; `watcher` is asked before each for whoever watches it.
    ///
    /// # Errors
    /// When the engine can't be started.
    pub fn fly(
        &self,
        engine: Engine,
        mut watcher: impl FnMut(&Scenario) -> Option<Watcher>,
    ) -> Result<Comparison, RunError> {
        let mut fly = |scenario: &Scenario| {
            let (report, _) = engine::run(scenario, engine, watcher(scenario))?;
            Ok(report)
        };
        let mut experiments = Vec::new();
        for (published, scenario) in &self.experiments {
            experiments.push(Experiment::new(published, scenario, fly(scenario)?));
        }
        let neighbours = fly(&self.neighbours)?;
        let settling = fly(&self.settling)?;
        let ancestor = fly(&self.ancestor)?;
        Ok(Comparison {
            seed: self.seed(),
            engine,
            waits: Waits::new(&experiments[WITH_WAITS].report, &neighbours, &settling),
            single_hop: SingleHop::new(&ancestor),
            experiments,
            neighbours,
            settling,
            ancestor,
        })
    }
}

/// A shipped scenario from its text.
fn shipped(name: &str, text: &str, overrides: &[Override]) -> Result<Scenario, BadInput> {
    let path = Path::new("scenarios").join(name);
    load_from(&path, overrides, |asked| {
        let text = if asked == path { text } else { MISSION };
        Ok(text.to_owned())
    })
}

#[cfg(test)]
mod tests;
