//! A host on which drones fly, and the agent there that does what is to be done (see [`crate::agent`]).

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};
use std::time::Duration;

use muster_machines::time::Timestamp;
use tokio::sync::mpsc::{self, UnboundedSender};
use tokio::task::{JoinHandle, JoinSet};

use super::child::News;
use super::folder::DroneFolder;
use super::hosts::Host;
use super::link::Link;
use super::offset::ahead;
use super::{Request, SwarmError};
use crate::agent::words::Order;

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
    /// Hands an agent the files that its drones need. `news` gets what comes of them.
    async fn start(
        request: &Request<'_>,
        (host, mut link): (&Host, Link),
        drones: &[DroneFolder],
        news: UnboundedSender<News>,
    ) -> Result<Self, SwarmError> {
        let own = |it: &&DroneFolder| host.drones.contains_key(&it.id);
        let own: Vec<_> = drones.iter().filter(own).collect();
        let mut logs = BTreeMap::new();
        for drone in &own {
            let log = File::create(&drone.log).map_err(|source| SwarmError::Write {
                path: drone.log.clone(),
                source,
            })?;
            logs.insert(drone.id, log);
        }
        if !host.is_here() {
            let files: BTreeSet<_> = own.iter().flat_map(|it| &it.files).collect();
            for path in files {
                let from = request.folder.join(path);
                let text = fs::read_to_string(&from)
                    .map_err(|source| SwarmError::Read { path: from, source })?;
                let path = path.clone();
                link.say(&Order::Write { path, text }).await;
            }
        }
        let (orders, given) = mpsc::channel(WAITING_MAX);
        let (lag, ahead_ns) = (link.lag(), link.ahead_ns());
        Ok(Self {
            orders,
            attended: tokio::spawn(link.attend(given, logs, news)),
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

/// Starts an agent on each host, all at once, and hands it the files that its drones need; whose agent each drone's is.
///
/// # Errors
/// When there is none somewhere, or another version of it, or a file can't be read or written. None is left then.
pub(super) async fn start_agents(
    request: &Request<'_>,
    hosts: &[Host],
    drones: &[DroneFolder],
    news: &UnboundedSender<News>,
) -> Result<Vec<Agent>, SwarmError> {
    let mut opening = JoinSet::new();
    for (nth, host) in hosts.iter().cloned().enumerate() {
        opening.spawn(async move { (nth, Link::open(&host).await) });
    }
    let mut links = BTreeMap::new();
    while let Some(opened) = opening.join_next().await {
        let (nth, link) = opened.expect("nobody calls it off, and it does not panic");
        links.insert(nth, link?);
    }
    let mut agents = Vec::new();
    for (nth, link) in links {
        agents.push(Agent::start(request, (&hosts[nth], link), drones, news.clone()).await?);
    }
    Ok(agents)
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
