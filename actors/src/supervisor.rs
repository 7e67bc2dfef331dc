use std::sync::Arc;
use std::sync::atomic::AtomicUsize;

use muster_machines::node::{Address, Blueprint};
use muster_machines::supervision::{RestartLimits, Supervision};
use ractor::{Actor, ActorProcessingErr, ActorRef, SpawnErr, SupervisionEvent};

use crate::address_book::AddressBook;
use crate::environment::Environment;
use crate::seat::{Seat, SeatConfig};

/// One running drone: its supervisor and where its five actors are to be found.
#[derive(Debug, Clone)]
pub struct Drone {
    supervisor: ActorRef<SupervisorMessage>,
    book: AddressBook,
}

/// What a drone is started with.
pub struct DroneConfig {
    /// What its machines are built with.
    pub blueprint: Blueprint,
    /// When failed actors are restarted and when that is given up.
    pub restarts: RestartLimits,
    /// The most messages that wait for any of its actors.
    pub waiting_max: usize,
}

/// What a drone's supervisor is told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SupervisorMessage {
    /// By the environment: the time of a restart has come.
    Restart(Address),
    /// By the environment: an actor does nothing any more.
    Hangs(Address),
    /// By the environment: the drone's process has started anew, as far as the world outside can see.
    Boot,
}

impl Drone {
    /// Starts the supervisor and under it the five, in the order of [`Address::ALL`].
    ///
    /// # Errors
    /// When an actor can't be started; those before it are stopped.
    pub async fn start(
        config: DroneConfig,
        environment: Arc<dyn Environment>,
    ) -> Result<Self, SpawnErr> {
        let book = AddressBook::new(config.waiting_max);
        let tree = Tree {
            blueprint: Arc::new(config.blueprint),
            environment,
            book: book.clone(),
            supervision: Supervision::new(config.restarts),
            restarts: config.restarts,
        };
        let (supervisor, _) = Actor::spawn(None, Supervisor, tree).await?;
        Ok(Self { supervisor, book })
    }

    /// Where its five actors are to be found.
    #[must_use]
    pub const fn book(&self) -> &AddressBook {
        &self.book
    }

    /// Tells its supervisor that the time of a restart has come.
    pub fn restart(&self, address: Address) {
        // A supervisor that is gone has nothing left to restart.
        let _ = self.supervisor.cast(SupervisorMessage::Restart(address));
    }

    /// Tells its supervisor that an actor does nothing any more: it is killed, and counts as failed.
    pub fn hangs(&self, address: Address) {
        // A supervisor that is gone has nothing left to mend.
        let _ = self.supervisor.cast(SupervisorMessage::Hangs(address));
    }

    /// Stops the five, forgets how often they have failed, and starts them again, as a new process would.
    pub fn boot(&self) {
        // A supervisor that is gone has nothing left to start.
        let _ = self.supervisor.cast(SupervisorMessage::Boot);
    }

    /// Stops the five and the supervisor and waits until they are gone.
    pub async fn stop(&self) {
        // It can only fail because the supervisor has stopped already.
        let _ = self.supervisor.stop_children_and_wait(None, None).await;
        let _ = self.supervisor.stop_and_wait(None, None).await;
    }
}

/// One for one: a failed actor is built anew from its checkpoints, the others go on.
struct Supervisor;

struct Tree {
    blueprint: Arc<Blueprint>,
    environment: Arc<dyn Environment>,
    book: AddressBook,
    supervision: Supervision,
    restarts: RestartLimits,
}

impl Tree {
    async fn seat(
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
        self.book.enter(address, actor, waiting);
        Ok(())
    }

    fn failed(&mut self, address: Address) {
        let decision = self.supervision.failed(self.environment.now());
        self.environment.failed(address, decision);
    }
}

impl Actor for Supervisor {
    type Msg = SupervisorMessage;
    type State = Tree;
    type Arguments = Tree;

    async fn pre_start(
        &self,
        myself: ActorRef<SupervisorMessage>,
        tree: Tree,
    ) -> Result<Tree, ActorProcessingErr> {
        for address in Address::ALL {
            tree.seat(address, &myself).await?;
        }
        Ok(tree)
    }

    async fn handle(
        &self,
        myself: ActorRef<SupervisorMessage>,
        message: SupervisorMessage,
        tree: &mut Tree,
    ) -> Result<(), ActorProcessingErr> {
        let addresses = match message {
            SupervisorMessage::Restart(address) => vec![address],
            SupervisorMessage::Hangs(address) => {
                if let Some(actor) = tree.book.remove(address) {
                    actor.kill();
                    tree.failed(address);
                }
                Vec::new()
            }
            SupervisorMessage::Boot => {
                myself.stop_children_and_wait(None, None).await;
                tree.supervision = Supervision::new(tree.restarts);
                Address::ALL.into()
            }
        };
        for address in addresses {
            if tree.seat(address, &myself).await.is_err() {
                // It failed again while it was built.
                tree.failed(address);
            }
        }
        Ok(())
    }

    async fn handle_supervisor_evt(
        &self,
        _myself: ActorRef<SupervisorMessage>,
        event: SupervisionEvent,
        tree: &mut Tree,
    ) -> Result<(), ActorProcessingErr> {
        match event {
            SupervisionEvent::ActorFailed(actor, _) => {
                if let Some(address) = tree.book.strike_out(actor.get_id()) {
                    tree.failed(address);
                }
            }
            SupervisionEvent::ActorTerminated(actor, ..) => {
                tree.book.strike_out(actor.get_id());
            }
            _ => {}
        }
        Ok(())
    }
}
