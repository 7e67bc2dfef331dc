//! A drone in a building that it has a map of, as its navigation sees it: what it measures, and what comes of that.
//!
//! The machine behind [`Indoor`] is in the crate `muster-indoor`, with maps and all that needs them.

pub mod frames;
mod message;
pub mod reading;
mod seen;

use std::fmt;

pub use message::{
    Checkpoint, EarlyLanding, Event, Fault, Input, Remaining, SonarChange, Targets, Transmit,
    Velocity,
};
pub use seen::Seen;

use crate::machine::Machine;
use crate::time::Timestamp;

/// A machine that knows a map: from ranges and odometry to the pose, a safe velocity, and what remains to be seen. A
/// [`Navigation`](crate::navigation::Navigation) hosts one if its drone has a map.
pub trait Indoor:
    Machine<Input = Input, Transmit = Transmit, Event = Event> + fmt::Debug + Send
{
}

impl<M> Indoor for M where
    M: Machine<Input = Input, Transmit = Transmit, Event = Event> + fmt::Debug + Send
{
}

/// Builds an indoor machine from a seed, the time and its last checkpoint.
pub type Builder = dyn Fn(u64, Timestamp, Option<&Checkpoint>) -> Box<dyn Indoor> + Send + Sync;
