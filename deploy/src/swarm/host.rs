//! A host on which drones fly, and the agent there that does what is to be done (see [`muster_daemon::agent`]).

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};
use std::time::Duration;

use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;
use tokio::sync::mpsc::{self, UnboundedSender};
use tokio::task::{JoinHandle, JoinSet};

use super::child::News;
use super::folder::DroneFolder;
use super::hosts::Host;
use super::link::Link;
use super::offset::ahead;
use super::{Request, SwarmError};
use muster_daemon::agent::protocol::Order;

/// How many orders may wait for a connection that does not take them. More are not given.
const WAITING_MAX: usize = 4_096;

/// An agent on a host, as its starter holds it. It ends what it started, and itself, once nobody has orders for it.
#[derive(Debug)]
pub(super) struct Agent {
    orders: mpsc::Sender<Order>,
    /// How sure its clock was when it was least so.
    attended: JoinHandle<Duration>,
    /// Whether it is on this machine, so that its clock is ours, and finds its drones' files where they are.
    is_here: bool,
    /// How far ahead of ours its clock is, in nanoseconds.
    ahead_ns: Arc<AtomicI64>,
    /// How long it takes to hear of it, and how sure its clock is.
    pub(super) lag: Duration,
}

impl Agent {
    /// Starts an agent on a host, hands it what its drones need, and hears it from then on: `news` gets what comes of them.
    ///
    /// # Errors
    /// When there is none, or another version of it, or it is lost again.
    async fn start(
        host: &Host,
        load: Load,
        news: UnboundedSender<News>,
    ) -> Result<Self, SwarmError> {
        let mut link = Link::open(host).await?;
        for (path, text) in &load.files {
            link = link.carry(path, text).await?;
        }
        let link = link.measure().await?;
        let (orders, given) = mpsc::channel(WAITING_MAX);
        let (lag, ahead_ns) = (link.lag(), link.ahead_ns());
        Ok(Self {
            orders,
            attended: tokio::spawn(link.attend(given, load.logs, news)),
            is_here: host.is_here(),
            ahead_ns,
            lag,
        })
    }

    /// Starts a drone's process with these arguments, unless the host is lost.
    pub(super) fn start_drone(
        &self,
        request: &Request<'_>,
        folder: &DroneFolder,
        arguments: &[&str],
    ) {
        let config = if self.is_here {
            request.folder.join(&folder.config)
        } else {
            folder.config.clone()
        };
        let arguments = arguments.iter().map(|it| (*it).to_owned());
        let _ = self.orders.try_send(Order::Start {
            drone: folder.id.0,
            config,
            arguments: arguments.collect(),
        });
    }

    /// What its clock says when ours does.
    pub(super) fn theirs(&self, ours: Timestamp) -> Timestamp {
        if self.is_here {
            return ours;
        }
        ahead(ours, self.ahead_ns.load(Ordering::Relaxed))
    }

    /// What is to be asked of it.
    pub(super) fn orders(&self) -> mpsc::Sender<Order> {
        self.orders.clone()
    }
}

/// What an agent is handed, and what is kept of what its drones say.
struct Load {
    /// By path, as seen from its folder; none where it finds them where they are.
    files: BTreeMap<PathBuf, String>,
    logs: BTreeMap<NodeId, File>,
}

impl Load {
    fn of(request: &Request<'_>, host: &Host, drones: &[DroneFolder]) -> Result<Self, SwarmError> {
        let (mut files, mut logs) = (BTreeMap::new(), BTreeMap::new());
        for drone in drones.iter().filter(|it| host.drones.contains_key(&it.id)) {
            let log = File::create(&drone.log).map_err(|source| SwarmError::Write {
                path: drone.log.clone(),
                source,
            })?;
            logs.insert(drone.id, log);
            for path in drone.files.iter().filter(|_| !host.is_here()) {
                let from = request.folder.join(path);
                let text = fs::read_to_string(&from)
                    .map_err(|source| SwarmError::Read { path: from, source })?;
                files.insert(path.clone(), text);
            }
        }
        Ok(Self { files, logs })
    }
}

/// Starts an agent on each host, all at once, and hands each what its drones need; in the order of the hosts. However long
/// some of them take, the others hear of their starter meanwhile.
///
/// # Errors
/// When there is none somewhere, or another version of it, or a file can't be read or written. None is left then, nor what
/// it was handed.
pub(super) async fn start_agents(
    request: &Request<'_>,
    hosts: &[Host],
    drones: &[DroneFolder],
    news: &UnboundedSender<News>,
) -> Result<Vec<Agent>, SwarmError> {
    let load = |host| Load::of(request, host, drones);
    let loads = hosts.iter().map(load).collect::<Result<Vec<_>, _>>()?;
    let mut starting = JoinSet::new();
    for (nth, (host, load)) in hosts.iter().cloned().zip(loads).enumerate() {
        let news = news.clone();
        starting.spawn(async move { (nth, Agent::start(&host, load, news).await) });
    }
    let (mut agents, mut failure) = (BTreeMap::new(), None);
    // To the last, though one has failed: what has begun is ended only by whoever has it whole.
    while let Some(started) = starting.join_next().await {
        let (nth, started) = started.expect("nobody calls it off, and it does not panic");
        match started {
            Ok(agent) => drop(agents.insert(nth, agent)),
            Err(error) => drop(failure.get_or_insert(error)),
        }
    }
    let agents = agents.into_values().collect();
    match failure {
        None => Ok(agents),
        Some(error) => {
            end_agents(agents).await;
            Err(error)
        }
    }
}

/// Ends agents and all that they started. How sure the clocks of other hosts were when they were least so; nothing if all
/// are on this machine.
pub(super) async fn end_agents(agents: Vec<Agent>) -> Option<Duration> {
    let mut ending = Vec::new();
    for agent in agents {
        // All end at once: this is their word to.
        drop(agent.orders);
        ending.push((agent.is_here, agent.attended));
    }
    let mut least_sure = None;
    for (is_here, attended) in ending {
        let uncertainty = attended.await.unwrap_or(Duration::MAX);
        if !is_here {
            least_sure = least_sure.max(Some(uncertainty));
        }
    }
    least_sure
}
