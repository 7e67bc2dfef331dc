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
    /// Shared with the agents.
    interrupt: Arc<Interrupt>,
}

impl Sim {
    /// Changed, with the same agents.
    fn with(&self, sim: muster::Sim) -> Self {
        let interrupt = Arc::clone(&self.interrupt);
        Self { sim, interrupt }
    }

    /// What an interrupt raised, or the error.
    fn refuse(&self, error: muster::Error) -> PyErr {
        self.interrupt.take().unwrap_or_else(|| refuse(error))
    }
}

#[pymethods]
impl Sim {
    /// Reads a scenario file, or takes a shipped scenario by its name.
    #[new]
    fn new(scenario: PathBuf) -> PyResult<Self> {
        Ok(Self {
            sim: muster::Sim::load(scenario).map_err(refuse)?,
            interrupt: Arc::default(),
        })
    }

    /// A scenario with a field set, as with `--set`.
    fn set(&self, field: &str, value: &str) -> PyResult<Self> {
        let set = self.sim.clone().set(field, value);
        Ok(self.with(set.map_err(|error| self.refuse(error))?))
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
        let interrupt = Arc::new(Interrupt::default());
        let shared = Arc::clone(&interrupt);
        let factory = AgentFactory::new(move |spec: &AgentSpec| PyAgent::new(&new, spec, &shared));
        let given = self.sim.clone().agents_from(factory);
        let sim = given.map_err(|error| interrupt.take().unwrap_or_else(|| refuse(error)))?;
        Ok(Self { sim, interrupt })
    }

    /// Flies. Returns the report as JSON. Writes it, a page and tracks into `folder` if there is one.
    #[pyo3(signature = (folder = None))]
    fn run_json(&self, py: Python<'_>, folder: Option<PathBuf>) -> PyResult<String> {
        if let Some(folder) = &folder {
            muster::check_folder(folder).map_err(refuse)?;
        }
        // What an earlier run may have left.
        drop(self.interrupt.take());
        let json = py.detach(|| {
            let Some(run) = self.sim.run_until(&self.interrupt.stop())? else {
                return Ok(None);
            };
            if let Some(folder) = folder {
                run.write(folder)?;
            }
            Ok(Some(
                serde_json::to_string(&run.report).expect("a report always serialises"),
            ))
        });
        let json: Option<String> = json.map_err(refuse)?;
        json.ok_or_else(|| self.interrupt.error())
    }

    /// Flies each combination of the values of fields with each seed, on all processors. Returns the rows as JSON, in order.
    fn campaign_json(
        &self,
        py: Python<'_>,
        seeds: Vec<u64>,
        vary: Vec<(String, Vec<String>)>,
    ) -> PyResult<String> {
        drop(self.interrupt.take());
        let rows = py.detach(|| Campaign::new(&self.sim, seeds, &vary)?.fly(&self.interrupt));
        let rows = rows.map_err(|error| self.refuse(error))?;
        let rows = rows.ok_or_else(|| self.interrupt.error())?;
        Ok(serde_json::to_string(&rows).expect("a row always serialises"))
    }
}
