//! One drone as a process: the actors that a simulation runs, on real time, a real network and a journal on a disk.
//!
//! Everything runs on one thread. A step's effects are carried out before anything else happens, so a checkpoint that must
//! last is on the disk before the frame that rests on it leaves.

mod counts;
mod endpoint;
mod lists;
mod metrics;
mod network;
mod operators;
mod process;
mod reporter;
mod resting;
mod service;
mod state;
mod tasks;

use std::io;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use muster_actors::{Drone, DroneConfig as ActorsConfig};
use muster_machines::mission::{self, LandingReason};
use muster_machines::node::{Blueprint, Checkpoints, Envelope};
use muster_machines::radio::{self, Incarnations};
use muster_runtime::journal::{Folder, FolderError, Journal, Writer};
use muster_transport::sockets::OpenError;
use thiserror::Error;
use tokio::sync::mpsc::unbounded_channel;
use tokio::task::{JoinError, JoinSet};

use self::endpoint::Endpoint;
use self::lists::Keeper;
use self::network::Network;
use self::operators::Desk;
use self::process::{Components, Process};
use self::tasks::Rereading;
use crate::clock::Clock;
use crate::config::DroneConfig;
use crate::control::{ControlMessage, READY, STARTS};
use crate::log::{self, Format};

/// How long a drone that is done goes on listening and repeating its last words.
const LAST_WORDS: Duration = Duration::from_millis(500);

/// How a drone's process ended that could start; the drone is on the ground unless this says otherwise.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ended {
    /// The mission was flown, or the drone was called down.
    Well,
    /// It came down by itself before the end of the mission.
    Early(LandingReason),
    /// It came down because its journal could not be written any more, or its sockets not be watched.
    Unable(LandingReason),
    /// Whoever started the process is gone, and its simulated vehicle with it, wherever that was.
    Abandoned,
}

/// Why a drone's process could not start, so that nothing was flown, or not go on.
#[derive(Debug, Error)]
pub enum DaemonError {
    /// Its journal can't be had.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// Its journal can't be read or written, or does not tell what the drone has done.
    #[error("can't use the journal in {}", path.display())]
    Journal {
        /// Its folder.
        path: PathBuf,
        /// Why.
        #[source]
        source: io::Error,
    },
    /// Its end of the network can't be opened.
    #[error("no network")]
    Network(#[from] OpenError),
    /// It can't be asked where its file says. A drone that takes part in a flight goes on all the same.
    #[error("can't be asked at {address}")]
    Endpoint {
        /// As configured.
        address: SocketAddr,
        /// What the system says.
        #[source]
        source: io::Error,
    },
    /// The system has no random numbers, without which nobody could tell this life from an earlier one.
    #[error("the system has no random numbers")]
    Random(#[source] getrandom::Error),
    /// The asynchronous runtime does not start, or does not watch sockets or signals.
    #[error("no runtime for the actors")]
    Runtime(#[source] io::Error),
    /// What keeps the drone's time, or listens for it, failed in the middle of its flight.
    #[error("the drone has no time or no ears any more")]
    Task(#[source] JoinError),
    /// It was to go on with a vehicle, and was not told with which.
    #[error("standard input does not begin with what the vehicle is doing")]
    NoVehicle,
    /// An actor could not be started.
    #[error("an actor could not be started")]
    Spawn(#[from] Box<ractor::SpawnErr>),
}

/// How a drone's process is started.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Start {
    /// Tells the drone that leads to begin, in the first life of its journal only: nothing takes off because a process
    /// started again.
    pub fly: bool,
    /// Whether the process ends when its standard input does, and reads there, as `muster swarm` writes it, whom it does
    /// not hear. Only a drone whose vehicle is simulated can be tied.
    pub is_controlled: bool,
    /// Whether a tied process goes on with a vehicle that has flown on without it, which it is told first.
    pub resume: bool,
}

/// Flies a drone until it is on the ground for good.
///
/// # Errors
/// When it can't start, or can't go on.
pub fn run(config: DroneConfig, start: Start) -> Result<Ended, DaemonError> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(DaemonError::Runtime)?;
    runtime.block_on(live(config, start))
}

async fn live(config: DroneConfig, start: Start) -> Result<Ended, DaemonError> {
    let log = log::start(config.log, config.level);
    let clock = Clock::start();
    // A life of the journal's begins last: one that could not even start uses up none.
    let folder = Folder::open(&config.journal)?;
    let now = Arc::new(move || clock.now());
    let mut network = Network::open(&config, now)?;
    let endpoint = open_endpoint(&config).await?;
    let [terminate, interrupt] = tasks::signals_to_end().map_err(DaemonError::Runtime)?;
    let hang_up = tasks::signal_to_reread().map_err(DaemonError::Runtime)?;
    // Not the journal's number: that would begin anew with another journal, under the same key.
    let drawn = getrandom::u32().map_err(DaemonError::Random)?;
    let mut vehicle = (config
        .plan
        .simulated_vehicle(config.id, clock.now().as_nanos()))
    .expect("the configuration has a number of the scenario's");
    let mut control_messages = start.is_controlled.then(tasks::control_messages);
    if let Some(control_messages) = control_messages.as_mut().filter(|_| start.resume) {
        match control_messages.recv().await {
            Some(ControlMessage::Vehicle { epoch, state }) => {
                vehicle.resume(*state, epoch, clock.now())
            }
            Some(ControlMessage::Losses(_) | ControlMessage::Inject { .. }) => {
                return Err(DaemonError::NoVehicle);
            }
            None => return Ok(Ended::Abandoned),
        }
    }
    let (keeper, kept) = Keeper::start(config.kept_list());
    let in_air = vehicle.is_armed();
    let (journal, checkpoints) = open_journal(folder, &config, in_air)?;
    let incarnation = checkpoints.boot();
    let is_known = journal.is_understood() && config.knows_its_flight() && incarnation > 1;
    let is_lost = in_air && !is_known;
    let (tell, written) = unbounded_channel();
    let all = checkpoints.clone();
    // It ends with the process, which tells nobody any more.
    let journal = Writer::start(journal, all, move |it| drop(tell.send(it)));
    let journal = journal.map_err(DaemonError::Runtime)?;
    let waiting = network.begin(drawn).map_err(DaemonError::Runtime)?;
    let (drone, at_ns) = (config.id.0, clock.now().as_nanos());
    tracing::info!(drone, at_ns, incarnation, address = %network.address(), "{STARTS}");
    let process = Process::new(Components {
        id: config.id,
        swarm: config.swarm,
        is_relay: config.is_relay(),
        clock,
        hang_max: config.plan.limits.hang,
        checkpoints,
        journal,
        network,
        authenticator: Arc::clone(&config.authenticator),
        keeper,
        vehicle,
        for_programs: config.log == Format::Json,
        lines_lost: log.lost.clone(),
    });
    if process.state().is_done() {
        tracing::warn!(
            "by its journal this drone has landed for good: to fly again it needs another journal"
        );
        // A service manager that waits for this word would take the end for a failure, and start it again.
        service::ready();
        return Ok(Ended::Well);
    }
    let drone = start_actors(&config, drawn, &process).await?;
    process.begin(drone.clone());
    let mut vital = JoinSet::new();
    vital.spawn(tasks::keep_time(Arc::clone(&process)));
    vital.spawn(tasks::listen(Arc::clone(&process), waiting));
    vital.spawn(tasks::look_after(Arc::clone(&process)));
    vital.spawn(tasks::heed_journal(written, Arc::clone(&process)));
    tokio::spawn(tasks::end_on(terminate, Arc::clone(&process)));
    tokio::spawn(tasks::end_on(interrupt, Arc::clone(&process)));
    let rereading = Rereading {
        signal: hang_up,
        path: config.path.clone(),
        volume: log.volume.clone(),
        authenticator: Arc::clone(&config.authenticator),
        fleet: config.fleet,
    };
    tokio::spawn(tasks::reread_on(rereading, Arc::clone(&process)));
    let watchdog = sd_notify::watchdog_enabled();
    tokio::spawn(tasks::watch(Arc::clone(&process), watchdog));
    if let Some(endpoint) = endpoint {
        tokio::spawn(endpoint.answer(Arc::clone(&process)));
    }
    if let Some(streams) = process.state().streams() {
        let (drone, scenario) = (config.path.clone(), config.scenario_path.clone());
        let desk = Desk::new(drone, scenario, log.recent.clone());
        tokio::spawn(operators::serve(streams, desk, Arc::clone(&process)));
    }
    service::ready();
    tracing::info!("{READY}");
    if let Some(control_messages) = control_messages {
        tokio::spawn(tasks::heed(control_messages, Arc::clone(&process)));
    }
    if is_lost {
        tracing::error!("what the drone was doing is not known any more: it comes down");
        process.bring_down(LandingReason::JournalLost);
    }
    if start.fly {
        begin_to_fly(&process, incarnation);
    }
    tokio::select! {
        () = process.done.notified() => {}
        failure = failure_of(&mut vital) => return Err(DaemonError::Task(failure)),
    }
    tokio::time::sleep(LAST_WORDS).await;
    service::stopping();
    drone.stop().await;
    let (farewell, journal, ended) = {
        let mut state = process.state();
        state.say_talk(clock.now());
        state.report();
        let ended = match state.is_abandoned() {
            true => Ended::Abandoned,
            false => ended(state.landing()),
        };
        state.take_no_more_lists();
        (state.farewell(), state.take_journal(), ended)
    };
    farewell.await;
    let written = tokio::task::spawn_blocking(move || drop(journal));
    written.await.map_err(DaemonError::Task)?;
    // It has failed only where it could not keep a list, and has said so.
    let _ = kept.await;
    Ok(ended)
}

/// Where it is asked what it is doing, if anywhere. A drone on the ground that can't be asked where it is to be does not
/// start; one that takes part in a flight is needed more than what it tells.
async fn open_endpoint(config: &DroneConfig) -> Result<Option<Endpoint>, DaemonError> {
    let Some(address) = config.observed_at else {
        return Ok(None);
    };
    let mut endpoint = Endpoint::at(address);
    match endpoint.open().await {
        Err(source) if !config.is_of_a_flight() => Err(DaemonError::Endpoint { address, source }),
        Err(error) => {
            tracing::error!(%error, "can't be asked at {address}: the drone flies on, and tries again each second");
            Ok(Some(endpoint))
        }
        Ok(()) => Ok(Some(endpoint)),
    }
}

/// Begins another life of the journal's. Before a flight the scenario is kept in its folder.
fn open_journal(
    folder: Folder,
    config: &DroneConfig,
    in_air: bool,
) -> Result<(Journal<Folder>, Checkpoints), DaemonError> {
    let opened = if in_air {
        Journal::open_in_flight(folder)
    } else {
        Journal::open(folder)
    };
    let kept = opened.and_then(|(journal, checkpoints)| {
        config.keep_flight()?;
        Ok((journal, checkpoints))
    });
    kept.map_err(|source| DaemonError::Journal {
        path: config.journal.clone(),
        source,
    })
}

/// The first task that fails, if ever one does: a drone without time or ears is not to pass for alive.
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
    let actors = ActorsConfig {
        blueprint: Blueprint {
            authenticator: Arc::clone(&config.authenticator) as _,
            radio: radio::Config {
                incarnations: Incarnations::Drawn(incarnation),
                ..simulated.radio
            },
            ..simulated
        },
        restarts: plan.limits.restarts,
        waiting_max: plan.limits.waiting_max,
    };
    let environment = Arc::clone(process) as _;
    let started = Drone::start(actors, environment).await;
    Ok(started.map_err(Box::new)?)
}

/// Tells the drone to lead its swarm, if it has not lived before.
fn begin_to_fly(process: &Process, incarnation: u32) {
    if incarnation > 1 {
        tracing::warn!(
            incarnation,
            "not told to fly: nothing takes off because a process started again"
        );
        return;
    }
    process.state().post(Envelope::Mission(mission::Input::Fly));
}

fn ended(landing: Option<LandingReason>) -> Ended {
    match landing {
        None | Some(LandingReason::MissionOver | LandingReason::Recalled) => Ended::Well,
        Some(reason @ (LandingReason::JournalLost | LandingReason::NetworkLost)) => {
            Ended::Unable(reason)
        }
        Some(reason) => Ended::Early(reason),
    }
}
