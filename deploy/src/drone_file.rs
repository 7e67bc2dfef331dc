//! What the drones' files of a fleet or a swarm have in common.

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::path::PathBuf;

use muster_daemon::config::{Keys, Network, TransportName};
use muster_machines::identity::NodeId;
use muster_runtime::schema::Located;

use crate::hosts::{Host, Hosts, Reach};

/// The keys of a drone, in a folder that has all of them.
pub(crate) fn keys(folder: &str, drone: &str, grant: Option<PathBuf>) -> Keys {
    let file = |name: &str| PathBuf::from(folder).join(name);
    Keys {
        drone: file(drone).into(),
        fleet: file("fleet.pub"),
        roster: file("roster.toml"),
        revoked: file("revoked.toml"),
        grant: grant.map(Into::into),
    }
}

/// The tables `[udp]` and `[quic]`: that of the transport.
pub(crate) fn tables(transport: TransportName, network: Network) -> [Option<Located<Network>>; 2] {
    match transport {
        TransportName::Udp => [Some(network.into()), None],
        TransportName::Quic => [None, Some(network.into())],
    }
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
                Reach::Peers => (
                    None,
                    None,
                    Some(others.filter_map(|it| it.1).collect::<Vec<_>>()),
                ),
            };
            Network {
                bind: bind.map(Into::into),
                group: group.map(Into::into),
                broadcast: broadcast.map(Into::into),
                peers: peers.map(Into::into),
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
