//! Simulations with agents of one's own.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use muster_experiments::output::{self, ReportFiles, WriteError};
use muster_machines::agent::Agent;
use muster_machines::identity::NodeId;
use muster_runtime::agents::{AgentFactory, AgentSpec};
use muster_runtime::diagnostic::BadInput;
use muster_scenarios::engine::{self, Engine, RunError, Stop};
use muster_scenarios::report::{Flight, Report};
use muster_scenarios::scenario::{self, Override, Scenario};
use thiserror::Error;

use crate::command::check_ancestors;

/// A scenario that is ready to fly. Its files are read once; later changes of them don't count.
#[derive(Debug, Clone)]
pub struct Sim {
    path: PathBuf,
    files: Files,
    overrides: Vec<Override>,
    /// Replaces the seed of the file and of the overrides.
    seed: Option<u64>,
    factory: Option<AgentFactory>,
    engine: Engine,
    /// What was read, with overrides and agents.
    scenario: Arc<Scenario>,
}

/// Texts of files, as first read.
#[derive(Debug, Clone, Default)]
struct Files(Arc<Mutex<BTreeMap<PathBuf, String>>>);

impl Files {
    fn read(&self, path: &Path) -> Result<String, BadInput> {
        let mut texts = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(text) = texts.get(path) {
            return Ok(text.clone());
        }
        let text = scenario::read(path)?;
        texts.insert(path.to_owned(), text.clone());
        Ok(text)
    }

    fn load(&self, path: &Path, overrides: &[Override]) -> Result<Scenario, BadInput> {
        scenario::load_for(path, overrides, &|file| self.read(file), None)
    }
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
        let (path, files) = (path.as_ref().to_owned(), Files::default());
        let scenario = Arc::new(files.load(&path, &[])?);
        Ok(Self {
            path,
            files,
            overrides: Vec::new(),
            seed: None,
            factory: None,
            engine: Engine::Events,
            scenario,
        })
    }

    /// Sets a field of the scenario, as `--set` does.
    ///
    /// # Errors
    /// There is no such field, or the value does not fit.
    #[expect(clippy::needless_pass_by_value, reason = "a number is given as it is")]
    pub fn set(mut self, field: &str, value: impl ToString) -> Result<Self, Error> {
        let field = format!("{field}={}", value.to_string());
        let change: Override = field.parse().map_err(Error::Field)?;
        if change.is_seed() {
            self.seed = None;
        }
        self.overrides.retain(|it| it.key() != change.key());
        self.overrides.push(change);
        self.read_again()
    }

    /// Sets the random seed.
    #[must_use]
    pub const fn seed(mut self, seed: u64) -> Self {
        self.seed = Some(seed);
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
        self.read_again()
    }

    /// Flies with agents of a factory that takes the same parameters as the one before. It builds none as a trial. Without
    /// `[agent]` in the scenario nothing changes.
    #[must_use]
    pub fn agents_untried(mut self, factory: AgentFactory) -> Self {
        if let Some(agent) = Arc::make_mut(&mut self.scenario).plan.agent_mut() {
            agent.replace_untried(factory.clone());
            self.factory = Some(factory);
        }
        self
    }

    /// Flies with this engine; both give the same flight. The default is [`Engine::Events`].
    #[must_use]
    pub const fn engine(mut self, engine: Engine) -> Self {
        self.engine = engine;
        self
    }

    /// The scenario with all that was set but by [`Self::seed`].
    #[must_use]
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// With the fields and agents that were set.
    fn read_again(mut self) -> Result<Self, Error> {
        let mut scenario = self.files.load(&self.path, &self.overrides)?;
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
        self.scenario = Arc::new(scenario);
        Ok(self)
    }

    /// The scenario with its seed.
    fn seeded(&self) -> Result<Cow<'_, Scenario>, Error> {
        let Some(seed) = self.seed else {
            return Ok(Cow::Borrowed(&self.scenario));
        };
        let load = |overrides: &[Override]| -> Result<Scenario, Error> {
            let mut scenario = self.files.load(&self.path, overrides)?;
            if let (Some(agent), Some(given)) =
                (scenario.plan.agent_mut(), &self.scenario.plan.agent)
            {
                agent.replace_by_those_of(given);
            }
            Ok(scenario)
        };
        self.scenario.with_seed_from(seed, load).map(Cow::Owned)
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
        let scenario = self.seeded()?;
        let others = scenario.others.iter().map(|(swarm, _)| swarm);
        let agents = std::iter::once(&*scenario).chain(others);
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

/// Refuses a folder that a report can't be written to, before a run. It is not created.
///
/// # Errors
/// The longest existing part of the path is no folder, or can't be written to.
pub fn check_folder(folder: impl AsRef<Path>) -> Result<(), Error> {
    let help = "a report needs a folder; it is created if it does not exist";
    Ok(check_ancestors(folder.as_ref(), help)?)
}

impl Run {
    /// Writes `report.html`, `report.json` and `tracks.csv` into a folder.
    ///
    /// # Errors
    /// The system refuses; see [`output::write`].
    pub fn write(&self, folder: impl AsRef<Path>) -> Result<ReportFiles, Error> {
        Ok(output::write(folder.as_ref(), &self.report, &self.flight)?)
    }
}
