//! The last point before orders leave for an autopilot.

use std::time::Duration;

use super::vocabulary::Order;
use crate::msp::controller::Stage;
use crate::time::Timestamp;

/// Time for which an autopilot that said that it is a simulation counts as one that may arm: three times what is asked for.
const SIMULATED_FOR: Duration = Duration::from_secs(3);

/// Which orders may leave for an autopilot.
///
/// Invariant: in any stage but `sim`, or for an autopilot that has not reported that it is a simulation, only
/// [`Order::RequestTelemetry`] may.
#[derive(Debug)]
pub(super) struct Gate {
    stage: Stage,
    /// When the autopilot last said that it is a simulation.
    simulated_at: Option<Timestamp>,
}

impl Gate {
    /// Before the autopilot has said what it is.
    pub(super) const fn new(stage: Stage) -> Self {
        Self {
            stage,
            simulated_at: None,
        }
    }

    /// The autopilot says that it is a simulation. Returns whether it says so for the first time.
    pub(super) const fn hear_simulated(&mut self, now: Timestamp) -> bool {
        self.simulated_at.replace(now).is_none()
    }

    /// Whether the autopilot has ever said that it is a simulation.
    pub(super) const fn is_simulation(&self) -> bool {
        self.simulated_at.is_some()
    }

    /// Whether the autopilot may be armed: in the stage `sim`, if it said lately that it is a simulation.
    pub(super) fn may_arm(&self, now: Timestamp) -> bool {
        let is_recent = |at| now.since(at) <= SIMULATED_FOR;
        self.stage == Stage::Sim && self.simulated_at.is_some_and(is_recent)
    }

    /// Whether an order may leave.
    pub(super) fn may_leave(&self, order: Order, now: Timestamp) -> bool {
        match order {
            Order::RequestTelemetry => true,
            Order::Arm | Order::Guide => self.may_arm(now),
            _ => self.stage == Stage::Sim && self.is_simulation(),
        }
    }
}
