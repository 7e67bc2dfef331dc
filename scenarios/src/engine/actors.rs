//! The engine that runs the supervision tree of a real flight, in virtual time.
//!
//! All actors share one thread. When they are idle, the asynchronous runtime is about to park that thread and calls the
//! driver. The driver takes the next task from the world and sends it to an actor. Only that advances time.

use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use muster_actors::{Drone, DroneConfig, Environment, Message};
use muster_machines::identity::NodeId;
use muster_machines::node::{Address, Checkpoints, StepOutput};
use muster_machines::supervision::RestartDecision;
use muster_machines::time::Timestamp;
use tokio::sync::Notify;

use super::{Meter, RunError};
use crate::scenario::Scenario;
use crate::world::{Task, What, World, blueprints};

pub(super) fn run(
    scenario: &Scenario,
    world: World,
    meter: Option<Meter>,
) -> Result<World, RunError> {
    let driver = Arc::new(Driver {
        world: Arc::new(Mutex::new(world)),
        meter: Mutex::new(meter),
        drones: OnceLock::new(),
        over: Notify::new(),
    });
    let parked = Arc::clone(&driver);
    let runtime = tokio::runtime::Builder::new_current_thread()
        .on_thread_park(move || parked.step())
        .build()
        .map_err(RunError::Runtime)?;
    let world = Arc::clone(&driver.world);
    runtime
        .block_on(fly(scenario, &driver))
        .map_err(RunError::Spawn)?;
    drop(runtime);
    drop(driver);
    let world = Arc::into_inner(world).expect("all actors and the driver have been dropped");
    Ok(world.into_inner().unwrap_or_else(PoisonError::into_inner))
}

async fn fly(scenario: &Scenario, driver: &Arc<Driver>) -> Result<(), ractor::SpawnErr> {
    let mut drones = Vec::new();
    for (id, blueprint) in (0..).map(NodeId).zip(blueprints(scenario)) {
        let config = DroneConfig {
            blueprint,
            restarts: scenario.plan.limits.restarts,
            waiting_max: scenario.plan.limits.waiting_max,
        };
        let environment = Arc::new(SimulatedEnvironment {
            world: Arc::clone(&driver.world),
            id,
        });
        drones.push(Drone::start(config, environment).await?);
    }
    // From here on the driver takes tasks.
    let drones = driver.drones.get_or_init(|| drones);
    driver.over.notified().await;
    for drone in drones {
        drone.stop().await;
    }
    Ok(())
}

struct Driver {
    world: Arc<Mutex<World>>,
    meter: Mutex<Option<Meter>>,
    drones: OnceLock<Vec<Drone>>,
    over: Notify,
}

impl Driver {
    /// Sends the next task to its actor; notifies once the run is over.
    fn step(&self) {
        let Some(drones) = self.drones.get() else {
            return;
        };
        let task = {
            let mut world = lock(&self.world);
            let task = world.next();
            if let Some(meter) = &mut *lock(&self.meter) {
                meter.read(&world);
            }
            task
        };
        let Some(Task {
            drone,
            address,
            what,
        }) = task
        else {
            self.over.notify_one();
            return;
        };
        let drone = &drones[drone.0 as usize];
        let message = match what {
            What::Step(stimulus) => Message::Step(stimulus),
            What::Crash => Message::Crash,
            What::Restart => return drone.restart(address),
            What::Boot => return drone.boot(),
        };
        drone
            .book()
            .cast(address, message)
            .expect("an actor that runs has one message at a time");
    }
}

struct SimulatedEnvironment {
    world: Arc<Mutex<World>>,
    id: NodeId,
}

impl Environment for SimulatedEnvironment {
    fn now(&self) -> Timestamp {
        lock(&self.world).now_of(self.id)
    }

    fn seed(&self) -> u64 {
        lock(&self.world).seed(self.id)
    }

    fn checkpoints(&self) -> Checkpoints {
        lock(&self.world).checkpoints(self.id).clone()
    }

    fn carry_out(&self, from: Address, output: &mut StepOutput) {
        lock(&self.world).carry_out(self.id, from, output);
    }

    fn failed(&self, address: Address, decision: RestartDecision) {
        lock(&self.world).failed(self.id, address, decision);
    }

    fn starting(&self, address: Address) {
        lock(&self.world).starting(self.id, address);
    }
}

/// A panic under this lock is the world's own, whose state is lost with it.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
