//! Runs and campaigns.

use std::path::PathBuf;
use std::sync::Arc;

use muster::{AgentFactory, AgentSpec, Engine};
use pyo3::create_exception;
use pyo3::exceptions::{PyException, PyValueError};
use pyo3::prelude::*;

use crate::agent::PyAgent;
use crate::campaign::Campaign;
use crate::interrupt::Interrupt;

create_exception!(
    muster,
    MusterError,
    PyException,
    "A scenario, a field or a run was refused."
);

/// With its causes, such as what the system said.
fn refuse(error: muster::Error) -> PyErr {
    MusterError::new_err(muster::with_causes(&error))
}

/// A scenario that is ready to fly.
#[pyclass(module = "muster", frozen)]
pub(crate) struct Sim {
    sim: muster::Sim,
    /// Builds the agents.
    new: Option<Arc<Py<PyAny>>>,
}

impl Sim {
    /// Changed, with the same agents.
    fn with(&self, sim: muster::Sim) -> Self {
        let new = self.new.clone();
        Self { sim, new }
    }

    /// For one call: the scenario, and what ends it early. Its agents raise into that.
    fn begin(&self) -> (muster::Sim, Arc<Interrupt>) {
        let (sim, interrupt) = (self.sim.clone(), Arc::default());
        let sim = match &self.new {
            Some(new) => sim.agents_untried(factory(new, &interrupt)),
            None => sim,
        };
        (sim, interrupt)
    }
}

/// Agents that raise into `interrupt`.
fn factory(new: &Arc<Py<PyAny>>, interrupt: &Arc<Interrupt>) -> AgentFactory {
    let (new, interrupt) = (Arc::clone(new), Arc::clone(interrupt));
    AgentFactory::new(move |spec: &AgentSpec| PyAgent::new(&new, spec, &interrupt))
}

/// What was raised, or else what was refused or has come of a call.
fn outcome<T>(interrupt: &Interrupt, called: Result<Option<T>, muster::Error>) -> PyResult<T> {
    match (interrupt.take(), called) {
        (Some(raised), _) => Err(raised),
        (None, Err(error)) => Err(refuse(error)),
        (None, Ok(value)) => Ok(value.expect("a call ends early only by what was raised")),
    }
}

#[pymethods]
impl Sim {
    /// Reads a scenario file, or takes a shipped scenario by its name.
    #[new]
    fn new(scenario: PathBuf) -> PyResult<Self> {
        Ok(Self {
            sim: muster::Sim::load(scenario).map_err(refuse)?,
            new: None,
        })
    }

    /// A scenario with a field set, as with `--set`.
    fn set(&self, field: &str, value: &str) -> PyResult<Self> {
        let (sim, interrupt) = self.begin();
        let set = sim.set(field, value).map(Some);
        Ok(self.with(outcome(&interrupt, set)?))
    }

    /// A scenario with another random seed.
    fn seed(&self, seed: u64) -> Self {
        self.with(self.sim.clone().seed(seed))
    }

    /// A scenario that runs on the engine "events" (default) or "actors"; both give the same flight.
    fn engine(&self, name: &str) -> PyResult<Self> {
        let engine = match name {
            "events" => Engine::Events,
            "actors" => Engine::Actors,
            _ => {
                return Err(PyValueError::new_err(
                    "an engine is \"events\" or \"actors\"",
                ));
            }
        };
        Ok(self.with(self.sim.clone().engine(engine)))
    }

    /// A scenario with agents: `new(id)` builds the one of a drone.
    fn agents(&self, new: Py<PyAny>) -> PyResult<Self> {
        let (new, interrupt) = (Arc::new(new), Arc::default());
        let given = self.sim.clone().agents_from(factory(&new, &interrupt));
        Ok(Self {
            sim: outcome(&interrupt, given.map(Some))?,
            new: Some(new),
        })
    }

    /// Flies. Returns the report as JSON. Writes it, a page and tracks into `folder` if there is one.
    #[pyo3(signature = (folder = None))]
    fn run_json(&self, py: Python<'_>, folder: Option<PathBuf>) -> PyResult<String> {
        if let Some(folder) = &folder {
            muster::check_folder(folder).map_err(refuse)?;
        }
        let (sim, interrupt) = self.begin();
        let json = py.detach(|| {
            let run = sim.run_until(&interrupt.stop())?;
            let Some(run) = run.filter(|_| !interrupt.is_raised()) else {
                return Ok(None);
            };
            if let Some(folder) = folder {
                run.write(folder)?;
            }
            Ok(Some(
                serde_json::to_string(&run.report).expect("a report always serialises"),
            ))
        });
        outcome(&interrupt, json)
    }

    /// Flies each combination of the values of fields with each seed, on all processors. Returns the rows as JSON, in order.
    fn campaign_json(
        &self,
        py: Python<'_>,
        seeds: Vec<u64>,
        vary: Vec<(String, Vec<String>)>,
    ) -> PyResult<String> {
        let (sim, interrupt) = self.begin();
        let rows = py.detach(|| Campaign::new(&sim, seeds, &vary)?.fly(&interrupt));
        let rows = outcome(&interrupt, rows)?;
        Ok(serde_json::to_string(&rows).expect("a row always serialises"))
    }
}
