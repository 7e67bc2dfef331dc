//! The agents that a program has, by name, and what they are built from.

use std::collections::BTreeMap;
use std::error::Error;
use std::fmt;
use std::panic::resume_unwind;
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use muster_machines::agent::{self, Agent, Context};
use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use thiserror::Error;

use crate::diagnostic::plain;

/// What an agent is built from.
#[derive(Debug, Clone)]
pub struct AgentSpec {
    /// The drone.
    pub id: NodeId,
    /// Number of drones of the swarm.
    pub drones: u32,
    parameters: Arc<Parameters>,
}

impl AgentSpec {
    /// The fields of `[agent.parameters]` in the scenario file, as a type of one's own.
    ///
    /// # Errors
    /// A field is missing, unknown or has another type. The factory returns that, and the file is refused at that place.
    pub fn parameters<T: DeserializeOwned>(&self) -> Result<T, ParametersError> {
        let table = self.parameters.table.clone();
        table.try_into().map_err(|error| {
            let located = self.parameters.locate::<T>();
            ParametersError(located.unwrap_or(error))
        })
    }
}

/// The fields of `[agent.parameters]` are not those that the agent takes.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("{}", plain(.0.message()))]
pub struct ParametersError(pub(crate) toml::de::Error);

/// The table `[agent.parameters]`, and the scenario file's text if it has that table.
#[derive(Default)]
pub(crate) struct Parameters {
    pub(crate) table: toml::Table,
    pub(crate) file: Option<String>,
}

/// Without the text: scenarios that differ in a comment are equal.
impl fmt::Debug for Parameters {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.table.fmt(f)
    }
}

impl Parameters {
    /// Why the table is none of these, with its place in the file.
    fn locate<T: DeserializeOwned>(&self) -> Option<toml::de::Error> {
        #[derive(Deserialize)]
        struct File<T> {
            #[serde(rename = "agent")]
            _agent: Agent<T>,
        }
        #[derive(Deserialize)]
        struct Agent<T> {
            #[serde(rename = "parameters")]
            _parameters: T,
        }
        toml::from_str::<File<T>>(self.file.as_ref()?).err()
    }
}

type New = dyn Fn(&AgentSpec) -> Result<Box<dyn Agent>, Box<dyn Error + Send + Sync>> + Send + Sync;

/// Builds agents of one kind.
#[derive(Clone)]
pub struct AgentFactory(Arc<New>);

impl AgentFactory {
    /// A factory that calls `new` for each drone, and again after each restart of its agent. An error refuses the scenario
    /// file: it must depend on the parameters only.
    pub fn new<A, E>(new: impl Fn(&AgentSpec) -> Result<A, E> + Send + Sync + 'static) -> Self
    where
        A: Agent + 'static,
        E: Into<Box<dyn Error + Send + Sync>>,
    {
        Self(Arc::new(move |spec| match new(spec) {
            Ok(agent) => Ok(Box::new(agent)),
            Err(error) => Err(error.into()),
        }))
    }

    fn build(&self, spec: &AgentSpec) -> Result<Box<dyn Agent>, Box<dyn Error + Send + Sync>> {
        (self.0)(spec)
    }
}

impl fmt::Debug for AgentFactory {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("AgentFactory").finish_non_exhaustive()
    }
}

/// Agents by name.
#[derive(Debug, Clone, Default)]
pub struct Agents(BTreeMap<String, AgentFactory>);

static INSTALLED: OnceLock<Agents> = OnceLock::new();

impl Agents {
    /// Adds an agent, or replaces the one of that name.
    #[must_use]
    pub fn with(mut self, name: &str, factory: AgentFactory) -> Self {
        self.0.insert(name.to_owned(), factory);
        self
    }

    /// Adds all agents of others; those of the same name are replaced.
    #[must_use]
    pub fn and(mut self, others: Self) -> Self {
        self.0.extend(others.0);
        self
    }

    /// The names, in alphabetical order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.0.keys().map(String::as_str)
    }

    /// Makes these the agents of the program: scenario files name them.
    ///
    /// # Errors
    /// The program has agents already; they stay.
    pub fn install(self) -> Result<(), AlreadyInstalled> {
        INSTALLED.set(self).map_err(|_| AlreadyInstalled)
    }

    /// The agents of the program.
    pub fn installed() -> &'static Self {
        static NONE: Agents = Agents(BTreeMap::new());
        INSTALLED.get().unwrap_or(&NONE)
    }

    fn find(&self, name: &str) -> Option<AgentFactory> {
        self.0.get(name).cloned()
    }
}

/// The program has agents already.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("the program's agents are installed once, before the first scenario is read")]
pub struct AlreadyInstalled;

/// The agent of a plan.
#[derive(Debug, Clone)]
pub struct PlannedAgent {
    /// Its name.
    pub name: String,
    /// Waypoints of the mission file; waypoint 0 is the centre of the slots.
    pub waypoints: Arc<[Ned]>,
    /// Period of its telemetry.
    pub telemetry: Duration,
    /// Highest altitude that it may fly to, in metres above home.
    pub altitude_max_m: f64,
    parameters: Arc<Parameters>,
    factory: Option<AgentFactory>,
}

impl PlannedAgent {
    pub(crate) fn new(
        name: &str,
        waypoints: Arc<[Ned]>,
        (telemetry, altitude_max_m): (Duration, f64),
        parameters: Parameters,
        agents: &Agents,
    ) -> Self {
        Self {
            name: name.to_owned(),
            waypoints,
            telemetry,
            altitude_max_m,
            parameters: Arc::new(parameters),
            factory: agents.find(name),
        }
    }

    /// Whether the program has this agent. Without it, the drones land as soon as they are in their slots.
    #[must_use]
    pub const fn is_available(&self) -> bool {
        self.factory.is_some()
    }

    /// Flies with these agents instead of the program's of that name.
    ///
    /// # Errors
    /// The factory refuses the parameters. Nothing has changed.
    pub fn replace(
        &mut self,
        factory: AgentFactory,
        drones: u32,
    ) -> Result<(), Box<dyn Error + Send + Sync>> {
        factory.build(&self.spec(NodeId(0), drones))?;
        self.factory = Some(factory);
        Ok(())
    }

    /// Flies with agents of a factory that takes the same parameters as the one before. It is not tried.
    pub fn replace_untried(&mut self, factory: AgentFactory) {
        self.factory = Some(factory);
    }

    /// Flies with the agents of another plan, which has the same parameters.
    pub fn replace_by_those_of(&mut self, other: &Self) {
        self.factory.clone_from(&other.factory);
    }

    /// Whether the agent accepts its parameters.
    ///
    /// # Errors
    /// It does not.
    pub(crate) fn check(&self, drones: u32) -> Result<(), Box<dyn Error + Send + Sync>> {
        let spec = self.spec(NodeId(0), drones);
        match &self.factory {
            Some(factory) => factory.build(&spec).map(drop),
            None => Ok(()),
        }
    }

    fn spec(&self, id: NodeId, drones: u32) -> AgentSpec {
        AgentSpec {
            id,
            drones,
            parameters: Arc::clone(&self.parameters),
        }
    }

    /// Builds the agent of a drone.
    pub(crate) fn factory(&self, id: NodeId, drones: u32) -> agent::Factory {
        let spec = self.spec(id, drones);
        let factory = self.factory.clone();
        agent::Factory::new(move || match &factory {
            // The host restarts the agent. No panic hook is called: the report has the error.
            Some(factory) => (factory.build(&spec))
                .unwrap_or_else(|error| resume_unwind(Box::new(error.to_string()))),
            None => Box::new(Missing),
        })
    }
}

/// Stands in for an agent that the program does not have.
struct Missing;

impl Agent for Missing {
    fn start(&mut self, context: &mut Context<'_>) {
        context.land();
    }
}
