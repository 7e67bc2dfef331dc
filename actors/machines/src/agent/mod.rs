//! Agents: programs of one's own that decide where a drone flies once its swarm is in the air.
//!
//! The mission's actor runs them. Set-up, take-off, elections, failsafes and landing stay with the swarm protocol
//! ([`Mission`](crate::mission::Mission)), so that an agent can neither arm a drone nor keep one in the air.
//!
//! | phase | who decides |
//! | --- | --- |
//! | set-up, take-off into the slots at waypoint 0 | swarm protocol |
//! | on task | the agent of each drone |
//! | landing: asked for by the agent, by the operator or by a failsafe | swarm protocol |
//!
//! A whole protocol of one's own sits one level lower: it implements [`Protocol`](crate::mission::Protocol), as the swarm
//! protocol itself does.

mod context;
mod host;
mod requests;
mod runner;
mod timers;
mod waiting;

use std::fmt;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use thiserror::Error;

pub use self::context::Context;
pub use self::host::{Config, Host};
pub use self::runner::Factory;
use crate::geometry::{Ned, Velocity};
use crate::identity::{NodeId, NodeSet};
use crate::navigation::Goal;
pub use crate::routing::{Outcome, Reliability};
pub use crate::wire::{Destination, MESSAGE_FRAME_MAX, MESSAGE_MAX};

/// Largest state that an agent may keep, in bytes.
pub const KEPT_MAX: usize = 16 * 1024;
/// Shortest period of an agent's telemetry.
pub const TELEMETRY_MIN: Duration = Duration::from_millis(10);
/// Shortest time until a timer expires.
pub const TIMER_MIN: Duration = Duration::from_millis(1);
/// Most timers of an agent that run at once.
pub const TIMERS_MAX: usize = 64;
/// Lowest altitude that an agent may fly to, in metres above home.
pub const ALTITUDE_MIN_M: f64 = 2.0;
/// Most messages that an agent may send in one step.
pub const MESSAGES_PER_STEP_MAX: usize = 64;
/// Most values that an agent may observe in one step.
pub const OBSERVATIONS_PER_STEP_MAX: usize = 64;

/// Decides where one drone flies and what it tells others. Each drone has one.
///
/// All methods run in the drone's mission actor, one at a time, while the drone is on task. They must return within
/// milliseconds. After a panic the agent is built anew and continues from the state that it kept; what the failed call asked
/// for is not done, its timers are gone. An agent that keeps failing is given up, and its drone lands.
///
/// An agent must use no clock, thread or random source of the host: only then is a simulation repeatable. [`Context`] has
/// a clock, timers and a random generator.
pub trait Agent: Send {
    /// The drone is on task: it is in its slot, or its agent was restarted in the air. [`Context::kept`] returns the state
    /// kept before a restart. Timers do not survive a restart; the last goal does.
    fn start(&mut self, context: &mut Context<'_>);

    /// The drone's position, once a period ([`Config::telemetry`], [`Context::set_telemetry`]), and immediately when it arrives.
    fn telemetry(&mut self, _telemetry: &Telemetry, _context: &mut Context<'_>) {}

    /// A message of an agent arrived, perhaps of this one: a leader's message to the leader. Each arrives at most once.
    fn message(&mut self, _from: NodeId, _payload: &[u8], _context: &mut Context<'_>) {}

    /// A timer has expired.
    fn timer(&mut self, _timer: TimerId, _context: &mut Context<'_>) {}

    /// Something changed in the swarm.
    fn swarm(&mut self, _event: SwarmEvent, _context: &mut Context<'_>) {}
}

impl Agent for Box<dyn Agent> {
    fn start(&mut self, context: &mut Context<'_>) {
        self.as_mut().start(context);
    }

    fn telemetry(&mut self, telemetry: &Telemetry, context: &mut Context<'_>) {
        self.as_mut().telemetry(telemetry, context);
    }

    fn message(&mut self, from: NodeId, payload: &[u8], context: &mut Context<'_>) {
        self.as_mut().message(from, payload, context);
    }

    fn timer(&mut self, timer: TimerId, context: &mut Context<'_>) {
        self.as_mut().timer(timer, context);
    }

    fn swarm(&mut self, event: SwarmEvent, context: &mut Context<'_>) {
        self.as_mut().swarm(event, context);
    }
}

/// Identifies one of an agent's timers; chosen by the agent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TimerId(pub u32);

/// Identifies a message that this drone's agent sent. Unique until the agent restarts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MessageId(pub u32);

/// A drone's motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Telemetry {
    /// Position relative to home.
    pub position: Ned,
    /// Velocity.
    pub velocity: Velocity,
    /// Whether the drone has just come to rest at the destination of [`Context::go_to`]: true once for each call of that, and
    /// once more if the agent is built anew there.
    pub has_arrived: bool,
}

/// A change in the swarm.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SwarmEvent {
    /// Another drone leads the swarm, perhaps this one. Two segments that meet have one leader again, too.
    LeaderChanged(NodeId),
    /// The leader is silent. The swarm elects another unless it returns.
    LeaderSilent,
    /// The silent leader was heard again.
    LeaderReturned,
    /// Drones are no longer on task: they were silent for their time to live, or are landing.
    MembersLost(NodeSet),
    /// Drones are on task now, for the first time or again.
    MembersJoined(NodeSet),
    /// What became of a message: reported for those that are to be acknowledged, and for those that were dropped.
    MessageSent {
        /// The message.
        id: MessageId,
        /// The outcome.
        outcome: Outcome,
    },
}

/// What is wrong with a message or a state. Nothing was sent or kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum TooMuch {
    /// The message or state is too long.
    #[error("{len} bytes are too many; accepted are at most {max}")]
    Bytes {
        /// Its length.
        len: usize,
        /// The limit.
        max: usize,
    },
    /// Too many messages in one step.
    #[error("an agent may send at most {max} messages in one step")]
    Messages {
        /// The limit.
        max: usize,
    },
}

/// State of an agent that survives a restart.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Checkpoint {
    /// The agent's last goal; `None` before the first.
    pub goal: Option<Goal>,
    /// What the agent kept; `None` if it kept nothing.
    pub kept: Option<Vec<u8>>,
}

/// A named value that an agent reports to observers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Observed {
    /// Name of the value.
    pub name: String,
    /// The value.
    pub value: f64,
}

impl fmt::Display for Observed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} = {}", self.name, self.value)
    }
}

#[cfg(test)]
mod tests;
