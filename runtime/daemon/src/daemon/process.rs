//! A drone's process as its actors see it: their environment in real time.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use muster_actors::{Drone, Environment};
use muster_machines::identity::{NodeId, SwarmId};
use muster_machines::mission::LandingReason;
use muster_machines::msp;
use muster_machines::node::{Address, Checkpoints, Envelope, StepOutput, last_resort};
use muster_machines::supervision::RestartDecision;
use muster_machines::time::Timestamp;
use muster_runtime::identity::Ed25519Authenticator;
use muster_runtime::journal::{Writer, Written};
use muster_runtime::vehicle::SimulatedVehicle;
use tokio::sync::Notify;

use super::lists::Keeper;
use super::network::Network;
use super::state::State;
use crate::clock::Clock;
use crate::log::Lost;
use crate::status::Status;

/// What a drone's actors and the tasks around them share.
///
/// All of them run on one thread, and nobody waits while holding the lock.
pub(super) struct Process {
    pub(super) clock: Clock,
    state: Mutex<State>,
    /// Somebody is to be woken sooner than was thought.
    pub(super) sooner: Notify,
    /// The drone may be done.
    pub(super) done: Notify,
}

/// What a process is made of.
pub(super) struct Components {
    pub(super) id: NodeId,
    pub(super) swarm: SwarmId,
    /// Whether it flies no mission and only passes on.
    pub(super) is_relay: bool,
    pub(super) clock: Clock,
    /// How long an actor may do nothing while something waits for it.
    pub(super) hang_max: Duration,
    pub(super) checkpoints: Checkpoints,
    pub(super) journal: Writer,
    pub(super) network: Network,
    pub(super) authenticator: Arc<Ed25519Authenticator>,
    pub(super) keeper: Keeper,
    pub(super) vehicle: SimulatedVehicle,
    /// Whether everything that is seen of the drone is to be told in a form for programs.
    pub(super) for_programs: bool,
    /// What is lost of what is told.
    pub(super) lines_lost: Lost,
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
        // A panic under this lock is an actor's, whose step is given up with it.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What it tells of itself.
    pub(super) fn status(&self) -> Status {
        self.state().status(self.clock.now())
    }

    /// The five actors run: they are told what was posted meanwhile.
    pub(super) fn begin(&self, drone: Drone) {
        self.state().begin(drone);
    }

    /// The drone is to come down and stay down.
    pub(super) fn come_down(&self, reason: LandingReason) {
        self.state().come_down(reason);
        self.look_round();
    }

    /// The drone is brought down where it is, whatever its mission takes it to be doing, and stays down.
    pub(super) fn bring_down(&self, reason: LandingReason) {
        let land = Envelope::Msp(Box::new(msp::Input::GiveUp));
        self.state().post(land);
        self.come_down(reason);
    }

    /// Something has become of what was kept in the journal.
    pub(super) fn written(&self, written: &Written) {
        self.state().written(self.clock.now(), written);
        self.look_round();
    }

    /// Whoever waits for the drone to be done, or for a time, looks again.
    pub(super) fn look_round(&self) {
        let mut state = self.state();
        if state.is_done() {
            self.done.notify_one();
        }
        if state.wakes_sooner() {
            self.sooner.notify_one();
        }
    }
}

impl Environment for Process {
    fn now(&self) -> Timestamp {
        self.clock.now()
    }

    fn seed(&self) -> u64 {
        // What is drawn here is no secret: it spreads load, and as a nonce it is never to come twice.
        getrandom::u64().unwrap_or_else(|_| self.clock.now().as_nanos())
    }

    fn checkpoints(&self) -> Checkpoints {
        self.state().checkpoints().clone()
    }

    fn carry_out(&self, from: Address, output: &mut StepOutput) {
        let now = self.clock.now();
        let mut state = self.state();
        state.answered(now, from);
        for effect in output.effects.drain(..) {
            state.effect(now, effect);
        }
        state.set_timer(now, from, output);
        drop(state);
        self.look_round();
    }

    fn failed(&self, address: Address, decision: RestartDecision) {
        let now = self.clock.now();
        let mut state = self.state();
        tracing::error!(actor = %address, ?decision, "an actor failed");
        state.take_down(address);
        match decision {
            RestartDecision::Restart { at } => state.restart(at, address),
            RestartDecision::GiveUp => {
                state.give_up();
                for effect in last_resort(|address| state.is_up(address)) {
                    state.effect(now, effect);
                }
            }
        }
        drop(state);
        self.look_round();
    }

    fn starting(&self, address: Address) {
        self.state().bring_up(address);
    }
}
