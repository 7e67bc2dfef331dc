//! A drone's file, as `muster swarm` and `muster deploy` write it.

use std::collections::BTreeMap;
use std::net::{SocketAddr, SocketAddrV4};
use std::path::Path;

use muster_daemon::config::{ReceiverName, StageName, TransportName};
use muster_machines::identity::NodeId;
use serde::Serialize;

use crate::hosts::{Host, Hosts, Reach};

#[derive(Serialize)]
pub(crate) struct DroneFile<'a> {
    pub(crate) scenario: &'a Path,
    pub(crate) id: u32,
    pub(crate) stage: StageName,
    pub(crate) vehicle: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) port: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) receiver: Option<ReceiverName>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) pose: Option<SocketAddr>,
    pub(crate) transport: TransportName,
    pub(crate) journal: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) flight: Option<u32>,
    pub(crate) log: LogFormat,
    pub(crate) keys: Keys,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) udp: Option<Network>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) quic: Option<Network>,
    pub(crate) observe: Option<Observe>,
}

/// Format of the drones' logs.
#[derive(Debug, Clone, Copy, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum LogFormat {
    /// For the starter, which reads reports in it.
    Json,
    /// For people.
    Human,
}

#[derive(Serialize)]
pub(crate) struct Keys {
    pub(crate) drone: String,
    pub(crate) fleet: &'static str,
    pub(crate) roster: &'static str,
    pub(crate) revoked: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) grant: Option<String>,
}

#[derive(Serialize)]
pub(crate) struct Network {
    pub(crate) bind: Option<SocketAddr>,
    pub(crate) group: Option<SocketAddrV4>,
    pub(crate) broadcast: Option<SocketAddrV4>,
    pub(crate) peers: Option<Vec<SocketAddr>>,
    pub(crate) interface: Option<String>,
}

#[derive(Serialize)]
pub(crate) struct Observe {
    pub(crate) http: SocketAddr,
}

impl Hosts {
    /// The network settings of each drone.
    pub(crate) fn networks(&self) -> BTreeMap<NodeId, Network> {
        let drones = |host: &'_ Host| host.drones.clone();
        let all: Vec<_> = self.hosts.iter().flat_map(drones).collect();
        let network = |host: &Host, id: NodeId, bind: Option<SocketAddr>| {
            let others = all.iter().filter(|(other, _)| *other != id);
            let (group, broadcast, peers) = match self.reach {
                Reach::Group(all) => (Some(all), None, None),
                Reach::Broadcast(all) => (None, Some(all), None),
                Reach::Peers => (None, None, Some(others.filter_map(|it| it.1).collect())),
            };
            Network {
                bind,
                group,
                broadcast,
                peers,
                interface: host.interface.clone(),
            }
        };
        let of_host = |host: &Host| {
            let drones = host.drones.iter();
            let drones = drones.map(|(id, bind)| (*id, network(host, *id, *bind)));
            drones.collect::<Vec<_>>()
        };
        self.hosts.iter().flat_map(of_host).collect()
    }
}
