//! State of a link, for who watches it.

use std::sync::Arc;
use std::time::Duration;

use muster_msp::check::Finding;
use muster_msp::{Counts, Identity};

use crate::fitness::Found;
use crate::session::Latency;

/// Whether there is a controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum State {
    /// The port can't be opened, or was lost; it is tried again.
    #[default]
    Closed,
    /// The port is open; the controller has not said yet who it is.
    Identifying,
    /// The controller answers.
    Open,
    /// The controller is known, and has not answered for half a second.
    Silent,
}

/// State of a link.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Status {
    /// Whether there is a controller.
    pub state: State,
    /// Who it is, since the port was opened last.
    pub identity: Option<Identity>,
    /// What makes it unfit to fly, since the port was opened last. Empty if it is fit or was not looked at.
    pub unfit: Vec<Finding>,
    /// What the last look at the controller found. `None` if it was not looked at, or can't be read.
    pub found: Option<Arc<Found>>,
    /// Why the port was closed last.
    pub closed_by: Option<String>,
    /// How often the port was opened.
    pub opened: u64,
    /// Delays and losses of telemetry, since the port was opened last.
    pub latency: Latency,
    /// Questions that the controller refuses.
    pub refused: u64,
    /// Answers that are no such message.
    pub malformed: u64,
    /// Events that were dropped because nobody took them.
    pub dropped: u64,
    /// What was read since the port was opened last.
    pub counts: Counts,
    /// Frames read in the last whole second.
    pub frames_per_second: u64,
    /// RC frames written.
    pub rc_sent: u64,
    /// RC frames written in the last whole second.
    pub rc_per_second: u64,
    /// RC frames that the controller acknowledged.
    pub rc_acknowledged: u64,
    /// Longest time between two RC frames while sticks were given.
    pub rc_gap_max: Duration,
    /// Whether the system grants real-time priority.
    pub is_realtime: bool,
}
