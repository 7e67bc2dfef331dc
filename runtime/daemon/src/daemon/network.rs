//! The drone's network, over the transport named in its file.

use std::io;
use std::net::SocketAddr;
use std::sync::Arc;

use muster_runtime::identity::RevocationList;
use muster_transport::Transport;
use muster_transport::quic::{self, Connections, QuicTransport, Stream};
use muster_transport::sockets::{Clock, Counters, OpenError};
use muster_transport::udp::{self, UdpTransport};
use tokio::sync::mpsc::Receiver;
use tokio::sync::watch;

use crate::config::{DroneConfig, TransportName};
use crate::identities::DroneIdentities;

pub(super) enum Network {
    Udp(Box<UdpTransport>),
    Quic(Box<QuicTransport>),
}

impl Network {
    /// Opens the network. `revoked` is the list in force.
    ///
    /// # Errors
    /// If it can't be opened as configured. Nothing is left open.
    pub(super) fn open(
        config: &DroneConfig,
        revoked: watch::Receiver<RevocationList>,
        clock: Clock,
    ) -> Result<Self, OpenError> {
        let network = config.network.clone();
        Ok(match config.transport {
            TransportName::Udp => Self::Udp(Box::new(UdpTransport::open(network, clock)?)),
            TransportName::Quic => {
                let identities = DroneIdentities {
                    authenticator: Arc::clone(&config.authenticator),
                    fleet: config.fleet,
                    revoked,
                };
                let config = quic::Config {
                    network,
                    swarm: config.swarm,
                    identities: Arc::new(identities),
                };
                Self::Quic(Box::new(QuicTransport::open(config, clock)?))
            }
        })
    }

    /// Starts to receive and, over QUIC, to discover other drones, for this incarnation.
    ///
    /// # Errors
    /// If the runtime can't watch the sockets.
    pub(super) fn begin(&mut self, incarnation: u32) -> io::Result<Waiting> {
        Ok(match self {
            Self::Udp(udp) => Waiting::Udp(udp.readiness()?),
            Self::Quic(quic) => Waiting::Quic(quic.start(incarnation)?),
        })
    }

    pub(super) fn address(&self) -> SocketAddr {
        match self {
            Self::Udp(udp) => udp.address(),
            Self::Quic(quic) => quic.address(),
        }
    }

    pub(super) fn counters(&self) -> Counters {
        match self {
            Self::Udp(udp) => udp.counters(),
            Self::Quic(quic) => quic.counters(),
        }
    }

    /// Datagrams or frames that were dropped because buffers were full. `None` if that is unknown.
    pub(super) fn overflowed(&self) -> Option<u64> {
        match self {
            Self::Udp(udp) => udp.overflowed(),
            Self::Quic(quic) => quic.overflowed(),
        }
    }

    /// Whether no received datagram waits.
    pub(super) const fn is_drained(&self) -> bool {
        match self {
            Self::Udp(udp) => udp.is_drained(),
            Self::Quic(_) => true,
        }
    }

    /// Counters of connections. `None` over UDP.
    pub(super) fn connections(&self) -> Option<Connections> {
        match self {
            Self::Udp(_) => None,
            Self::Quic(quic) => Some(quic.connections()),
        }
    }

    /// Operators' streams, for the first caller. `None` over UDP.
    pub(super) fn streams(&mut self) -> Option<Receiver<Stream>> {
        match self {
            Self::Udp(_) => None,
            Self::Quic(quic) => quic.streams(),
        }
    }

    /// Closes connections, if any; returns once the others know.
    pub(super) fn farewell(&self) -> impl Future<Output = ()> + use<> {
        let farewell = match self {
            Self::Udp(_) => None,
            Self::Quic(quic) => Some(quic.close()),
        };
        async {
            if let Some(farewell) = farewell {
                farewell.await;
            }
        }
    }

    /// The transport.
    pub(super) fn transport(&mut self) -> &mut dyn Transport {
        match self {
            Self::Udp(udp) => &mut **udp,
            Self::Quic(quic) => &mut **quic,
        }
    }
}

/// Waits for received datagrams.
pub(super) enum Waiting {
    Udp(udp::Readiness),
    Quic(quic::Readiness),
}

impl Waiting {
    /// Waits until datagrams may be there, then calls `drain`, which takes some and returns whether none is left. If some are
    /// left the next call returns at once.
    ///
    /// # Errors
    /// If the sockets can't be watched any more.
    pub(super) async fn datagrams(&self, mut drain: impl FnMut() -> bool) -> io::Result<bool> {
        match self {
            Self::Udp(udp) => udp.datagrams(drain).await,
            Self::Quic(quic) => {
                quic.frames().await;
                Ok(drain())
            }
        }
    }
}
