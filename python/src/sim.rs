//! Runs and campaigns.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use muster::{AgentFactory, AgentSpec, Engine};
use pyo3::create_exception;
use pyo3::exceptions::{PyException, PyValueError};
use pyo3::prelude::*;

use crate::agent::PyAgent;

create_exception!(muster, MusterError, PyException, "A scenario, a field or a run was refused.");

fn refuse(error: muster::Error) -> PyErr {
    MusterError::new_err(error.to_string())
}

/// A scenario that is ready to fly.
#[pyclass(module = "muster", frozen)]
pub(crate) struct Sim(muster::Sim);

#[pymethods]
impl Sim {
    /// Reads a scenario file, or takes a shipped scenario by its name.
    #[new]
    fn new(scenario: &str) -> PyResult<Self> {
        Ok(Self(muster::Sim::load(scenario).map_err(refuse)?))
    }

    /// A scenario with a field set, as with `--set`.
    fn set(&self, field: &str, value: &Bound<'_, PyAny>) -> PyResult<Self> {
        let value = match value.extract::<bool>() {
            Ok(value) => value.to_string(),
            Err(_) => value.str()?.to_string(),
        };
        Ok(Self(self.0.clone().set(field, value).map_err(refuse)?))
    }

    /// A scenario with another random seed.
    fn seed(&self, seed: u64) -> Self {
        Self(self.0.clone().seed(seed))
    }

    /// A scenario that runs on the engine "events" (default) or "actors"; both give the same flight.
    fn engine(&self, name: &str) -> PyResult<Self> {
        let engine = match name {
            "events" => Engine::Events,
            "actors" => Engine::Actors,
            _ => return Err(PyValueError::new_err("an engine is \"events\" or \"actors\"")),
        };
        Ok(Self(self.0.clone().engine(engine)))
    }

    /// A scenario with agents: `new(id)` builds the one of a drone.
    fn agents(&self, new: Py<PyAny>) -> PyResult<Self> {
        let factory = AgentFactory::new(move |spec: &AgentSpec| {
            PyAgent::new(&new, spec)
        });
        Ok(Self(self.0.clone().agents_from(factory).map_err(refuse)?))
    }

    /// Flies. Returns the report as JSON. Writes it, a page and tracks into `folder` if there is one.
    #[pyo3(signature = (folder = None))]
    fn run_json(&self, py: Python<'_>, folder: Option<String>) -> PyResult<String> {
        py.detach(|| {
            let run = self.0.run()?;
            if let Some(folder) = folder {
                run.write(folder)?;
            }
            Ok(serde_json::to_string(&run.report).expect("a report always serialises"))
        })
        .map_err(refuse)
    }

    /// Flies the scenario with each seed on all processors. Returns the reports as JSON, in the order of the seeds, without
    /// drones if `brief`.
    fn run_seeds_json(&self, py: Python<'_>, seeds: Vec<u64>, brief: bool) -> PyResult<Vec<String>> {
        py.detach(|| fly_all(&self.0, &seeds, brief)).map_err(refuse)
    }
}

fn fly_all(sim: &muster::Sim, seeds: &[u64], brief: bool) -> Result<Vec<String>, muster::Error> {
    let next = AtomicUsize::new(0);
    let done = Mutex::new(Vec::with_capacity(seeds.len()));
    let fly = || {
        loop {
            let at = next.fetch_add(1, Ordering::Relaxed);
            let Some(seed) = seeds.get(at) else { return };
            let flown = sim.clone().seed(*seed).run().map(|run| {
                let mut report = serde_json::to_value(&run.report).expect("a report always serialises");
                if brief && let Some(report) = report.as_object_mut() {
                    for large in ["drones", "relays", "barriers", "bridges", "observed", "others"] {
                        report.remove(large);
                    }
                }
                report.to_string()
            });
            let mut done = done.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            done.push((at, flown));
        }
    };
    let workers = thread::available_parallelism().map_or(1, usize::from);
    thread::scope(|scope| {
        for _ in 0..workers.min(seeds.len()) {
            scope.spawn(fly);
        }
    });
    let mut done = done.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    done.sort_by_key(|(at, _)| *at);
    done.into_iter().map(|(_, flown)| flown).collect()
}
