//! Keeps the processes informed about the radio's frame losses.

use std::collections::BTreeMap;

use muster_daemon::control::{ControlMessage, Losses};
use muster_machines::identity::NodeId;
use muster_scenarios::twin::{ProcessState, Twin};

use super::process::DroneProcess;

/// Smallest change of a loss probability that is sent.
const LOSS_STEP: f64 = 0.01;

/// The losses that each process was sent last.
#[derive(Debug, Default)]
pub(super) struct SentLosses {
    by_process: BTreeMap<NodeId, Losses>,
    /// The twin's count of changes that all processes know; `None` if one of them may lag behind.
    as_of: Option<u64>,
}

impl SentLosses {
    /// Forgets a process; a restarted one knows no losses.
    pub(super) fn forget(&mut self, drone: NodeId) {
        self.by_process.remove(&drone);
        self.as_of = None;
    }

    /// Sends each process the losses of the frames to it, if they have changed.
    pub(super) fn send_changes(&mut self, twin: &Twin, processes: &BTreeMap<NodeId, DroneProcess>) {
        let as_of = Some(twin.loss_changes());
        if self.as_of == as_of {
            return;
        }
        let mut all_sent = true;
        for (to, process) in processes {
            if twin.process(*to) == ProcessState::Hangs {
                all_sent = false;
                continue;
            }
            let others = twin.nodes().filter(|from| from != to);
            let losses = Losses::of(others.map(|from| (from, twin.loss(from, *to))));
            let sent = self.by_process.get(to);
            if sent.is_some_and(|sent| !sent.differs(&losses, LOSS_STEP)) {
                continue;
            }
            if process.send(&ControlMessage::Losses(losses.clone())) {
                self.by_process.insert(*to, losses);
            } else {
                all_sent &= process.is_ended();
            }
        }
        self.as_of = as_of.filter(|_| all_sent && self.by_process.len() == processes.len());
    }
}
