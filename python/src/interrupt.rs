//! What ends runs early: Ctrl-C, and all else that is raised in an agent and is no `Exception`, such as `SystemExit`.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use muster::Stop;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;

/// Time between two looks at Python's signals.
pub(crate) const LOOK_EVERY: Duration = Duration::from_millis(100);

/// What was raised first in one call from Python, for a run or a campaign.
#[derive(Default)]
pub(crate) struct Interrupt {
    is_raised: AtomicBool,
    raised: Mutex<Option<PyErr>>,
}

impl Interrupt {
    /// Whether an error ends runs, instead of being a failure of the agent that raised it.
    pub(crate) fn takes(py: Python<'_>, error: &PyErr) -> bool {
        !error.is_instance_of::<PyException>(py)
    }

    pub(crate) fn is_raised(&self) -> bool {
        self.is_raised.load(Ordering::Relaxed)
    }

    pub(crate) fn raise(&self, error: PyErr) {
        let mut raised = self.raised.lock().unwrap_or_else(PoisonError::into_inner);
        raised.get_or_insert(error);
        self.is_raised.store(true, Ordering::Relaxed);
    }

    /// Runs Python's handlers of signals, if this is Python's main thread.
    pub(crate) fn check_signals(&self) {
        if let Err(error) = Python::attach(|py| py.check_signals()) {
            self.raise(error);
        }
    }

    /// Yields what was raised; once.
    pub(crate) fn take(&self) -> Option<PyErr> {
        self.raised
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take()
    }

    /// Stops a run on this thread, which looks at signals meanwhile.
    pub(crate) fn stop(self: &Arc<Self>) -> Stop {
        let (interrupt, looked) = (Arc::clone(self), Mutex::new(Instant::now()));
        Stop::when(move || {
            let mut looked = looked.lock().unwrap_or_else(PoisonError::into_inner);
            if !interrupt.is_raised() && looked.elapsed() >= LOOK_EVERY {
                *looked = Instant::now();
                interrupt.check_signals();
            }
            interrupt.is_raised()
        })
    }
}
