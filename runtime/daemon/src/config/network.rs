//! The sockets of a drone's file, and the addresses of the other drones.

use std::net::{Ipv4Addr, SocketAddr};

use muster_machines::identity::NodeId;
use muster_machines::wire;
use muster_runtime::diagnostic::BadInput;
use muster_runtime::schema::Located;
use muster_transport::sockets::{self, Reach};

use super::drone_file::Network;
use super::{File, TransportName};

/// The most peers of a drone.
const PEERS_MAX: usize = 1_000;

impl File {
    /// The table of the chosen transport. The other transport's table is ignored.
    pub(super) fn network(&self, id: NodeId) -> Result<sockets::Config, BadInput> {
        let transport = &self.0.raw.transport;
        let (table, name) = match transport.get_ref() {
            TransportName::Udp => (&self.0.raw.udp, "udp"),
            TransportName::Quic => (&self.0.raw.quic, "quic"),
        };
        let Some(network) = table else {
            let message = format!(
                "the transport \"{name}\" needs a table `[{name}]` with the addresses of other drones"
            );
            return Err(self.0.error(transport.span(), &message));
        };
        let reach = self.reach(network)?;
        let network = network.get_ref();
        let bind = network.bind.as_ref().map(|it| *it.get_ref());
        let bind = bind.unwrap_or(SocketAddr::from((Ipv4Addr::UNSPECIFIED, 0)));
        if let Reach::Group(all) | Reach::Broadcast(all) = reach
            && let Some(own) = &network.bind
        {
            if own.get_ref().port() == all.port() {
                let message = "`bind` needs another port than the group or broadcast address";
                return Err(self.0.error(own.span(), message));
            }
            if !own.get_ref().is_ipv4() {
                let message = "`bind` needs an IPv4 address: groups and broadcasts are IPv4 only";
                return Err(self.0.error(own.span(), message));
            }
        }
        Ok(sockets::Config {
            id,
            bind,
            reach,
            interface: network.interface.clone(),
            datagram_max: wire::DATAGRAM_MAX,
        })
    }

    fn reach(&self, network: &Located<Network>) -> Result<Reach, BadInput> {
        let Network {
            bind,
            group,
            broadcast,
            peers,
            ..
        } = network.get_ref();
        let has_other_family = |peer: &SocketAddr| {
            bind.as_ref()
                .is_some_and(|bind| bind.get_ref().is_ipv4() != peer.is_ipv4())
        };
        match (group, broadcast, peers) {
            (Some(all), None, None) | (None, Some(all), None) if all.get_ref().port() == 0 => {
                Err(self
                    .0
                    .error(all.span(), "needs a fixed port (1–65535), found 0"))
            }
            (Some(group), None, None) if group.get_ref().ip().is_multicast() => {
                Ok(Reach::Group(*group.get_ref()))
            }
            (Some(group), None, None) => {
                let message = "not a multicast group (224.0.0.0 to 239.255.255.255)";
                Err(self.0.error(group.span(), message))
            }
            (None, Some(broadcast), None) => Ok(Reach::Broadcast(*broadcast.get_ref())),
            (None, None, Some(peers)) if peers.get_ref().len() > PEERS_MAX => Err(self.0.error(
                peers.span(),
                &format!(
                    "{} peers are too many; at most {PEERS_MAX} are accepted",
                    peers.get_ref().len()
                ),
            )),
            (None, None, Some(peers)) if bind.is_none() => {
                let message = "`peers` needs `bind`: the other drones send to that address";
                Err(self.0.error(peers.span(), message))
            }
            (None, None, Some(peers)) if peers.get_ref().iter().any(has_other_family) => {
                let message = "`peers` and `bind` need the same address family, IPv4 or IPv6";
                Err(self.0.error(peers.span(), message))
            }
            (None, None, Some(peers)) => Ok(Reach::Peers(peers.get_ref().clone())),
            _ => {
                let message = "the table needs exactly one of `group`, `broadcast` and `peers`";
                Err(self.0.error(network.span(), message))
            }
        }
    }
}
