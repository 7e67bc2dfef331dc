//! The process of a drone: the real-time environment of its actors.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use muster_actors::{Drone, Environment};
use muster_machines::mission::LandingReason;
use muster_machines::msp;
use muster_machines::node::{Address, Checkpoints, Envelope, StepOutput, emergency_landing};
use muster_machines::supervision::RestartDecision;
use muster_machines::time::Timestamp;
use muster_runtime::journal::{WriteReport, Writer};
use tokio::sync::Notify;

use super::monitor::Monitor;
use super::network::Network;
use super::own_drone::OwnDrone;
use super::revocation::Revocations;
use super::state::State;
use super::vehicle::Vehicle;
use crate::clock::Clock;
use crate::status::Status;

/// State that a drone's actors and tasks share.
///
/// Invariant: all run on one thread, and none awaits while it holds the lock.
pub(super) struct Process {
    pub(super) clock: Clock,
    state: Mutex<State>,
    /// Wakes the timer task for an earlier deadline.
    pub(super) sooner: Notify,
    /// Signals that the process may end.
    pub(super) done: Notify,
}

/// The parts of a process.
pub(super) struct Components {
    pub(super) own: OwnDrone,
    pub(super) clock: Clock,
    /// The longest time for an actor to handle no message while one waits.
    pub(super) hang_max: Duration,
    pub(super) checkpoints: Checkpoints,
    pub(super) journal: Writer,
    pub(super) network: Network,
    pub(super) revocations: Revocations,
    pub(super) vehicle: Vehicle,
    pub(super) monitor: Monitor,
}

impl Process {
    pub(super) fn new(components: Components) -> Arc<Self> {
        Arc::new(Self {
            clock: components.clock,
            state: Mutex::new(State::new(components)),
            sooner: Notify::new(),
            done: Notify::new(),
        })
    }

    pub(super) fn state(&self) -> MutexGuard<'_, State> {
        // Only an actor's step can panic under this lock; the supervisor then restarts the actor.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The drone's status.
    pub(super) fn status(&self) -> Status {
        self.state().status(self.clock.now())
    }

    /// Takes over the actors once all five run.
    pub(super) fn start(&self, drone: Drone) {
        self.state().start(drone);
    }

    /// Orders the drone to land and stay on the ground.
    pub(super) fn order_landing(&self, reason: LandingReason) {
        self.state().order_landing(reason);
        self.notify();
    }

    /// Lands the drone at its position, even if the mission has lost its state.
    pub(super) fn land_at_once(&self, reason: LandingReason) {
        let land = Envelope::Msp(Box::new(msp::Input::GiveUp));
        self.state().post(land);
        self.order_landing(reason);
    }

    /// Handles a report of the journal.
    pub(super) fn journal_reported(&self, report: &WriteReport) {
        self.state().journal_reported(self.clock.now(), report);
        self.notify();
    }

    /// Wakes the tasks that wait for the end of the process or for an earlier deadline.
    pub(super) fn notify(&self) {
        let mut state = self.state();
        if state.is_done() {
            self.done.notify_one();
        }
        if state.must_wake_sooner() {
            self.sooner.notify_one();
        }
    }
}

impl Environment for Process {
    fn now(&self) -> Timestamp {
        self.clock.now()
    }

    fn seed(&self) -> u64 {
        // The seed is not secret. It spreads load and makes nonces, which must only never repeat.
        getrandom::u64().unwrap_or_else(|_| self.clock.now().as_nanos())
    }

    fn checkpoints(&self) -> Checkpoints {
        self.state().checkpoints().clone()
    }

    fn carry_out(&self, from: Address, output: &mut StepOutput) {
        let now = self.clock.now();
        let mut state = self.state();
        state.actors().has_stepped(now, from);
        for effect in output.effects.drain(..) {
            state.execute(now, effect);
        }
        state.actors().set_timer(now, from, output);
        drop(state);
        self.notify();
    }

    fn failed(&self, address: Address, decision: RestartDecision) {
        let now = self.clock.now();
        let mut state = self.state();
        tracing::error!(actor = %address, ?decision, "an actor failed");
        state.actors().set_down(address);
        match decision {
            RestartDecision::Restart { at } => state.actors().restart_at(at, address),
            RestartDecision::GiveUp => {
                state.give_up();
                for effect in emergency_landing(|address| state.is_up(address)) {
                    state.execute(now, effect);
                }
            }
        }
        drop(state);
        self.notify();
    }

    fn starting(&self, address: Address) {
        self.state().starting(address);
    }
}
