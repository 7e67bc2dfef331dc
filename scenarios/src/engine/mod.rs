//! The two engines. Same scenario, same seed: the same trace, byte for byte, on both.

mod actors;
mod events;
mod run_limit;

use std::time::{Duration, Instant};

use thiserror::Error;

pub(crate) use self::run_limit::RunLimit;
pub use crate::report::Engine;
use crate::report::{Flight, Report, summary};
use crate::scenario::Scenario;
use crate::world::{Outcome, World};

/// Why a run could not be made: the machine's fault or ours, never the scenario's. Nothing is left behind.
#[derive(Debug, Error)]
pub enum RunError {
    /// The asynchronous runtime could not be built.
    #[error("no runtime for the actors")]
    Runtime(#[source] std::io::Error),
    /// An actor could not be started.
    #[error("an actor could not be started")]
    Spawn(#[source] ractor::SpawnErr),
}

/// How far a run is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Waypoints reached and landings made, all drones together.
    pub done: u64,
    /// How many of them there are in the scenario.
    pub total: u64,
    /// How far the clock of the world is, in whole simulated seconds.
    pub simulated_s: u64,
}

/// Whoever wants to know how far a run is; told once a simulated second.
pub type Watcher = Box<dyn FnMut(Progress) + Send>;

/// Flies a scenario from the order to take off until all drones are down, a rule is broken or the time is up.
///
/// # Errors
/// When the engine can't be started.
pub fn run(
    scenario: &Scenario,
    engine: Engine,
    watcher: Option<Watcher>,
) -> Result<(Report, Flight), RunError> {
    let started = Instant::now();
    let world = World::new(scenario);
    let outcome = fly_world(scenario, engine, world, watcher)?;
    Ok(summary(scenario, Some(engine), &outcome, started.elapsed()))
}

/// Likewise; a run that takes longer than `run_limit` of wall-clock time ends there and breaks rule 10.
///
/// # Errors
/// As [`run`].
pub(crate) fn run_within(
    run_limit: Duration,
    scenario: &Scenario,
    engine: Engine,
) -> Result<(Report, Flight), RunError> {
    let started = Instant::now();
    let outcome = fly_within(run_limit, scenario, engine)?;
    Ok(summary(scenario, Some(engine), &outcome, started.elapsed()))
}

/// As [`run_within`], without a report.
///
/// # Errors
/// As [`run`].
pub(crate) fn fly_within(
    run_limit: Duration,
    scenario: &Scenario,
    engine: Engine,
) -> Result<Outcome, RunError> {
    let world = World::new(scenario).within(RunLimit::begin(run_limit));
    fly_world(scenario, engine, world, None)
}

fn fly_world(
    scenario: &Scenario,
    engine: Engine,
    world: World,
    watcher: Option<Watcher>,
) -> Result<Outcome, RunError> {
    let meter = watcher.map(|watcher| Meter::new(scenario, watcher));
    let world = match engine {
        Engine::Actors => actors::run(scenario, world, meter)?,
        Engine::Events => events::run(scenario, world, meter),
    };
    Ok(world.finish())
}

/// The world of a scenario after it was flown.
#[cfg(test)]
pub(crate) fn flown(scenario: &Scenario) -> World {
    events::run(scenario, World::new(scenario), None)
}

/// Tells a watcher how far a run is.
struct Meter {
    watcher: Watcher,
    total: u64,
    told_s: Option<u64>,
}

impl Meter {
    fn new(scenario: &Scenario, watcher: Watcher) -> Self {
        let total = scenario.swarms().map(|(swarm, _)| swarm.steps()).sum();
        Self {
            watcher,
            total,
            told_s: None,
        }
    }

    fn read(&mut self, world: &World) {
        let simulated_s = world.now().as_nanos() / 1_000_000_000;
        if self.told_s != Some(simulated_s) {
            self.told_s = Some(simulated_s);
            (self.watcher)(Progress {
                done: world.steps_done().min(self.total),
                total: self.total,
                simulated_s,
            });
        }
    }
}
