//! muster for Python: the extension module `muster._muster`. `muster/__init__.py` puts tables and plots on top.

mod agent;
mod campaign;
mod context;
mod interrupt;
mod sim;

use pyo3::prelude::*;

/// Runs scenarios of muster, with agents in Python.
#[pymodule]
fn _muster(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<sim::Sim>()?;
    module.add_class::<context::Context>()?;
    module.add_class::<agent::Telemetry>()?;
    module.add_class::<agent::SwarmEvent>()?;
    module.add("MusterError", module.py().get_type::<sim::MusterError>())?;
    Ok(())
}
