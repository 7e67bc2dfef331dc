//! Runs the agent: builds it, calls it, and builds it anew when it fails.

use std::any::Any;
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use super::host::State;
use super::{Agent, Context};
use crate::node::Address;
use crate::supervision::{RestartDecision, RestartLimits, Supervision};
use crate::time::Timestamp;

/// Longest beginning and end of a failure's description, in characters. A traceback names its cause at its end.
const FAILURE_MAX: (usize, usize) = (500, 1_500);

/// Builds an agent.
#[derive(Clone)]
pub struct Factory(Arc<dyn Fn() -> Box<dyn Agent> + Send + Sync>);

impl Factory {
    /// A factory that calls `new` for each start of the agent.
    pub fn new(new: impl Fn() -> Box<dyn Agent> + Send + Sync + 'static) -> Self {
        Self(Arc::new(new))
    }

    /// Builds an agent.
    #[must_use]
    pub fn build(&self) -> Box<dyn Agent> {
        (self.0)()
    }
}

impl fmt::Debug for Factory {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Factory").finish_non_exhaustive()
    }
}

/// An agent under supervision.
///
/// Invariant: while `agent` is `None` the agent is not built yet, has failed and waits for its restart, or is given up.
pub(super) struct Runner {
    factory: Factory,
    agent: Option<Box<dyn Agent>>,
    supervision: Supervision,
    /// When the agent is started. `None` while it runs, and once it is given up.
    starts_at: Option<Timestamp>,
}

/// What became of a failed agent.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Failed {
    /// What went wrong.
    pub(super) what: String,
    /// Whether it failed too often, so that it is not restarted.
    pub(super) is_given_up: bool,
}

impl Runner {
    pub(super) const fn new(factory: Factory, limits: RestartLimits) -> Self {
        Self {
            factory,
            agent: None,
            supervision: Supervision::new(limits),
            starts_at: Some(Timestamp::ZERO),
        }
    }

    pub(super) const fn is_running(&self) -> bool {
        self.agent.is_some()
    }

    pub(super) const fn starts_at(&self) -> Option<Timestamp> {
        self.starts_at
    }

    /// Ends the agent for good.
    pub(super) fn stop(&mut self) {
        self.agent = None;
        self.starts_at = None;
    }

    /// Builds and starts the agent if that is due. Returns whether it did.
    ///
    /// # Errors
    /// The agent failed.
    pub(super) fn start_if_due(
        &mut self,
        now: Timestamp,
        state: &mut State,
    ) -> Result<bool, Failed> {
        if self.starts_at.is_none_or(|at| at > now) {
            return Ok(false);
        }
        self.starts_at = None;
        let factory = self.factory.clone();
        let built = catch_unwind(AssertUnwindSafe(|| factory.build()));
        self.agent = Some(built.map_err(|panic| self.fail(now, panic))?);
        self.call(now, state, |agent, context| agent.start(context))?;
        Ok(true)
    }

    /// Calls the agent if it runs.
    ///
    /// # Errors
    /// The agent failed. What it asked for in this call must not be carried out.
    pub(super) fn call(
        &mut self,
        now: Timestamp,
        state: &mut State,
        call: impl FnOnce(&mut dyn Agent, &mut Context<'_>),
    ) -> Result<(), Failed> {
        let Some(agent) = &mut self.agent else {
            return Ok(());
        };
        let mut context = Context { state, now };
        // A failed agent is dropped, and what it asked for is discarded.
        let called = catch_unwind(AssertUnwindSafe(|| call(agent.as_mut(), &mut context)));
        called.map_err(|panic| self.fail(now, panic))
    }

    fn fail(&mut self, now: Timestamp, panic: Box<dyn Any + Send>) -> Failed {
        self.agent = None;
        self.starts_at = match self.supervision.failed(now, Address::Mission) {
            RestartDecision::Restart { at } => Some(at),
            RestartDecision::GiveUp => None,
        };
        Failed {
            what: describe(panic),
            is_given_up: self.starts_at.is_none(),
        }
    }

    #[cfg(test)]
    pub(super) fn replace_factory(&mut self, factory: Factory) {
        self.factory = factory;
    }
}

fn describe(panic: Box<dyn Any + Send>) -> String {
    let text = match panic.downcast::<String>() {
        Ok(text) => *text,
        Err(panic) => panic
            .downcast_ref::<&str>()
            .map_or("a panic without a message", |text| text)
            .to_owned(),
    };
    shortened(text)
}

/// A long description without its middle.
fn shortened(text: String) -> String {
    let (begin, end) = FAILURE_MAX;
    let left_out = text.chars().count().saturating_sub(begin + end);
    if left_out == 0 {
        return text;
    }
    let begun: String = text.chars().take(begin).collect();
    let ends: String = text.chars().skip(begin + left_out).collect();
    format!("{begun}\n… {left_out} characters left out …\n{ends}")
}
