//! A drone's end of the network, over whichever transport its file names.

use std::io;
use std::net::SocketAddr;
use std::sync::Arc;

use muster_transport::Transport;
use muster_transport::quic::{self, Connections, QuicTransport, Stream};
use muster_transport::sockets::{Clock, Counters, OpenError};
use muster_transport::udp::{self, UdpTransport};
use tokio::sync::mpsc::Receiver;

use crate::config::{DroneConfig, TransportName};
use crate::identities::DroneIdentities;

pub(super) enum Network {
    Udp(Box<UdpTransport>),
    Quic(Box<QuicTransport>),
}

impl Network {
    /// Opens it.
    ///
    /// # Errors
    /// When it can't be had as configured; nothing is left open then.
    pub(super) fn open(config: &DroneConfig, clock: Clock) -> Result<Self, OpenError> {
        let network = config.network.clone();
        Ok(match config.transport {
            TransportName::Udp => Self::Udp(Box::new(UdpTransport::open(network, clock)?)),
            TransportName::Quic => {
                let identities = DroneIdentities {
                    authenticator: Arc::clone(&config.authenticator),
                    fleet: config.fleet,
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

    /// Begins to hear others, and to look for them, in this life of the drone.
    ///
    /// # Errors
    /// When the runtime can't watch the sockets.
    pub(super) fn begin(&mut self, incarnation: u32) -> io::Result<Waiting> {
        Ok(match self {
            Self::Udp(udp) => Waiting::Udp(udp.waiting()?),
            Self::Quic(quic) => Waiting::Quic(quic.begin(incarnation)?),
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

    /// How many datagrams or frames were dropped for want of room, where that is known.
    pub(super) fn overflowed(&self) -> Option<u64> {
        match self {
            Self::Udp(udp) => udp.overflowed(),
            Self::Quic(quic) => quic.overflowed(),
        }
    }

    /// Whether nothing more has come in for now.
    pub(super) const fn is_drained(&self) -> bool {
        match self {
            Self::Udp(udp) => udp.is_drained(),
            Self::Quic(_) => true,
        }
    }

    /// What became of its connections, where it has any.
    pub(super) fn connections(&self) -> Option<Connections> {
        match self {
            Self::Udp(_) => None,
            Self::Quic(quic) => Some(quic.connections()),
        }
    }

    /// What operators have to say, where they can, for whoever asks first.
    pub(super) fn streams(&mut self) -> Option<Receiver<Stream>> {
        match self {
            Self::Udp(_) => None,
            Self::Quic(quic) => quic.streams(),
        }
    }

    /// Ends its connections, where it has any; returns once the others know.
    pub(super) fn farewell(&self) -> impl Future<Output = ()> + use<> {
        let farewell = match self {
            Self::Udp(_) => None,
            Self::Quic(quic) => Some(quic.farewell()),
        };
        async {
            if let Some(farewell) = farewell {
                farewell.await;
            }
        }
    }

    /// What moves frames.
    pub(super) fn transport(&mut self) -> &mut dyn Transport {
        match self {
            Self::Udp(udp) => &mut **udp,
            Self::Quic(quic) => &mut **quic,
        }
    }
}

/// Waits until something has come in.
pub(super) enum Waiting {
    Udp(udp::Waiting),
    Quic(quic::Waiting),
}

impl Waiting {
    /// Returns once something may have come in, having called `drain`, which takes some and says whether it has taken all.
    /// Until it has, the next call returns at once.
    ///
    /// # Errors
    /// When nothing will come in any more.
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
