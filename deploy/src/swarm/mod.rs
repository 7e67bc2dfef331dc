//! The drones of a scenario as processes on this machine or on others: started, followed, hit by the scenario's faults, judged by the
//! rules of a simulation, and ended, however this ends.
//!
//! Nothing but the twin of the swarm ([`muster_scenarios::twin`]) knows where vehicles are and what is to befall whom; the
//! starter tells it what processes say, and makes them be as it says: who runs, who hangs, who does not hear whom.

mod child;
mod folder;
mod follow;
mod host;
mod hosts;
mod link;
mod offset;
mod said;

use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use muster_machines::identity::NodeId;
use muster_runtime::diagnostic::BadInput;
use muster_runtime::identity::KeysError;
use muster_scenarios::engine::Progress;
use muster_scenarios::report::{Flight, Report};
use muster_scenarios::scenario::Scenario;
use muster_scenarios::twin;
use thiserror::Error;

use muster_daemon::agent::protocol::VERSION;
use muster_daemon::config::TransportName;

pub use self::hosts::{Hosts, fields, schema};

/// What is to be flown, and with what.
#[derive(Debug)]
pub struct Request<'a> {
    /// The scenario's file.
    pub path: &'a Path,
    /// What it says.
    pub scenario: &'a Scenario,
    /// The daemon's program on this machine, for drones that fly here.
    pub musterd: &'a Path,
    /// Where its drones fly; all on this machine, over its loopback, without.
    pub hosts: Option<&'a Hosts>,
    /// How drones' frames move.
    pub transport: TransportName,
    /// The folder for keys, files, journals and logs; a folder a drone. What an earlier flight left there is removed; a
    /// folder that is not of a flight is refused.
    pub folder: &'a Path,
    /// Whether drones hear each other as the scenario's radio would carry, and not all of the network.
    pub emulates_radio: bool,
}

/// Whoever wants to know how far a flight is.
pub type Watcher<'a> = &'a mut dyn FnMut(Progress);

/// Why a swarm was not flown to the end of its flight. No process is left.
#[derive(Debug, Error)]
pub enum SwarmError {
    /// The scenario can't be flown by processes.
    #[error(transparent)]
    Refused(#[from] BadInput),
    /// The keys of its fleet could not be made.
    #[error("no keys for the drones")]
    Keys(#[from] KeysError),
    /// A file could not be written.
    #[error("can't write {}", path.display())]
    Write {
        /// Which one.
        path: PathBuf,
        /// Why.
        #[source]
        source: io::Error,
    },
    /// A file could not be read that is to be carried to a host.
    #[error("can't read {}", path.display())]
    Read {
        /// Which one.
        path: PathBuf,
        /// Why.
        #[source]
        source: io::Error,
    },
    /// A host's agent, or what was to run it there, ended at once.
    #[error("no drones can be started by `{host}`: {last}")]
    HostGone {
        /// The command that runs others there.
        host: String,
        /// What it said last.
        last: String,
    },
    /// A host was not heard any more in the middle of the flight. Its agent ends what it started there.
    #[error("`{host}` is not heard any more, so the flight was ended before it was over: {last}")]
    HostLost {
        /// The command that runs others there.
        host: String,
        /// What it said last.
        last: String,
    },
    /// A host's agent did not answer in time.
    #[error("`{0}` does not answer within {START_MAX:?}")]
    HostLate(String),
    /// A host's daemon is of another version.
    #[error("the musterd that `{host}` runs is of version {theirs}, and this is {VERSION}")]
    OtherVersion {
        /// The command that runs others there.
        host: String,
        /// Of which it is.
        theirs: String,
    },
    /// There are no ports for the drones.
    #[error("no ports for the drones")]
    Ports(#[source] io::Error),
    /// A process could not be started.
    #[error("can't start {}", program.display())]
    Start {
        /// What was to be started.
        program: PathBuf,
        /// Why.
        #[source]
        source: io::Error,
    },
    /// A process ended before its drone was there.
    #[error("the process of drone {drone} ended at its start: {last}")]
    EndedEarly {
        /// Whose.
        drone: NodeId,
        /// What it said last.
        last: String,
    },
    /// A process did not say in time that its drone is there.
    #[error("the process of drone {0} did not start within {START_MAX:?}")]
    Late(NodeId),
    /// The asynchronous runtime does not start, or does not watch processes or signals.
    #[error("no runtime for the swarm")]
    Runtime(#[source] io::Error),
    /// Somebody ended it.
    #[error("ended before the flight was over; no process is left")]
    Interrupted,
}

/// How long a process may take to start.
const START_MAX: Duration = Duration::from_secs(10);

/// Flies a scenario's drones, each a process of its own, and judges what they do.
///
/// # Errors
/// When the scenario can't be flown by processes, or they can't be started; no process is left then.
pub fn fly(
    request: &Request<'_>,
    watcher: Option<Watcher<'_>>,
) -> Result<(Report, Flight), SwarmError> {
    check(request)?;
    let here;
    let hosts = match request.hosts {
        Some(hosts) => hosts,
        None => {
            here = Hosts::here(request.scenario.plan.nodes(), request.musterd)
                .map_err(SwarmError::Ports)?;
            &here
        }
    };
    let (drones, _lock) = folder::prepare(request, hosts)?;
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(SwarmError::Runtime)?;
    runtime.block_on(follow::fly(request, (hosts, &drones), watcher))
}

/// Refuses what processes can't do.
fn check(request: &Request<'_>) -> Result<(), BadInput> {
    let scenario = request.scenario;
    let refuse = |message: String| {
        let help = "muster sim flies it in simulation";
        Err(BadInput::without_excerpt(request.path, message, help))
    };
    if scenario.has_other_swarms() {
        return refuse("processes fly one swarm, and the scenario has several".to_owned());
    }
    if scenario.plan.is_steered() {
        return refuse(
            "in this scenario a simulated pilot or operator ends or steers the flight".to_owned(),
        );
    }
    let unmade = (1..).zip(&scenario.faults);
    let mut unmade = unmade.filter_map(|(nth, fault)| Some((nth, twin::refuses(fault)?)));
    match unmade.next() {
        Some((nth, why)) => refuse(format!("fault {nth} can't befall a process: {why}")),
        None => Ok(()),
    }
}
