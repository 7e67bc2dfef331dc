//! The two engines. The same scenario with the same seed has the same trace on both.

mod actors;
mod events;
mod run_limit;

use std::time::{Duration, Instant};

use thiserror::Error;

pub(crate) use self::run_limit::RunLimit;
pub use self::run_limit::Stop;
pub use crate::report::Engine;
use crate::report::{Flight, Report, summary};
use crate::scenario::Scenario;
use crate::world::{Ending, World};
pub use crate::world::{Injection, Outcome, Phase};

/// Why a run could not start. The cause is the computer or this program, never the scenario. It leaves nothing behind.
#[derive(Debug, Error)]
pub enum RunError {
    /// The asynchronous runtime could not be built.
    #[error("the asynchronous runtime could not be built")]
    Runtime(#[source] std::io::Error),
    /// An actor could not be started.
    #[error("an actor could not be started")]
    Spawn(#[source] ractor::SpawnErr),
}

/// The progress of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Waypoints reached and landings, of all drones together.
    pub done: u64,
    /// Their number in the whole scenario.
    pub total: u64,
    /// Simulated time, in whole seconds.
    pub simulated_s: u64,
}

/// Receives the progress of a run, once a simulated second.
pub type Watcher = Box<dyn FnMut(Progress) + Send>;

/// Flies a scenario from the order to take off until all drones are down, a rule is violated or the time is up.
///
/// # Errors
/// If the engine can't be started.
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

/// As [`run`], until a stop is wanted. `None` if it was.
///
/// # Errors
/// As [`run`].
pub fn run_until(
    stop: &Stop,
    scenario: &Scenario,
    engine: Engine,
) -> Result<Option<(Report, Flight)>, RunError> {
    let started = Instant::now();
    let world = World::new(scenario).within(RunLimit::until(stop.clone()));
    let outcome = fly_world(scenario, engine, world, None)?;
    if stop.is_wanted() {
        return Ok(None);
    }
    Ok(Some(summary(
        scenario,
        Some(engine),
        &outcome,
        started.elapsed(),
    )))
}

/// As [`run`]; a run that takes longer than `run_limit` of wall-clock time ends there and violates rule 10.
///
/// # Errors
/// As [`run`].
pub fn run_within(
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
pub fn fly_within(
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
    Ok(world.finish(Ending::Flown))
}

/// The world of a scenario after it was flown.
#[cfg(test)]
pub(crate) fn flown(scenario: &Scenario) -> World {
    events::run(scenario, World::new(scenario), None)
}

/// Reports the progress of a run to a watcher.
///
/// Invariant: at most one report a simulated second.
struct Meter {
    watcher: Watcher,
    total: u64,
    /// The second of the last report.
    reported_s: Option<u64>,
}

impl Meter {
    fn new(scenario: &Scenario, watcher: Watcher) -> Self {
        let total = scenario.swarms().map(|(swarm, _)| swarm.steps()).sum();
        Self {
            watcher,
            total,
            reported_s: None,
        }
    }

    fn read(&mut self, world: &World) {
        let simulated_s = world.now().as_nanos() / 1_000_000_000;
        if self.reported_s != Some(simulated_s) {
            self.reported_s = Some(simulated_s);
            (self.watcher)(Progress {
                done: world.steps_done().min(self.total),
                total: self.total,
                simulated_s,
            });
        }
    }
}
