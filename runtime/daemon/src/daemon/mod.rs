//! One drone as a process: the simulation's actors in real time, with a real network and a journal on a disk.
//!
//! All actors and tasks run on one thread; the journal and the revocation list are written on others. A frame leaves only
//! after the checkpoints that it depends on are on the disk.

mod actors;
mod agent_calls;
mod autopilot;
mod computer;
mod counts;
mod durable;
mod endpoint;
mod error;
mod held;
mod metrics;
mod monitor;
mod network;
mod operators;
mod outcome;
mod own_drone;
mod permission;
mod process;
mod radio_link;
mod reporter;
mod resources;
mod revocation;
mod service;
mod state;
mod tasks;
mod vehicle;

use std::sync::Arc;
use std::time::Duration;

use muster_actors::{Drone, DroneConfig as ActorsConfig};
use muster_machines::mission::{self, LandingReason};
use muster_machines::node::{Blueprint, Envelope};
use muster_machines::radio::{self, Incarnations};
use muster_runtime::journal::{WriteReport, Writer};
use rustix::process::{getpriority_process, setpriority_process};
use tokio::signal::unix::Signal;
use tokio::sync::mpsc::{UnboundedReceiver, unbounded_channel};
use tokio::task::{JoinError, JoinHandle, JoinSet};

use self::computer::Computer;
use self::endpoint::Endpoint;
pub use self::error::DaemonError;
use self::monitor::Monitor;
use self::network::Waiting;
use self::operators::OperatorService;
use self::own_drone::OwnDrone;
use self::process::{Components, Process};
use self::reporter::Reporter;
use self::resources::{OpenedVehicle, Resources, open_journal, open_vehicle};
use self::revocation::{Revocations, Store};
use self::tasks::Reload;
use self::vehicle::Vehicle;
use crate::clock::Clock;
use crate::config::DroneConfig;
use crate::control::{READY, STARTS};
use crate::log::{self, Format, Log, Lost};

/// How long a finished drone still listens and repeats its last frames.
const LINGER: Duration = Duration::from_millis(500);

/// Nice value that the process asks for, which the service's unit gives, too. Beside programs of the same value its sticks may be
/// older than [`muster_msp::RC_HOLD`] before they are renewed.
const NICE: i32 = -10;

/// How a drone's process ended. The drone is on the ground, except after [`Self::Abandoned`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ended {
    /// The mission was flown, or the drone was recalled.
    Completed,
    /// The drone landed by itself before the end of the mission.
    LandedEarly(LandingReason),
    /// The drone landed because its journal or its sockets failed.
    Failed(LandingReason),
    /// The control channel closed. The simulated vehicle ended with the process, on the ground or in the air.
    Abandoned,
}

/// Options of a drone's process.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Start {
    /// Orders the swarm to fly; for the leader only. Ignored after a restart: only the journal's first incarnation takes
    /// off.
    pub fly: bool,
    /// Whether standard input is a control channel: the process executes its messages and ends when it closes. For
    /// simulated vehicles only.
    pub is_controlled: bool,
    /// Whether the control channel's first message is the state of the vehicle, which kept flying without the process.
    pub resume: bool,
}

/// Flies a drone until it is on the ground for good.
///
/// # Errors
/// If the process can't start, or the timer task or the network task fails.
pub fn run(config: DroneConfig, start: Start) -> Result<Ended, DaemonError> {
    prefer_this_process();
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(DaemonError::Runtime)?;
    runtime.block_on(live(config, start))
}

/// Before it has threads, which inherit it. Without the right to it the process runs as it was started.
fn prefer_this_process() {
    if getpriority_process(None).is_ok_and(|nice| nice > NICE) {
        let _ = setpriority_process(None, NICE);
    }
}

async fn live(config: DroneConfig, start: Start) -> Result<Ended, DaemonError> {
    let log = log::start(config.log, config.level);
    let clock = Clock::start();
    // The incarnation is counted last: a process that can't start uses up none.
    let resources = Resources::open(&config, clock).await?;
    let Some(opened) = open_vehicle(&config, start, clock).await? else {
        return Ok(Ended::Abandoned);
    };
    let OpenedVehicle {
        mut vehicle,
        control_messages,
        port_events,
    } = opened;
    vehicle.learn_whether_armed().await;
    let drawn = resources.drawn;
    let (incarnation, interfaces) =
        Incarnation::begin(&config, resources, vehicle, (clock, log.lost.clone()))?;
    let process = Arc::clone(&incarnation.process);
    if process.state().is_done() {
        // Without this message the service manager would wait for it, and restart the process.
        service::ready();
        return Err(DaemonError::FlightOver {
            journal: config.journal,
        });
    }
    let drone = start_actors(&config, drawn, &process).await?;
    process.start(drone.clone());
    let mut vital = start_tasks(&config, &process, &log, interfaces);
    service::ready();
    tracing::info!("{READY}");
    if let Some(control_messages) = control_messages {
        tokio::spawn(tasks::control(control_messages, Arc::clone(&process)));
    }
    if let Some(port_events) = port_events {
        tokio::spawn(tasks::listen_to_port(port_events, Arc::clone(&process)));
    }
    if incarnation.is_lost {
        tracing::error!("the journal has no valid state of the flight: the drone lands");
        process.land_at_once(LandingReason::JournalLost);
    }
    if start.fly {
        order_take_off(&process, incarnation.number);
    }
    tokio::select! {
        () = process.done.notified() => {}
        failure = failure_of(&mut vital) => return Err(DaemonError::Task(failure)),
    }
    tokio::time::sleep(LINGER).await;
    service::stopping();
    drone.stop().await;
    incarnation.end().await
}

/// A started incarnation.
struct Incarnation {
    process: Arc<Process>,
    /// Number in the journal, from 1.
    number: u32,
    /// Whether the drone is in the air and its journal has no valid state of the flight.
    is_lost: bool,
    /// Ends once the last revocation list is stored.
    stored: JoinHandle<()>,
}

/// Inputs of an incarnation's tasks.
struct Interfaces {
    /// Received datagrams.
    waiting: Waiting,
    /// Reports of the journal.
    reports: UnboundedReceiver<WriteReport>,
    endpoint: Option<Endpoint>,
    recall: [Signal; 2],
    reload: Signal,
}

impl Incarnation {
    /// Opens the journal, which counts the incarnation, and starts to receive.
    fn begin(
        config: &DroneConfig,
        resources: Resources,
        vehicle: Vehicle,
        (clock, lines_lost): (Clock, Lost),
    ) -> Result<(Self, Interfaces), DaemonError> {
        let (store, stored) = Store::start(config.kept_list());
        let in_air = vehicle.is_armed();
        let (journal, mut checkpoints) = open_journal(resources.folder, config, in_air)?;
        checkpoints.set_revoked(config.revoked.revoked());
        let number = checkpoints.boot();
        let is_known = journal.is_intact() && config.knows_its_flight() && number > 1;
        let (report, reports) = unbounded_channel();
        let all = checkpoints.clone();
        // The receiver is gone once the process has ended.
        let journal = Writer::start(journal, all, move |it| drop(report.send(it)));
        let journal = journal.map_err(DaemonError::Runtime)?;
        let mut network = resources.network;
        let waiting = network
            .begin(resources.drawn)
            .map_err(DaemonError::Runtime)?;
        let (drone, at_ns) = (config.id.0, clock.now().as_nanos());
        tracing::info!(drone, at_ns, incarnation = number, address = %network.address(), "{STARTS}");
        vehicle.begin();
        let has_agent = config.plan.agent.is_some() && !config.is_relay();
        let monitor = Monitor::new(
            Reporter::new(config.id, config.log == Format::Json),
            lines_lost,
            Computer::watch(&config.journal).map_err(DaemonError::Runtime)?,
            has_agent.then(Arc::default),
        );
        let process = Process::new(Components {
            own: OwnDrone {
                id: config.id,
                swarm: config.swarm,
                is_relay: config.is_relay(),
            },
            clock,
            hang_max: config.plan.limits.hang,
            checkpoints,
            journal,
            network,
            revocations: Revocations::new((config.id, config.fleet), resources.in_force, store),
            vehicle,
            monitor,
        });
        let incarnation = Self {
            process,
            number,
            is_lost: in_air && !is_known,
            stored,
        };
        let interfaces = Interfaces {
            waiting,
            reports,
            endpoint: resources.endpoint,
            recall: resources.recall,
            reload: resources.reload,
        };
        Ok((incarnation, interfaces))
    }

    /// Writes what is not on the disk yet and closes the network's connections. Must be called after the actors have
    /// stopped.
    async fn end(self) -> Result<Ended, DaemonError> {
        let (farewell, journal, ended) = {
            let mut state = self.process.state();
            state.report_traffic(self.process.clock.now());
            state.report();
            let ended = match state.outcome().is_abandoned() {
                true => Ended::Abandoned,
                false => ended(state.outcome().landing()),
            };
            (state.farewell(), state.close(), ended)
        };
        farewell.await;
        let written = tokio::task::spawn_blocking(move || drop(journal));
        written.await.map_err(DaemonError::Task)?;
        // A failure is logged already.
        let _ = self.stored.await;
        Ok(ended)
    }
}

/// Starts the tasks. Returns those without which the drone can't fly.
fn start_tasks(
    config: &DroneConfig,
    process: &Arc<Process>,
    log: &Log,
    interfaces: Interfaces,
) -> JoinSet<()> {
    let mut vital = JoinSet::new();
    vital.spawn(tasks::keep_time(Arc::clone(process)));
    vital.spawn(tasks::listen(Arc::clone(process), interfaces.waiting));
    vital.spawn(tasks::detect_hangs(Arc::clone(process)));
    vital.spawn(tasks::watch_journal(
        interfaces.reports,
        Arc::clone(process),
    ));
    for signal in interfaces.recall {
        tokio::spawn(tasks::recall_on(signal, Arc::clone(process)));
    }
    let reload = Reload {
        signal: interfaces.reload,
        path: config.path.clone(),
        volume: log.volume.clone(),
        fleet: config.fleet,
    };
    tokio::spawn(tasks::reload_on(reload, Arc::clone(process)));
    if config.log == Format::Json {
        tokio::spawn(tasks::report_traffic(Arc::clone(process)));
    }
    let watchdog = sd_notify::watchdog_enabled();
    tokio::spawn(tasks::feed_watchdog(Arc::clone(process), watchdog));
    if let Some(endpoint) = interfaces.endpoint {
        tokio::spawn(endpoint.serve(Arc::clone(process)));
    }
    if let Some(streams) = process.state().streams() {
        let (drone, scenario) = (config.path.clone(), config.scenario_path.clone());
        let service = OperatorService::new(drone, scenario, log.recent.clone());
        tokio::spawn(operators::serve(streams, service, Arc::clone(process)));
    }
    vital
}

/// Waits for the first task that fails. Never returns if none fails.
async fn failure_of(tasks: &mut JoinSet<()>) -> JoinError {
    while let Some(ended) = tasks.join_next().await {
        if let Err(failure) = ended {
            return failure;
        }
    }
    std::future::pending().await
}

async fn start_actors(
    config: &DroneConfig,
    incarnation: u32,
    process: &Arc<Process>,
) -> Result<Drone, DaemonError> {
    let plan = &config.plan;
    let simulated = plan.blueprint(config.swarm, config.id);
    let agent = match (simulated.agent, process.state().agent_calls()) {
        (Some(agent), Some(calls)) => Some(calls.measure(process.clock, agent)),
        (agent, _) => agent,
    };
    let actors = ActorsConfig {
        blueprint: Blueprint {
            authenticator: Arc::clone(&config.authenticator) as _,
            radio: radio::Config {
                incarnations: Incarnations::Drawn(incarnation),
                ..simulated.radio
            },
            agent,
            link: config.link(),
            ..simulated
        },
        restarts: plan.limits.restarts,
        waiting_max: plan.limits.waiting_max,
    };
    let environment = Arc::clone(process) as _;
    let started = Drone::start(actors, environment).await;
    Ok(started.map_err(Box::new)?)
}

/// Orders the drone to lead its swarm, in its first incarnation only.
fn order_take_off(process: &Process, incarnation: u32) {
    if incarnation > 1 {
        tracing::warn!(
            incarnation,
            "ignored --fly: a restarted process never takes off"
        );
        return;
    }
    process.state().post(Envelope::Mission(mission::Input::Fly));
}

fn ended(landing: Option<LandingReason>) -> Ended {
    match landing {
        None | Some(LandingReason::MissionOver | LandingReason::Recalled) => Ended::Completed,
        Some(reason @ (LandingReason::JournalLost | LandingReason::NetworkLost)) => {
            Ended::Failed(reason)
        }
        Some(reason) => Ended::LandedEarly(reason),
    }
}
