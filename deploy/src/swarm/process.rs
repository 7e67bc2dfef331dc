//! The starter's handle of one drone's process.

use muster_machines::identity::NodeId;
use muster_scenarios::twin::ProcessState;
use tokio::sync::mpsc;

use super::Request;
use super::folder::DroneFolder;
use super::host::Launcher;
use super::output::ProcessOutput;
use muster_daemon::control::ControlMessage;
use muster_daemon::launcher::protocol::{LauncherCommand, ProcessSignal};

/// An event of a drone's process or of its host.
#[derive(Debug)]
pub(super) enum HostEvent {
    /// The process wrote a line to standard error.
    Output(NodeId, ProcessOutput),
    /// The process has ended.
    Ended(NodeId),
    /// The connection to a host is lost.
    Lost {
        /// Name of the host.
        host: String,
        /// Last line on the standard error of its launcher, or of the command that runs the launcher.
        last: String,
    },
}

/// How a process starts.
#[derive(Debug)]
pub(super) enum StartMode {
    /// Waits on the ground.
    Waiting,
    /// Leads, and takes off by itself.
    Leading,
    /// Replaces a process that a fault killed; resumes with this state of its vehicle.
    Resuming(ControlMessage),
}

/// A drone's process, controlled through the launcher on its host.
#[derive(Debug)]
pub(super) struct DroneProcess {
    drone: u32,
    orders: mpsc::Sender<LauncherCommand>,
    /// Whether a fault of the plan killed it.
    was_killed: bool,
    /// The state last requested.
    state: ProcessState,
    is_ready: bool,
    has_ended: bool,
}

impl DroneProcess {
    /// Starts a drone's process. A failed start is reported as output and [`HostEvent::Ended`].
    pub(super) fn start(
        request: &Request<'_>,
        launcher: &Launcher,
        folder: &DroneFolder,
        mode: StartMode,
    ) -> Self {
        launcher.start_drone(
            request,
            folder,
            match mode {
                StartMode::Waiting => &[],
                StartMode::Leading => &["--fly"],
                StartMode::Resuming(_) => &["--resume"],
            },
        );
        let process = Self {
            drone: folder.id.0,
            orders: launcher.orders(),
            was_killed: false,
            state: ProcessState::Runs,
            is_ready: false,
            has_ended: false,
        };
        if let StartMode::Resuming(vehicle) = mode {
            process.send(&vehicle);
        }
        process
    }

    /// Notes that all actors of the drone run.
    pub(super) const fn mark_ready(&mut self) {
        self.is_ready = true;
    }

    /// Whether all actors of the drone run.
    pub(super) const fn is_ready(&self) -> bool {
        self.is_ready
    }

    /// Signals the process to enter a state, unless it is in it or has ended. Returns whether it continues after a hang.
    pub(super) fn set_state(&mut self, state: ProcessState) -> bool {
        if self.state == state || self.state == ProcessState::Ended {
            return false;
        }
        let continues = self.state == ProcessState::Hangs && state == ProcessState::Runs;
        self.was_killed = state == ProcessState::Ended;
        self.signal(match state {
            ProcessState::Runs => ProcessSignal::Continue,
            ProcessState::Hangs => ProcessSignal::Stop,
            ProcessState::Ended => ProcessSignal::Kill,
        });
        self.state = state;
        continues
    }

    /// Sends a control message. Returns `false` if the queue of its host is full or the host is lost.
    pub(super) fn send(&self, message: &ControlMessage) -> bool {
        let (drone, line) = (self.drone, message.line());
        self.orders
            .try_send(LauncherCommand::WriteStdin { drone, line })
            .is_ok()
    }

    /// Whether a fault killed it and it has ended.
    pub(super) const fn can_restart(&self) -> bool {
        self.was_killed && self.has_ended
    }

    /// Notes that it has ended. Returns whether by itself, without a fault.
    pub(super) const fn mark_ended(&mut self) -> bool {
        self.has_ended = true;
        self.state = ProcessState::Ended;
        !self.was_killed
    }

    /// Whether it has ended.
    pub(super) const fn is_ended(&self) -> bool {
        self.has_ended
    }

    fn signal(&self, signal: ProcessSignal) {
        let drone = self.drone;
        // A lost host has ended its drones.
        let _ = self
            .orders
            .try_send(LauncherCommand::Signal { drone, signal });
    }
}
