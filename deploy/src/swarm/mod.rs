//! Flies the drones of a scenario as processes on this machine or on others. Injects the scenario's faults, checks the rules
//! of a simulation, and leaves no process behind.
//!
//! Only the twin of the swarm ([`muster_scenarios::twin`]) knows the positions of the vehicles and the fault plan. The
//! starter feeds it with the reports of the processes, and with the flight of the simulated flight controllers, if there are
//! any, which run in the starter. It applies the twin's decisions: which process runs or hangs, and
//! which frames it loses. A second twin is a few seconds behind, so that it takes late reports in their order; it checks the
//! rules.

mod controllers;
mod flight;
mod folder;
mod follower;
mod host;
mod lines;
mod link;
mod losses;
mod offset;
mod output;
mod process;

use std::borrow::Cow;
use std::io;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::time::Duration;

use muster_machines::identity::NodeId;
use muster_machines::msp::controller::Receiver;
use muster_runtime::diagnostic::BadInput;
use muster_runtime::identity::KeysError;
use muster_runtime::vehicle::VehicleKind;
use muster_scenarios::engine::Progress;
use muster_scenarios::report::{Flight, Report};
use muster_scenarios::scenario::{
    ControllerFault, DroneFault, Fault, FaultKind, Override, Scenario,
};
use muster_scenarios::twin;
use thiserror::Error;

use muster_daemon::config::TransportName;
use muster_daemon::launcher::protocol::VERSION;

use self::controllers::{Controllers, open_ports};
use crate::hosts::Hosts;

/// A flight to start.
#[derive(Debug)]
pub struct Request<'a> {
    /// The scenario's file.
    pub path: &'a Path,
    /// What replaces fields of the file.
    pub overrides: &'a [Override],
    /// The loaded scenario.
    pub scenario: &'a Scenario,
    /// The daemon's program on this machine.
    pub musterd: &'a Path,
    /// The hosts of the drones; if `None`, all fly on this machine over the loopback interface.
    pub hosts: Option<&'a Hosts>,
    /// The transport of frames.
    pub transport: TransportName,
    /// The folder for keys, files, journals and logs, with a subfolder per drone. Files of an earlier flight there are
    /// removed. A folder that holds anything else is refused.
    pub folder: &'a Path,
    /// The program of the drones' flight controllers: Betaflight's software build. `None`: our simulation.
    pub firmware: Option<&'a Path>,
    /// Whether frames are lost as over the scenario's radio; otherwise every drone hears every other.
    pub emulates_radio: bool,
}

/// Receives the progress of a flight.
pub type Watcher<'a> = &'a mut dyn FnMut(Progress);

/// Why a flight was not started or was aborted. No process is left.
#[derive(Debug, Error)]
pub enum SwarmError {
    /// The scenario can't be flown by processes.
    #[error(transparent)]
    Refused(#[from] BadInput),
    /// The keys of the fleet could not be created.
    #[error("can't create keys for the drones")]
    Keys(#[from] KeysError),
    /// A file could not be written.
    #[error("can't write {}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The cause.
        #[source]
        source: io::Error,
    },
    /// A file to upload could not be read.
    #[error("can't read {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The cause.
        #[source]
        source: io::Error,
    },
    /// A host's launcher, or the command that runs it, ended at once.
    #[error("`{host}` can't start drones: {last}")]
    HostGone {
        /// The command that runs the launcher.
        host: String,
        /// Its last line on standard error.
        last: String,
    },
    /// The connection to a host was lost in flight. The host's launcher ends its processes.
    #[error("connection to `{host}` lost, flight aborted: {last}")]
    HostLost {
        /// The command that runs the launcher.
        host: String,
        /// Its last line on standard error.
        last: String,
    },
    /// A host's launcher did not answer in time.
    #[error("`{0}` does not answer within {START_MAX:?}")]
    HostLate(String),
    /// A host's daemon has another version.
    #[error("`{host}` runs musterd {theirs}; version {VERSION} is needed")]
    OtherVersion {
        /// The command that runs the launcher.
        host: String,
        /// The version of its daemon.
        theirs: String,
    },
    /// No free ports on this machine.
    #[error("can't reserve ports for the drones")]
    Ports(#[source] io::Error),
    /// The flight controllers did not start.
    #[error("can't start the flight controllers")]
    Controllers(#[source] io::Error),
    /// A program could not be started.
    #[error("can't start {}", program.display())]
    Start {
        /// The program.
        program: PathBuf,
        /// The cause.
        #[source]
        source: io::Error,
    },
    /// A process ended before its drone was ready.
    #[error("the process of drone {drone} ended at start: {last}")]
    EndedEarly {
        /// The drone.
        drone: NodeId,
        /// The last text that the process wrote.
        last: String,
    },
    /// A drone was not ready in time.
    #[error("the process of drone {0} was not ready within {START_MAX:?}")]
    Late(NodeId),
    /// The asynchronous runtime did not start, or could not watch processes or signals.
    #[error("can't start the asynchronous runtime")]
    Runtime(#[source] io::Error),
}

/// Time for a process to get ready, and for a launcher to answer first.
const START_MAX: Duration = Duration::from_secs(10);

/// Flies a scenario with one process per drone, and checks the rules. SIGINT and SIGTERM end the processes at once; the report
/// then says what was flown, and that the flight was interrupted.
///
/// # Errors
/// If processes can't fly the scenario, or can't be started, or the flight is aborted. No process is left then.
pub fn fly(
    request: &Request<'_>,
    watcher: Option<Watcher<'_>>,
) -> Result<(Report, Flight), SwarmError> {
    check(request)?;
    let hosts = hosts(request)?;
    let ports = open_ports(&request.scenario.plan).map_err(SwarmError::Ports)?;
    let (drones, _lock) = folder::prepare(request, &hosts, &ports)?;
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(SwarmError::Runtime)?;
    let controllers = Controllers::start(request.scenario, ports, request.firmware);
    let controllers = controllers.map_err(SwarmError::Controllers)?;
    runtime.block_on(flight::fly(
        request,
        (&hosts, &drones),
        controllers,
        watcher,
    ))
}

/// The file of a drone or relay whose process is started by hand.
#[derive(Debug)]
pub struct Prepared {
    /// The drone or relay.
    pub id: NodeId,
    /// Its file.
    pub file: PathBuf,
    /// Where its file expects the flight controller. `None` if it has none.
    pub controller: Option<SocketAddr>,
}

/// Writes what the drones' processes need (keys, a file for each drone, scenario and mission) and starts nothing. Frames of
/// processes that are started by hand reach every other one.
///
/// # Errors
/// If processes can't fly the scenario, the folder is used, or a file can't be written.
pub fn prepare(request: &Request<'_>) -> Result<Vec<Prepared>, SwarmError> {
    check(request)?;
    if request.scenario.plan.receiver == Receiver::Override {
        let message = "a flight that is started by hand has no pilots";
        let help = "set `vehicle.receiver` = \"sole\"";
        return Err(BadInput::without_excerpt(request.path, message, help).into());
    }
    let ports = open_ports(&request.scenario.plan).map_err(SwarmError::Ports)?;
    let drones = folder::prepare_by_hand(request, &*hosts(request)?, &ports)?;
    let prepared = drones.into_iter().map(|drone| Prepared {
        id: drone.id,
        file: request.folder.join(drone.config),
        controller: drone.controller,
    });
    Ok(prepared.collect())
}

/// The requested hosts, or this machine.
fn hosts<'a>(request: &Request<'a>) -> Result<Cow<'a, Hosts>, SwarmError> {
    match request.hosts {
        Some(hosts) => Ok(Cow::Borrowed(hosts)),
        None => {
            let nodes = request.scenario.plan.nodes();
            let local = Hosts::local(nodes, request.musterd).map_err(SwarmError::Ports)?;
            Ok(Cow::Owned(local))
        }
    }
}

/// Refuses a scenario that only a simulation can fly.
fn check(request: &Request<'_>) -> Result<(), BadInput> {
    let scenario = request.scenario;
    let refuse = |message: String| {
        let help = "muster sim flies it in simulation";
        Err(BadInput::without_excerpt(request.path, message, help))
    };
    if scenario.has_other_swarms() {
        return refuse("the scenario has several swarms; processes fly one".to_owned());
    }
    let is_far = |hosts: &Hosts| hosts.hosts.iter().any(|host| !host.is_local());
    if scenario.plan.vehicle_kind == VehicleKind::Msp && request.hosts.is_some_and(is_far) {
        let message = "simulated flight controllers run on this machine only; drones on other hosts need `vehicle.kind` = \
                       \"closed-form\"";
        return refuse(message.to_owned());
    }
    if request.firmware.is_some() {
        let is_ours = |fault: &Fault| match fault.kind {
            FaultKind::Drone(_, DroneFault::Controller(fault)) => {
                fault != ControllerFault::TakeOver
            }
            _ => false,
        };
        if scenario.plan.vehicle_kind != VehicleKind::Msp || scenario.plan.pose.is_none() {
            let message = "a firmware of its own needs `vehicle.kind` = \"msp\" and a table `[vehicle.pose]`: it has no GPS";
            return refuse(message.to_owned());
        }
        if scenario.faults.iter().any(is_ours) {
            let message = "faults of flight controllers are injected into our simulation only, not into a firmware";
            return refuse(message.to_owned());
        }
    }
    if scenario.plan.is_steered() {
        return refuse("the scenario needs a simulated pilot or operator".to_owned());
    }
    let faults = (1..).zip(&scenario.faults);
    let mut refused = faults.filter_map(|(nth, fault)| Some((nth, twin::refuses(fault)?)));
    match refused.next() {
        Some((nth, why)) => refuse(format!(
            "fault {nth} can't be injected into a process: {why}"
        )),
        None => Ok(()),
    }
}
