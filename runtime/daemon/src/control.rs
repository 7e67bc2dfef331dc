//! The control channel from a starter to a drone's process: one JSON message a line on standard input. The process ends
//! when the channel closes.

use std::collections::BTreeMap;

use muster_machines::identity::NodeId;
use muster_machines::node::Address;
use muster_machines::time::Timestamp;
use muster_runtime::vehicle::VehicleState;
use serde::{Deserialize, Serialize};

/// Log message of a process whose five actors run.
pub const READY: &str = "ready";

/// Log message of a process that is about to start its actors.
pub const STARTS: &str = "starts";

/// Log message of a process of which the grant allows its stage with the flight controller at its port. Its fields name both.
pub const GRANT_ALLOWS: &str = "the grant allows the stage";

/// Begin of the log message of a process with a flight controller that the grant does not allow its stage.
pub const STAGE_FALLS: &str = "the stage falls to bench";

/// A message from the starter.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ControlMessage {
    /// From now on frames are lost on arrival with these probabilities, as if the drones were far apart.
    Losses(Losses),
    /// Replaces the state of the simulated vehicle. Its times count from `epoch`.
    Vehicle {
        /// Start of the flight, by the process's clock.
        epoch: Timestamp,
        /// The new state.
        state: Box<VehicleState>,
    },
    /// Injects a fault into an actor.
    Inject {
        /// The actor.
        actor: Address,
        /// The fault.
        fault: ActorFault,
    },
}

/// A fault to inject into an actor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ActorFault {
    /// The actor panics.
    Crashes,
    /// The actor handles nothing for this many seconds; `None`: until it is killed.
    Hangs(Option<f64>),
}

impl ControlMessage {
    /// The message as a line, with its line end.
    pub fn line(&self) -> String {
        let mut line = serde_json::to_string(self).expect("control messages are valid JSON");
        line.push('\n');
        line
    }

    /// Reads a line. `None` if it is not a control message.
    pub fn read(line: &str) -> Option<Self> {
        serde_json::from_str(line).ok()
    }
}

/// The probability, 0 to 1, that a frame is lost on arrival, by sender; 0 for senders that are not listed.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Losses(BTreeMap<u32, f64>);

impl Losses {
    /// Losses by sender, 0 to 1.
    pub fn of(losses: impl Iterator<Item = (NodeId, f64)>) -> Self {
        let losses = losses.filter(|(_, loss)| *loss > 0.0);
        Self(losses.map(|(id, loss)| (id.0, loss)).collect())
    }

    /// The probability for a sender.
    pub fn from(&self, id: NodeId) -> f64 {
        self.0.get(&id.0).copied().unwrap_or_default()
    }

    /// Whether a probability differs by more than `step`, or is 0 or 1 in only one of the two.
    pub fn differs(&self, other: &Self, step: f64) -> bool {
        let mut ids = self.0.keys().chain(other.0.keys());
        ids.any(|id| {
            let (a, b) = (self.from(NodeId(*id)), other.from(NodeId(*id)));
            (a - b).abs() > step || (a >= 1.0) != (b >= 1.0) || (a > 0.0) != (b > 0.0)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn losses_survive_the_channel_and_ignore_small_changes() {
        let losses =
            |pairs: &[(u32, f64)]| Losses::of(pairs.iter().map(|(id, it)| (NodeId(*id), *it)));
        let some = losses(&[(1, 0.25), (2, 1.0), (3, 0.0)]);
        let read = ControlMessage::read(&ControlMessage::Losses(some.clone()).line());
        assert!(matches!(read, Some(ControlMessage::Losses(losses)) if losses == some));
        assert!(ControlMessage::read("off").is_none());
        assert!((some.from(NodeId(1)) - 0.25).abs() < 1e-12);
        assert!(some.from(NodeId(3)).abs() < 1e-12);
        assert!(!some.differs(&losses(&[(1, 0.255), (2, 1.0)]), 0.01));
        assert!(some.differs(&losses(&[(1, 0.27), (2, 1.0)]), 0.01));
        assert!(some.differs(&losses(&[(1, 0.25), (2, 0.999)]), 0.01));
        assert!(some.differs(&losses(&[(1, 0.25)]), 0.01));
    }
}
