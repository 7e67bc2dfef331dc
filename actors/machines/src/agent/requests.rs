//! What an agent asks for in one step.

use std::time::Duration;

use bytes::Bytes;

use super::{
    Destination, KEPT_MAX, MESSAGE_FRAME_MAX, MESSAGE_MAX, MESSAGES_PER_STEP_MAX, MessageId,
    OBSERVATIONS_PER_STEP_MAX, Observed, Reliability, TooMuch,
};
use crate::navigation::Goal;
use crate::routing::Outgoing;

/// What an agent has asked for in the current step. The host carries it out once the agent's method has returned.
///
/// Invariant: at most [`MESSAGES_PER_STEP_MAX`] messages and [`OBSERVATIONS_PER_STEP_MAX`] observations; no message exceeds the
/// maximum of its destination, and kept state at most [`KEPT_MAX`]. The id of a message follows that of the message before, even
/// if that was discarded.
#[derive(Debug)]
pub(super) struct Requests {
    goal: Option<Goal>,
    kept: Option<Vec<u8>>,
    leaves: bool,
    lands: bool,
    /// The new period of the telemetry, `None` in it for none.
    telemetry: Option<Option<Duration>>,
    messages: Vec<Outgoing>,
    observed: Vec<Observed>,
    /// Id of the last message; wraps.
    last_message: u32,
}

impl Requests {
    /// Without any request. The ids of its messages follow `last_message`.
    pub(super) const fn new(last_message: u32) -> Self {
        Self {
            goal: None,
            kept: None,
            leaves: false,
            lands: false,
            telemetry: None,
            messages: Vec::new(),
            observed: Vec::new(),
            last_message,
        }
    }

    /// Replaces the goal.
    pub(super) fn set_goal(&mut self, goal: Goal) {
        self.goal = Some(goal);
    }

    /// Requests to leave the swarm.
    pub(super) const fn leave(&mut self) {
        self.leaves = true;
    }

    /// Requests a landing.
    pub(super) const fn land(&mut self) {
        self.lands = true;
    }

    /// Replaces the period of the telemetry; `None` for none.
    pub(super) const fn set_telemetry(&mut self, period: Option<Duration>) {
        self.telemetry = Some(period);
    }

    /// Replaces the state to be kept.
    ///
    /// # Errors
    /// It is longer than [`KEPT_MAX`]. The last one stays.
    pub(super) fn keep(&mut self, kept: &[u8]) -> Result<(), TooMuch> {
        check_len(kept, KEPT_MAX)?;
        self.kept = Some(kept.to_vec());
        Ok(())
    }

    /// The state to be kept; `None` if this step has none.
    pub(super) fn kept(&self) -> Option<&[u8]> {
        self.kept.as_deref()
    }

    /// Adds a message. One to all is sent without acknowledgement.
    ///
    /// # Errors
    /// The message is too long for its destination, or there are too many. Nothing is added.
    pub(super) fn send(
        &mut self,
        to: Destination,
        payload: &[u8],
        reliability: Reliability,
    ) -> Result<MessageId, TooMuch> {
        let (max, reliability) = match to {
            Destination::All => (MESSAGE_FRAME_MAX, Reliability::BestEffort),
            Destination::Neighbours => (MESSAGE_FRAME_MAX, reliability),
            Destination::Leader | Destination::Drone(_) => (MESSAGE_MAX, reliability),
        };
        check_len(payload, max)?;
        if self.messages.len() >= MESSAGES_PER_STEP_MAX {
            let max = MESSAGES_PER_STEP_MAX;
            return Err(TooMuch::Messages { max });
        }
        self.last_message = self.last_message.wrapping_add(1);
        self.messages.push(Outgoing {
            id: self.last_message,
            to,
            reliability,
            payload: Bytes::copy_from_slice(payload),
        });
        Ok(MessageId(self.last_message))
    }

    /// Adds a named value for observers, unless there are [`OBSERVATIONS_PER_STEP_MAX`] already.
    pub(super) fn observe(&mut self, name: &str, value: f64) {
        if self.observed.len() < OBSERVATIONS_PER_STEP_MAX {
            self.observed.push(Observed {
                name: name.to_owned(),
                value,
            });
        }
    }

    pub(super) const fn take_goal(&mut self) -> Option<Goal> {
        self.goal.take()
    }

    pub(super) const fn take_telemetry(&mut self) -> Option<Option<Duration>> {
        self.telemetry.take()
    }

    pub(super) const fn take_kept(&mut self) -> Option<Vec<u8>> {
        self.kept.take()
    }

    /// The messages in the order in which they were sent; `None` if there are none.
    pub(super) fn take_messages(&mut self) -> Option<Vec<Outgoing>> {
        (!self.messages.is_empty()).then(|| std::mem::take(&mut self.messages))
    }

    pub(super) fn drain_observed(&mut self) -> impl Iterator<Item = Observed> {
        self.observed.drain(..)
    }

    /// Whether to leave the swarm was requested; the request is gone then.
    pub(super) const fn take_leaving(&mut self) -> bool {
        std::mem::replace(&mut self.leaves, false)
    }

    /// Whether a landing was requested; the request is gone then.
    pub(super) const fn take_landing(&mut self) -> bool {
        std::mem::replace(&mut self.lands, false)
    }

    /// Forgets what a failed agent asked for.
    pub(super) fn discard(&mut self) {
        *self = Self::new(self.last_message);
    }
}

const fn check_len(bytes: &[u8], max: usize) -> Result<(), TooMuch> {
    if bytes.len() > max {
        return Err(TooMuch::Bytes {
            len: bytes.len(),
            max,
        });
    }
    Ok(())
}
