//! Frames over QUIC: one mutually authenticated connection with each other drone.
//!
//! A frame is an unreliable datagram (RFC 9221). A frame that exceeds the path's datagram size goes on its own stream. A
//! unicast frame goes over the connection with its drone; without one, to all connected drones. No outcome is reported.
//!
//! Drones find each other by a list of addresses or by signed beacons to a multicast group or broadcast address. Of two
//! simultaneous connections between two drones, one is closed. A lost connection is reopened with exponential back-off. The
//! sockets are the same as for UDP.
//!
//! An operator, who has the fleet's secret key, connects to one drone and uses streams.

mod back_off;
mod beacon;
mod discovery;
mod hub;
mod identity;
mod inbox;
mod links;
mod operator;
mod operators;
mod rate_limit;
mod stream;
mod tls;

use std::collections::BTreeMap;
use std::fmt;
use std::future::Future;
use std::io;
use std::net::{SocketAddr, UdpSocket};
use std::num::NonZeroU16;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use bytes::Bytes;
use muster_machines::identity::{NodeId, SwarmId};
use muster_machines::radio::Source;
use muster_machines::time::Timestamp;
use quinn::{Endpoint, EndpointConfig, MtuDiscoveryConfig, TokioRuntime, TransportConfig};
use tokio::sync::mpsc;
use tokio::task::JoinSet;
use tokio::time::timeout;

pub use identity::{Distrust, Identities, Peer, PublicKey};
pub use operator::{Operator, OperatorError};
pub use stream::Stream;
pub use tls::Refusal;

use self::discovery::OwnBeacons;
use self::hub::Hub;
use self::inbox::Inbox;
use self::links::{Links, OVER};
use self::operators::Operators;
use self::tls::{OPERATOR, Refusals, Trust, swarm_protocol};
use crate::sockets::{self, Clock, Counters, OpenError, Reach};
use crate::{Arrival, Destination, Event, SendError, Transport};

/// Idle timeout of a connection, and period of its keep-alives.
const IDLE_MAX: Duration = Duration::from_secs(3);
const KEEP_ALIVE: Duration = Duration::from_millis(500);

/// Initial estimate of the round trip.
const INITIAL_ROUND_TRIP: Duration = Duration::from_millis(50);

/// Upper bound of the path MTU discovery, as UDP payload in bytes: an Ethernet frame over IPv4.
const PAYLOAD_MAX: u16 = 1_472;

/// Buffers of a connection in each direction, in bytes: for datagrams, for a stream, for all streams.
const DATAGRAMS_MAX: usize = 64 * 1_024;
const STREAM_MAX: u32 = 64 * 1_024;
const STREAMS_MAX: u32 = 256 * 1_024;

/// Most streams that the peer may open: unidirectional for frames, bidirectional for operators. All are preallocated.
const FRAME_STREAMS_MAX: u32 = 16;
const OPERATOR_STREAMS_MAX: u32 = 4;

/// Most incoming connections that wait for their handshake, and the buffer for each, in bytes.
const INCOMING_MAX: usize = 64;
const INCOMING_BUFFER: u64 = 4 * 1_024;

/// Time limit for notifying peers of the end of their connections.
const CLOSE_MAX: Duration = Duration::from_millis(100);

/// Configuration of a drone's end of the network.
#[derive(Clone)]
pub struct Config {
    /// The drone and its sockets. Discovery depends on the reach: with [`Reach::Peers`] the addresses are connected to;
    /// otherwise beacons go to the group or broadcast address.
    pub network: sockets::Config,
    /// The drone's swarm. Drones of other swarms are refused.
    pub swarm: SwarmId,
    /// The drone's key, and the keys that it trusts.
    pub identities: Arc<dyn Identities>,
}

impl fmt::Debug for Config {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Config")
            .field("network", &self.network)
            .field("swarm", &self.swarm)
            .finish_non_exhaustive()
    }
}

/// Counters of connections.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Connections {
    /// Number of open connections with drones.
    pub open: usize,
    /// Number of all connections, also of those that are being opened or closed, and of those with operators.
    pub all: usize,
    /// Failed attempts to connect in both directions, by reason.
    pub refused: BTreeMap<Refusal, u64>,
    /// Beacons refused as malformed, untrusted, replayed or over the rate limit.
    pub beacons_refused: u64,
}

/// A drone's end of the network.
pub struct QuicTransport {
    config: sockets::Config,
    swarm: SwarmId,
    hub: Arc<Hub>,
    address: SocketAddr,
    /// A clone of the endpoint's socket.
    own: Arc<UdpSocket>,
    /// The socket for beacons.
    shared: Option<Arc<UdpSocket>>,
    /// Streams of operators, until [`Self::streams`] takes the channel.
    streams: Option<mpsc::Receiver<Stream>>,
    /// Background tasks; they end with this value.
    tasks: JoinSet<()>,
    counters: Counters,
}

impl fmt::Debug for QuicTransport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("QuicTransport")
            .field("config", &self.config)
            .field("counters", &self.counters)
            .finish_non_exhaustive()
    }
}

impl QuicTransport {
    /// Opens a drone's end of the network. It is silent until [`Self::start`]. Must be called within a Tokio runtime with I/O
    /// and time enabled.
    ///
    /// # Errors
    /// If a socket can't be opened as configured; none is left open then.
    pub fn open(config: Config, clock: Clock) -> Result<Self, OpenError> {
        let Config {
            network,
            swarm,
            identities,
        } = config;
        let (own, shared) = sockets::open(&network)?;
        let refusals = Arc::<Refusals>::default();
        let trust = Trust::new(Arc::clone(&identities), Arc::clone(&refusals));
        let protocol = swarm_protocol(swarm);
        let transport = Arc::new(transport_config());
        let mut server = tls::server(&trust, vec![protocol.clone(), OPERATOR.to_vec()]);
        server
            .transport_config(Arc::clone(&transport))
            .migration(false)
            .max_incoming(INCOMING_MAX)
            .incoming_buffer_size(INCOMING_BUFFER)
            .incoming_buffer_size_total(INCOMING_BUFFER * INCOMING_MAX as u64);
        let mut client = tls::client(&trust, &protocol);
        client.transport_config(transport);
        let endpoint = Endpoint::new(
            EndpointConfig::default(),
            Some(server),
            own.try_clone()?,
            Arc::new(TokioRuntime),
        )?;
        let (operators, streams) = Operators::new();
        let hub = Hub {
            id: network.id,
            protocol,
            identities,
            clock,
            endpoint,
            client,
            links: Links::default(),
            inbox: Inbox::new(network.datagram_max),
            refusals,
            beacons_refused: AtomicU64::new(0),
            operators,
        };
        Ok(Self {
            address: own.local_addr()?,
            config: network,
            swarm,
            hub: Arc::new(hub),
            own: Arc::new(own),
            shared: shared.map(Arc::new),
            streams: Some(streams),
            tasks: JoinSet::new(),
            counters: Counters::default(),
        })
    }

    /// Starts discovery and accepts connections. `incarnation` must be unique among the drone's starts. Returns a handle that
    /// waits for frames. Must be called once, within the runtime of [`Self::open`].
    ///
    /// # Errors
    /// If the runtime can't watch the sockets.
    pub fn start(&mut self, incarnation: u32) -> io::Result<Readiness> {
        let hub = &self.hub;
        match &self.config.reach {
            Reach::Peers(peers) => {
                for peer in peers {
                    let maintain = discovery::maintain_connection(Arc::clone(hub), *peer);
                    self.tasks.spawn(maintain);
                }
            }
            Reach::Group(to) | Reach::Broadcast(to) => {
                let beacons = OwnBeacons {
                    swarm: self.swarm,
                    incarnation,
                    to: (*to).into(),
                    from: self.own.try_clone()?,
                };
                if let Some(shared) = &self.shared {
                    let shared = tokio::net::UdpSocket::from_std(shared.try_clone()?)?;
                    let hub = Arc::clone(hub);
                    let receive = discovery::receive_beacons(hub, self.swarm, shared, self.address);
                    self.tasks.spawn(receive);
                }
                let send = discovery::send_beacons(Arc::clone(hub), beacons);
                self.tasks.spawn(send);
            }
        }
        self.tasks.spawn(Arc::clone(hub).accept());
        self.tasks.spawn(discovery::close_revoked(Arc::clone(hub)));
        Ok(Readiness(Arc::clone(hub)))
    }

    /// Address of the own socket.
    #[must_use]
    pub const fn address(&self) -> SocketAddr {
        self.address
    }

    /// The channel of operators' streams; `None` after the first call. Streams are dropped while its queue is full.
    pub const fn streams(&mut self) -> Option<mpsc::Receiver<Stream>> {
        self.streams.take()
    }

    /// Counters since the start, in frames.
    #[must_use]
    pub fn counters(&self) -> Counters {
        Counters {
            too_long: self.hub.inbox.too_long(),
            ..self.counters
        }
    }

    /// Number of datagrams that the kernel dropped for full socket buffers, plus frames dropped for a full queue of their
    /// sender. `None` if the kernel does not report it.
    #[must_use]
    pub fn overflowed(&self) -> Option<u64> {
        let sockets = [Some(&self.own), self.shared.as_ref()];
        let sockets: Vec<_> = sockets.into_iter().flatten().cloned().collect();
        sockets::kernel_drops(&sockets).map(|dropped| dropped + self.hub.inbox.overflowed())
    }

    /// Counters of connections since the start.
    #[must_use]
    pub fn connections(&self) -> Connections {
        Connections {
            open: self.hub.links.count(),
            all: self.hub.endpoint.open_connections(),
            refused: self.hub.refusals.all(),
            beacons_refused: self.hub.beacons_refused.load(Ordering::Relaxed),
        }
    }

    /// Closes all connections and notifies the peers. The transport is unusable afterwards.
    pub fn close(&self) -> impl Future<Output = ()> + Send + use<> {
        let endpoint = self.hub.endpoint.clone();
        async move { close_endpoint(&endpoint).await }
    }
}

/// Closes all connections and waits a moment until the peers are notified.
async fn close_endpoint(endpoint: &Endpoint) {
    let (code, reason) = OVER;
    endpoint.close(code, reason);
    // A peer that misses the notification detects the idle timeout.
    let _ = timeout(CLOSE_MAX, endpoint.wait_idle()).await;
}

impl Drop for QuicTransport {
    fn drop(&mut self) {
        let (code, reason) = OVER;
        self.hub.endpoint.close(code, reason);
    }
}

impl Transport for QuicTransport {
    fn datagram_max(&self) -> usize {
        self.config.datagram_max
    }

    fn send(
        &mut self,
        _now: Timestamp,
        from: NodeId,
        to: Destination,
        datagram: &Bytes,
    ) -> Result<(), SendError> {
        self.config.check(from, datagram)?;
        let to = match to {
            Destination::Broadcast => None,
            Destination::To(drone) => Some(drone),
        };
        let (sent, unsent) = self.hub.links.send(to, datagram);
        self.counters.sent += sent;
        self.counters.unsent += unsent;
        Ok(())
    }

    fn poll_event(&mut self) -> Option<Event> {
        let (from, datagram) = self.hub.inbox.pop()?;
        self.counters.received += 1;
        Some(Event::Arrival(Arrival {
            at: (self.hub.clock)(),
            to: self.config.id,
            datagram,
            source: Some(source_of(from)),
            peer: Some(from),
        }))
    }
}

/// The source of an authenticated drone. Each drone counts as its own host.
fn source_of(drone: NodeId) -> Source {
    let [port_high, port_low, high, low] = drone.0.to_be_bytes();
    Source {
        host: NonZeroU16::MIN.saturating_add(u16::from_be_bytes([high, low])),
        port: u16::from_be_bytes([port_high, port_low]),
    }
}

/// Waits for frames, while others use the transport.
pub struct Readiness(Arc<Hub>);

impl fmt::Debug for Readiness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Readiness").finish_non_exhaustive()
    }
}

impl Readiness {
    /// Waits until there is a received frame.
    pub async fn frames(&self) {
        self.0.inbox.wait_for_frame().await;
    }
}

fn transport_config() -> TransportConfig {
    let mut discovery = MtuDiscoveryConfig::default();
    discovery.upper_bound(PAYLOAD_MAX);
    let idle_max = IDLE_MAX.try_into().expect("3 s are less than 2^62 ms");
    let mut config = TransportConfig::default();
    config
        .max_idle_timeout(Some(idle_max))
        .keep_alive_interval(Some(KEEP_ALIVE))
        .initial_rtt(INITIAL_ROUND_TRIP)
        .mtu_discovery_config(Some(discovery))
        .max_concurrent_uni_streams(FRAME_STREAMS_MAX.into())
        .max_concurrent_bidi_streams(OPERATOR_STREAMS_MAX.into())
        .stream_receive_window(STREAM_MAX.into())
        .receive_window(STREAMS_MAX.into())
        .send_window(STREAMS_MAX.into())
        .datagram_send_buffer_size(DATAGRAMS_MAX)
        .datagram_receive_buffer_size(Some(DATAGRAMS_MAX));
    config
}
