//! The engine that runs the supervision tree of a real flight, in virtual time.
//!
//! All actors share one thread. The driver takes the next task from the world and sends it to an actor. Only that advances
//! time. It does so at the end of each step, and otherwise when all actors are idle: the asynchronous runtime is then about to
//! park the thread. To wait for that after each step took a tenth of the time of a grid of 1,000.

use std::sync::atomic::{AtomicBool, Ordering};
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
        world: Mutex::new(world),
        meter: Mutex::new(meter),
        drones: OnceLock::new(),
        awaits_step: AtomicBool::new(false),
        over: Notify::new(),
    });
    let parked = Arc::clone(&driver);
    let runtime = tokio::runtime::Builder::new_current_thread()
        .on_thread_park(move || parked.send_next_task())
        .build()
        .map_err(RunError::Runtime)?;
    runtime
        .block_on(fly(scenario, &driver))
        .map_err(RunError::Spawn)?;
    drop(runtime);
    let driver = Arc::into_inner(driver).expect("all actors and the runtime have been dropped");
    let world = driver.world.into_inner();
    Ok(world.unwrap_or_else(PoisonError::into_inner))
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
            driver: Arc::clone(driver),
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
    world: Mutex<World>,
    meter: Mutex<Option<Meter>>,
    drones: OnceLock<Vec<Drone>>,
    /// Whether the task that was sent last is a step, and its actor has neither carried it out nor failed.
    awaits_step: AtomicBool,
    over: Notify,
}

impl Driver {
    /// Sends the next task to its actor; notifies once the run is over.
    fn send_next_task(&self) {
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
            What::Step(stimulus) => {
                self.awaits_step.store(true, Ordering::Relaxed);
                Message::Step(stimulus)
            }
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
    driver: Arc<Driver>,
    id: NodeId,
}

impl SimulatedEnvironment {
    fn world(&self) -> MutexGuard<'_, World> {
        lock(&self.driver.world)
    }
}

impl Environment for SimulatedEnvironment {
    fn now(&self) -> Timestamp {
        self.world().now_of(self.id)
    }

    fn seed(&self) -> u64 {
        self.world().seed(self.id)
    }

    fn checkpoints(&self) -> Checkpoints {
        self.world().checkpoints(self.id).clone()
    }

    fn carry_out(&self, from: Address, output: &mut StepOutput) {
        self.world().carry_out(self.id, from, output);
        // An actor that starts also steps. More may follow then, before all are idle.
        if self.driver.awaits_step.swap(false, Ordering::Relaxed) {
            self.driver.send_next_task();
        }
    }

    fn failed(&self, address: Address, decision: RestartDecision) {
        self.driver.awaits_step.store(false, Ordering::Relaxed);
        self.world().failed(self.id, address, decision);
    }

    fn starting(&self, address: Address) {
        self.world().starting(self.id, address);
    }
}

/// A panic under this lock is the world's own, whose state is lost with it.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
