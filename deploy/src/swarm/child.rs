//! The process of one drone, as whoever started it holds it.

use muster_machines::identity::NodeId;
use muster_scenarios::twin::ProcessState;
use tokio::sync::mpsc;

use super::Request;
use super::folder::DroneFolder;
use super::host::Agent;
use super::said::Spoken;
use muster_daemon::agent::protocol::{Order, Sent};
use muster_daemon::control::ControlMessage;

/// What comes of a drone's process.
#[derive(Debug)]
pub(super) enum News {
    /// It said something.
    Said(NodeId, Spoken),
    /// It has ended.
    Ended(NodeId),
    /// Nothing more will be heard of a host.
    Lost {
        /// What it is called.
        host: String,
        /// What its agent, or what ran it there, said last.
        last: String,
    },
}

/// As what a process begins.
#[derive(Debug)]
pub(super) enum Begin {
    /// As a drone that waits on the ground.
    Waiting,
    /// As the drone that leads, which is told to fly.
    Leading,
    /// As a drone whose process was ended, with what its vehicle is doing.
    Again(ControlMessage),
}

/// A drone's process, in the hand of the agent on its host.
#[derive(Debug)]
pub(super) struct DroneProcess {
    drone: u32,
    agent: mpsc::Sender<Order>,
    /// Whether the plan ended it.
    was_ended: bool,
    process_state: ProcessState,
    is_ready: bool,
    has_ended: bool,
}

impl DroneProcess {
    /// Starts a drone's process: that it could not be started is among what comes of it.
    pub(super) fn start(
        request: &Request<'_>,
        agent: &Agent,
        folder: &DroneFolder,
        begin: Begin,
    ) -> Self {
        agent.start_drone(
            request,
            folder,
            match begin {
                Begin::Waiting => &[],
                Begin::Leading => &["--fly"],
                Begin::Again(_) => &["--resume"],
            },
        );
        let process = Self {
            drone: folder.id.0,
            agent: agent.orders(),
            was_ended: false,
            process_state: ProcessState::Runs,
            is_ready: false,
            has_ended: false,
        };
        if let Begin::Again(word) = begin {
            process.tell(&word);
        }
        process
    }

    /// It says that its drone is there.
    pub(super) const fn is_there(&mut self) {
        self.is_ready = true;
    }

    /// Whether its drone is there.
    pub(super) const fn is_ready(&self) -> bool {
        self.is_ready
    }

    /// Makes the process be as it is to be, as long as it is there; whether it goes on after a hang.
    pub(super) fn be(&mut self, process_state: ProcessState) -> bool {
        if self.process_state == process_state || self.process_state == ProcessState::Ended {
            return false;
        }
        let keeps_going =
            self.process_state == ProcessState::Hangs && process_state == ProcessState::Runs;
        self.was_ended = process_state == ProcessState::Ended;
        self.signal(match process_state {
            ProcessState::Runs => Sent::Continue,
            ProcessState::Hangs => Sent::Stop,
            ProcessState::Ended => Sent::Kill,
        });
        self.process_state = process_state;
        keeps_going
    }

    /// Lets the process know something, unless its host has too much to do already; whether it will know.
    pub(super) fn tell(&self, word: &ControlMessage) -> bool {
        let (drone, line) = (self.drone, word.line());
        self.agent.try_send(Order::Tell { drone, line }).is_ok()
    }

    /// Whether the plan ended it, and the system is done with it.
    pub(super) const fn can_start_again(&self) -> bool {
        self.was_ended && self.has_ended
    }

    /// It has ended; whether by itself.
    pub(super) const fn has_ended(&mut self) -> bool {
        self.has_ended = true;
        self.process_state = ProcessState::Ended;
        !self.was_ended
    }

    /// Whether it has ended.
    pub(super) const fn is_ended(&self) -> bool {
        self.has_ended
    }

    fn signal(&self, signal: Sent) {
        let drone = self.drone;
        // A host that takes no orders any more has ended its drones.
        let _ = self.agent.try_send(Order::Signal { drone, signal });
    }
}
