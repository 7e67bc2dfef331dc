//! The machine in an actor, in virtual time: when the actor is idle, the asynchronous runtime is about to park its thread and
//! calls the driver, which sends the actor the next stimulus. Only that advances time.

use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use muster_indoor::patrol::{Config, Input, Patrol};
use muster_machines::machine::{Stimulus, step};
use ractor::{Actor, ActorProcessingErr, ActorRef};
use tokio::sync::Notify;

use crate::world::{Outcome, Prepared, Setup, World};

/// Why a patrol could not start. The cause is the computer.
#[derive(Debug, thiserror::Error)]
pub enum EngineError {
    /// The asynchronous runtime could not be built.
    #[error("the asynchronous runtime could not be built")]
    Runtime(#[source] std::io::Error),
    /// The actor could not be started.
    #[error("the actor could not be started")]
    Spawn(#[source] ractor::SpawnErr),
}

/// Patrols a flat with the machine in an actor.
///
/// # Errors
/// If the engine can't be started.
pub fn run(prepared: &Prepared, setup: Setup) -> Result<Outcome, EngineError> {
    let driver = Arc::new(Driver {
        world: Arc::new(Mutex::new(World::new(prepared, setup))),
        actor: OnceLock::new(),
        over: Notify::new(),
    });
    let parked = Arc::clone(&driver);
    let runtime = tokio::runtime::Builder::new_current_thread()
        .on_thread_park(move || parked.step())
        .build()
        .map_err(EngineError::Runtime)?;
    let fly = async {
        let arguments = (prepared.config.clone(), Arc::clone(&driver.world));
        let (actor, handle) = Actor::spawn(None, Drone, arguments).await?;
        let actor = driver.actor.get_or_init(|| actor);
        driver.over.notified().await;
        actor.stop(None);
        // The actor's end is awaited, so that it holds no part of the world any more.
        let _ = handle.await;
        Ok(())
    };
    runtime.block_on(fly).map_err(EngineError::Spawn)?;
    drop(runtime);
    let world = Arc::clone(&driver.world);
    drop(driver);
    let world = Arc::into_inner(world).expect("the actor and the driver have been dropped");
    Ok(world
        .into_inner()
        .unwrap_or_else(PoisonError::into_inner)
        .finish())
}

struct Driver {
    world: Arc<Mutex<World>>,
    actor: OnceLock<ActorRef<Stimulus<Input>>>,
    over: Notify,
}

impl Driver {
    /// Sends the next stimulus to the actor; notifies once the patrol is over.
    fn step(&self) {
        let Some(actor) = self.actor.get() else {
            return;
        };
        match lock(&self.world).next_stimulus() {
            Some(stimulus) => actor
                .cast(stimulus)
                .expect("the actor runs until the patrol is over"),
            None => self.over.notify_one(),
        }
    }
}

/// An actor that holds a patrol.
struct Drone;

impl Actor for Drone {
    type Msg = Stimulus<Input>;
    type State = (Patrol, Arc<Mutex<World>>);
    type Arguments = (Config, Arc<Mutex<World>>);

    async fn pre_start(
        &self,
        _: ActorRef<Self::Msg>,
        (config, world): Self::Arguments,
    ) -> Result<Self::State, ActorProcessingErr> {
        let (seed, now) = {
            let world = lock(&world);
            (world.seed(), world.now())
        };
        Ok((Patrol::new(config, seed, now, None), world))
    }

    async fn handle(
        &self,
        _: ActorRef<Self::Msg>,
        stimulus: Stimulus<Input>,
        (patrol, world): &mut Self::State,
    ) -> Result<(), ActorProcessingErr> {
        let mut world = lock(world);
        let now = world.now();
        let deadline = step(patrol, now, stimulus, |it| world.carry_out(it));
        world.set_deadline(deadline);
        Ok(())
    }
}

/// A panic under this lock is the world's own, whose state is lost with it.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
