use std::sync::Arc;
use std::sync::atomic::AtomicUsize;

use muster_machines::node::{Address, Blueprint};
use muster_machines::supervision::{RestartLimits, Supervision};
use ractor::{Actor, ActorProcessingErr, ActorRef, SpawnErr, SupervisionEvent};

use crate::address_book::AddressBook;
use crate::environment::Environment;
use crate::seat::{Seat, SeatConfig};

/// A running drone: its supervisor and references to its five actors.
#[derive(Debug, Clone)]
pub struct Drone {
    supervisor: ActorRef<SupervisorMessage>,
    book: AddressBook,
}

/// Configuration of a drone's actors.
pub struct DroneConfig {
    /// Configuration of the machines.
    pub blueprint: Blueprint,
    /// Limits and back-off for restarts of failed actors.
    pub restarts: RestartLimits,
    /// The most messages that may wait for each actor.
    pub waiting_max: usize,
}

/// A message to a drone's supervisor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SupervisorMessage {
    /// From the environment: a restart's back-off has passed.
    Restart(Address),
    /// From the environment: an actor hangs.
    Hung(Address),
    /// From the environment: simulate a restart of the drone's process.
    Boot,
}

impl Drone {
    /// Starts the supervisor and its five actors, in the order of [`Address::ALL`].
    ///
    /// # Errors
    /// If an actor can't be started; those before it are stopped.
    pub async fn start(
        config: DroneConfig,
        environment: Arc<dyn Environment>,
    ) -> Result<Self, SpawnErr> {
        let book = AddressBook::new(config.waiting_max);
        let state = SupervisorState {
            blueprint: Arc::new(config.blueprint),
            environment,
            book: book.clone(),
            supervision: Supervision::new(config.restarts),
            restarts: config.restarts,
        };
        let (supervisor, _) = Actor::spawn(None, Supervisor, state).await?;
        Ok(Self { supervisor, book })
    }

    /// References to the five actors.
    #[must_use]
    pub const fn book(&self) -> &AddressBook {
        &self.book
    }

    /// Asks the supervisor to restart an actor.
    pub fn restart(&self, address: Address) {
        // Fails only after the supervisor has stopped.
        let _ = self.supervisor.cast(SupervisorMessage::Restart(address));
    }

    /// Reports an actor that hangs: the supervisor kills it and counts it as failed.
    pub fn report_hung(&self, address: Address) {
        // Fails only after the supervisor has stopped.
        let _ = self.supervisor.cast(SupervisorMessage::Hung(address));
    }

    /// Stops the five actors, resets the restart counter, and starts them again, as a new process would.
    pub fn boot(&self) {
        // Fails only after the supervisor has stopped.
        let _ = self.supervisor.cast(SupervisorMessage::Boot);
    }

    /// Stops the five actors and the supervisor, and waits for their end.
    pub async fn stop(&self) {
        // Fails only if the supervisor has stopped already.
        let _ = self.supervisor.stop_children_and_wait(None, None).await;
        let _ = self.supervisor.stop_and_wait(None, None).await;
    }
}

/// One-for-one supervision: a failed actor is rebuilt from its checkpoints, the others continue.
struct Supervisor;

struct SupervisorState {
    blueprint: Arc<Blueprint>,
    environment: Arc<dyn Environment>,
    book: AddressBook,
    supervision: Supervision,
    restarts: RestartLimits,
}

impl SupervisorState {
    async fn start_actor(
        &self,
        address: Address,
        supervisor: &ActorRef<SupervisorMessage>,
    ) -> Result<(), SpawnErr> {
        let waiting = Arc::new(AtomicUsize::new(0));
        let config = SeatConfig {
            address,
            blueprint: Arc::clone(&self.blueprint),
            environment: Arc::clone(&self.environment),
            waiting: Arc::clone(&waiting),
        };
        let (actor, _) = Actor::spawn_linked(None, Seat, config, supervisor.get_cell()).await?;
        self.book.register(address, actor, waiting);
        Ok(())
    }

    fn handle_failure(&mut self, address: Address) {
        let decision = self.supervision.failed(self.environment.now(), address);
        self.environment.failed(address, decision);
    }
}

impl Actor for Supervisor {
    type Msg = SupervisorMessage;
    type State = SupervisorState;
    type Arguments = SupervisorState;

    async fn pre_start(
        &self,
        myself: ActorRef<SupervisorMessage>,
        state: SupervisorState,
    ) -> Result<SupervisorState, ActorProcessingErr> {
        for address in Address::ALL {
            state.start_actor(address, &myself).await?;
        }
        Ok(state)
    }

    async fn handle(
        &self,
        myself: ActorRef<SupervisorMessage>,
        message: SupervisorMessage,
        state: &mut SupervisorState,
    ) -> Result<(), ActorProcessingErr> {
        let addresses = match message {
            SupervisorMessage::Restart(address) => vec![address],
            SupervisorMessage::Hung(address) => {
                if let Some(actor) = state.book.remove(address) {
                    actor.kill();
                    state.handle_failure(address);
                }
                Vec::new()
            }
            SupervisorMessage::Boot => {
                myself.stop_children_and_wait(None, None).await;
                state.supervision = Supervision::new(state.restarts);
                Address::ALL.into()
            }
        };
        for address in addresses {
            if state.start_actor(address, &myself).await.is_err() {
                // The actor failed while it was rebuilt.
                state.handle_failure(address);
            }
        }
        Ok(())
    }

    async fn handle_supervisor_evt(
        &self,
        _myself: ActorRef<SupervisorMessage>,
        event: SupervisionEvent,
        state: &mut SupervisorState,
    ) -> Result<(), ActorProcessingErr> {
        match event {
            SupervisionEvent::ActorFailed(actor, _) => {
                if let Some(address) = state.book.remove_by_id(actor.get_id()) {
                    state.handle_failure(address);
                }
            }
            SupervisionEvent::ActorTerminated(actor, ..) => {
                state.book.remove_by_id(actor.get_id());
            }
            _ => {}
        }
        Ok(())
    }
}
