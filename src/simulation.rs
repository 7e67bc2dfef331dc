//! Simulations with agents of one's own.

use std::path::{Path, PathBuf};

use muster_machines::agent::Agent;
use muster_machines::identity::NodeId;
use muster_runtime::agents::{AgentFactory, AgentSpec};
use muster_runtime::diagnostic::BadInput;
use muster_scenarios::engine::{self, Engine, RunError, Stop};
use muster_scenarios::report::{self, Flight, Report, ReportFiles, WriteError};
use muster_scenarios::scenario::{self, Override, Scenario};
use thiserror::Error;

/// A scenario that is ready to fly.
#[derive(Debug, Clone)]
pub struct Sim {
    path: PathBuf,
    overrides: Vec<Override>,
    factory: Option<AgentFactory>,
    engine: Engine,
}

/// Why a simulation can't be set up or flown.
#[derive(Debug, Error)]
pub enum Error {
    /// A file, a field or a value is not accepted. Nothing was flown.
    #[error("{0}")]
    BadInput(String),
    /// There is no such field.
    #[error("{0}")]
    Field(String),
    /// The scenario, or one of its other swarms, names an agent that the program does not have.
    #[error(
        "the scenario needs the agent `{0}`; install it, or give one with `Sim::agents`, which are those of its own swarm"
    )]
    NoAgent(String),
    /// The machine could not start the run.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The report could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

impl From<BadInput> for Error {
    fn from(input: BadInput) -> Self {
        Self::BadInput(format!("{:?}", miette::Report::new(input)))
    }
}

impl Sim {
    /// Reads a scenario file.
    ///
    /// # Errors
    /// The file can't be used.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, Error> {
        let sim = Self {
            path: path.as_ref().to_owned(),
            overrides: Vec::new(),
            factory: None,
            engine: Engine::Events,
        };
        sim.scenario()?;
        Ok(sim)
    }

    /// Sets a field of the scenario, as `--set` does.
    ///
    /// # Errors
    /// There is no such field, or the value does not fit.
    #[expect(clippy::needless_pass_by_value, reason = "a number is given as it is")]
    pub fn set(mut self, field: &str, value: impl ToString) -> Result<Self, Error> {
        let field = format!("{field}={}", value.to_string());
        self.replace(field.parse().map_err(Error::Field)?);
        self.scenario()?;
        Ok(self)
    }

    /// Adds an override, instead of an earlier one of the same field.
    fn replace(&mut self, change: Override) {
        self.overrides.retain(|it| it.key() != change.key());
        self.overrides.push(change);
    }

    /// Sets the random seed.
    #[must_use]
    pub fn seed(mut self, seed: u64) -> Self {
        self.replace(Override::seed(&seed.to_string()));
        self
    }

    /// Flies with agents that `new` builds, whatever name the scenario gives them. Other swarms of the scenario have the agents
    /// that the program has installed.
    ///
    /// # Errors
    /// The scenario's protocol is not "agent".
    pub fn agents(
        self,
        new: impl Fn(NodeId) -> Box<dyn Agent> + Send + Sync + 'static,
    ) -> Result<Self, Error> {
        self.agents_from(AgentFactory::new(move |spec: &AgentSpec| {
            Ok::<_, std::convert::Infallible>(new(spec.id))
        }))
    }

    /// Flies with agents of this factory, which takes the scenario's parameters.
    ///
    /// # Errors
    /// The scenario's protocol is not "agent", or the agents refuse the parameters.
    pub fn agents_from(mut self, factory: AgentFactory) -> Result<Self, Error> {
        self.factory = Some(factory);
        self.scenario()?;
        Ok(self)
    }

    /// Flies with this engine; both give the same flight. The default is [`Engine::Events`].
    #[must_use]
    pub const fn engine(mut self, engine: Engine) -> Self {
        self.engine = engine;
        self
    }

    /// The scenario with all that was set.
    ///
    /// # Errors
    /// As [`Self::set`] and [`Self::agents_from`].
    pub fn scenario(&self) -> Result<Scenario, Error> {
        let mut scenario = scenario::load_for(&self.path, &self.overrides, None)?;
        if let Some(factory) = &self.factory {
            let drones = scenario.plan.layout.formation().drones();
            let Some(agent) = scenario.plan.agent_mut() else {
                let path = self.path.display();
                let message = format!(
                    "{path}: agents need `protocol.kind = \"agent\"` and a table `[agent]`"
                );
                return Err(Error::BadInput(message));
            };
            agent
                .replace(factory.clone(), drones)
                .map_err(|error| Error::BadInput(format!("the agent's parameters: {error}")))?;
        }
        Ok(scenario)
    }

    /// Flies the scenario until all drones are down, a rule is broken or the time is up.
    ///
    /// # Errors
    /// The run can't be started.
    pub fn run(&self) -> Result<Run, Error> {
        let never = Stop::when(|| false);
        let run = self.run_until(&never)?;
        Ok(run.expect("no stop is wanted"))
    }

    /// As [`Self::run`], until a stop is wanted. `None` if it was.
    ///
    /// # Errors
    /// As [`Self::run`].
    pub fn run_until(&self, stop: &Stop) -> Result<Option<Run>, Error> {
        let scenario = self.scenario()?;
        let others = scenario.others.iter().map(|(swarm, _)| swarm);
        let agents = std::iter::once(&scenario).chain(others);
        let mut agents = agents.filter_map(|swarm| swarm.plan.agent.as_ref());
        if let Some(missing) = agents.find(|agent| !agent.is_available()) {
            return Err(Error::NoAgent(missing.name.clone()));
        }
        let Some((mut report, flight)) = engine::run_until(stop, &scenario, self.engine)? else {
            return Ok(None);
        };
        if self.factory.is_some() {
            tell_own_program(&mut report);
        }
        Ok(Some(Run { report, flight }))
    }
}

/// No command of muster has the agents that a program gives in its code.
fn tell_own_program(report: &mut Report) {
    let set: String = report
        .overrides
        .iter()
        .map(|it| format!(", {it}"))
        .collect();
    report.command = format!(
        "# flown by a program with agents of its own: {}, seed {}{set}",
        report.scenario, report.seed
    );
    for other in &mut report.others {
        other.command.clone_from(&report.command);
    }
}

/// A finished run.
#[derive(Debug)]
pub struct Run {
    /// Its figures.
    pub report: Report,
    /// The tracks of its drones.
    pub flight: Flight,
}

impl Run {
    /// Writes `report.html`, `report.json` and `tracks.csv` into a folder.
    ///
    /// # Errors
    /// The system refuses; see [`report::write`].
    pub fn write(&self, folder: impl AsRef<Path>) -> Result<ReportFiles, Error> {
        Ok(report::write(folder.as_ref(), &self.report, &self.flight)?)
    }
}
