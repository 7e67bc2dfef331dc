//! The launchers on the hosts, as the starter sees them (see [`muster_daemon::launcher`]).

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};
use std::time::Duration;

use muster_daemon::launcher::protocol::LauncherCommand;
use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;
use tokio::sync::mpsc::{self, UnboundedSender};
use tokio::task::{JoinHandle, JoinSet};

use super::folder::DroneFolder;
use super::link::HostConnection;
use super::offset::add_nanos;
use super::process::HostEvent;
use super::{Request, SwarmError};
use crate::hosts::Host;

/// Most orders that queue for a slow connection. Further orders are dropped.
const QUEUED_ORDERS_MAX: usize = 4_096;

/// The starter's handle of a launcher. The launcher ends its processes and itself once all senders of orders are dropped.
#[derive(Debug)]
pub(super) struct Launcher {
    orders: mpsc::Sender<LauncherCommand>,
    /// Runs the connection; returns the largest uncertainty of the host's clock.
    connection: JoinHandle<Duration>,
    /// Whether it runs on this machine: with the same clock, and with the drones' files in place.
    is_local: bool,
    /// How far the host's clock is ahead of ours, in nanoseconds.
    ahead_ns: Arc<AtomicI64>,
    /// Longest round trip to the host plus the uncertainty of its clock.
    pub(super) lag: Duration,
}

impl Launcher {
    /// Starts a launcher on a host, uploads its drones' files, and forwards its events to `events` from then on.
    ///
    /// # Errors
    /// If the launcher does not start, has another version, or its connection is lost.
    async fn start(
        host: &Host,
        files: HostFiles,
        events: UnboundedSender<HostEvent>,
    ) -> Result<Self, SwarmError> {
        let mut link = HostConnection::open(host).await?;
        for (path, text) in &files.uploads {
            link = link.upload(path, text).await?;
        }
        let link = link.measure_offset().await?;
        let (orders, queued) = mpsc::channel(QUEUED_ORDERS_MAX);
        let (lag, ahead_ns) = (link.lag(), link.ahead_ns());
        Ok(Self {
            orders,
            connection: tokio::spawn(link.run(queued, files.logs, events)),
            is_local: host.is_local(),
            ahead_ns,
            lag,
        })
    }

    /// Orders the start of a drone's process with these arguments. Does nothing if the host is lost.
    pub(super) fn start_drone(
        &self,
        request: &Request<'_>,
        folder: &DroneFolder,
        arguments: &[&str],
    ) {
        let config = if self.is_local {
            request.folder.join(&folder.config)
        } else {
            folder.config.clone()
        };
        let arguments = arguments.iter().map(|it| (*it).to_owned());
        let _ = self.orders.try_send(LauncherCommand::Start {
            drone: folder.id.0,
            config,
            arguments: arguments.collect(),
        });
    }

    /// Converts a time of our clock into one of the host's clock.
    pub(super) fn host_time(&self, local: Timestamp) -> Timestamp {
        if self.is_local {
            return local;
        }
        add_nanos(local, self.ahead_ns.load(Ordering::Relaxed))
    }

    /// A sender of orders to it.
    pub(super) fn orders(&self) -> mpsc::Sender<LauncherCommand> {
        self.orders.clone()
    }
}

/// The files that a host needs, and the logs of its drones on this machine.
struct HostFiles {
    /// Contents by path relative to the launcher's folder; empty on this machine.
    uploads: BTreeMap<PathBuf, String>,
    logs: BTreeMap<NodeId, File>,
}

impl HostFiles {
    /// Reads the files for a host and creates the logs.
    fn open(
        request: &Request<'_>,
        host: &Host,
        drones: &[DroneFolder],
    ) -> Result<Self, SwarmError> {
        let (mut uploads, mut logs) = (BTreeMap::new(), BTreeMap::new());
        for drone in drones.iter().filter(|it| host.drones.contains_key(&it.id)) {
            let log = File::create(&drone.log).map_err(|source| SwarmError::Write {
                path: drone.log.clone(),
                source,
            })?;
            logs.insert(drone.id, log);
            for path in drone.files.iter().filter(|_| !host.is_local()) {
                let from = request.folder.join(path);
                let text = fs::read_to_string(&from)
                    .map_err(|source| SwarmError::Read { path: from, source })?;
                uploads.insert(path.clone(), text);
            }
        }
        Ok(Self { uploads, logs })
    }
}

/// Starts a launcher on each host in parallel and uploads its files. The result is in the order of the hosts. A slow host
/// does not keep the starter from pinging the others.
///
/// # Errors
/// If a launcher does not start or has another version, or a file can't be read or written. No launcher and no uploaded
/// file is left then.
pub(super) async fn start_launchers(
    request: &Request<'_>,
    hosts: &[Host],
    drones: &[DroneFolder],
    events: &UnboundedSender<HostEvent>,
) -> Result<Vec<Launcher>, SwarmError> {
    let open = |host| HostFiles::open(request, host, drones);
    let files = hosts.iter().map(open).collect::<Result<Vec<_>, _>>()?;
    let mut starting = JoinSet::new();
    for (nth, (host, files)) in hosts.iter().cloned().zip(files).enumerate() {
        let events = events.clone();
        starting.spawn(async move { (nth, Launcher::start(&host, files, events).await) });
    }
    let (mut launchers, mut failure) = (BTreeMap::new(), None);
    // Wait for all, even after a failure: only a started launcher can be ended in order.
    while let Some(started) = starting.join_next().await {
        let (nth, started) = started.expect("the task is neither cancelled nor panics");
        match started {
            Ok(launcher) => drop(launchers.insert(nth, launcher)),
            Err(error) => drop(failure.get_or_insert(error)),
        }
    }
    let launchers = launchers.into_values().collect();
    match failure {
        None => Ok(launchers),
        Some(error) => {
            end_launchers(launchers).await;
            Err(error)
        }
    }
}

/// Ends launchers and their processes. Returns the largest clock uncertainty of the other hosts; `None` if all launchers
/// run on this machine.
pub(super) async fn end_launchers(launchers: Vec<Launcher>) -> Option<Duration> {
    let mut ending = Vec::new();
    for launcher in launchers {
        // A closed channel ends the launcher; all end in parallel.
        drop(launcher.orders);
        ending.push((launcher.is_local, launcher.connection));
    }
    let mut largest = None;
    for (is_local, connection) in ending {
        let uncertainty = connection.await.unwrap_or(Duration::MAX);
        if !is_local {
            largest = largest.max(Some(uncertainty));
        }
    }
    largest
}
