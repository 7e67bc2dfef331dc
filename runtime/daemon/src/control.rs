//! How a process is tied to whoever started it: it ends when its standard input does, and reads there whom it does not
//! hear, so that machines on one network hear each other as if they were spread out, and what its vehicle is doing, if
//! that has gone on without it.

use std::collections::BTreeMap;

use muster_machines::identity::NodeId;
use muster_machines::node::Address;
use muster_machines::time::Timestamp;
use muster_runtime::vehicle::VehicleState;
use serde::{Deserialize, Serialize};

/// The message with which a process says that its drone is there.
pub const READY: &str = "ready";

/// The message with which it says that its actors are about to be built.
pub const STARTS: &str = "starts";

/// What a starter lets a process know, a line each.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ControlMessage {
    /// Whom it does not hear from now on.
    Losses(Losses),
    /// What its vehicle is doing, whatever the process has told it; times count from `epoch`, by the process's clock.
    Vehicle {
        /// When the flight began.
        epoch: Timestamp,
        /// What it is doing.
        state: Box<VehicleState>,
    },
    /// A fault is injected into one of its actors.
    Inject {
        /// Which.
        actor: Address,
        /// What.
        fault: ActorFault,
    },
}

/// A fault of an actor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ActorFault {
    /// It panics.
    Crashes,
    /// It does nothing for so many seconds, or until it is killed.
    Hangs(Option<f64>),
}

impl ControlMessage {
    /// As a line for a process.
    pub fn line(&self) -> String {
        let mut line = serde_json::to_string(self).expect("numbers have a form in JSON");
        line.push('\n');
        line
    }

    /// As it is read there; nothing for a line that is none.
    pub fn read(line: &str) -> Option<Self> {
        serde_json::from_str(line).ok()
    }
}

/// The chance that a frame of each other drone's is not let in, 0 to 1; of those that are not there, none is lost.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Losses(BTreeMap<u32, f64>);

impl Losses {
    /// Of these.
    pub fn of(losses: impl Iterator<Item = (NodeId, f64)>) -> Self {
        let losses = losses.filter(|(_, loss)| *loss > 0.0);
        Self(losses.map(|(id, loss)| (id.0, loss)).collect())
    }

    /// The chance for a frame of this drone's.
    pub fn from(&self, id: NodeId) -> f64 {
        self.0.get(&id.0).copied().unwrap_or_default()
    }

    /// Whether some chance differs by more than `step`, or is none or certain in one of the two only.
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
    fn what_is_written_is_read_and_small_changes_are_none() {
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
