//! Frames over QUIC: a connection with each other drone, on which both have proved to have their keys.
//!
//! A frame is a datagram (RFC 9221), which may be lost; one that is too long for that, on the way that it has to take,
//! goes on a stream of its own. A frame for one drone goes over the connection with it; where there is none, to all that
//! there are connections with. Nothing is told of what became of it.
//!
//! Drones find each other by a list of addresses or by signed beacons to all of a network. Whoever hears of another
//! connects; should both do so at once, one of the two connections is closed. A connection that is lost is opened again,
//! after waits that grow. The sockets are opened as for UDP.
//!
//! An operator, who has the fleet's own key, connects to speak with one drone over streams.

mod back_off;
mod beacon;
mod budget;
mod find;
mod hub;
mod identity;
mod inbox;
mod links;
mod operator;
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
use tokio::sync::{Semaphore, mpsc};
use tokio::task::JoinSet;
use tokio::time::timeout;

pub use identity::{Distrust, Identities, Peer, PublicKey};
pub use operator::{Operator, OperatorError};
pub use stream::Stream;
pub use tls::Refusal;

use self::find::Beacons;
use self::hub::{Hub, OPERATORS_MAX};
use self::inbox::Inbox;
use self::links::{Links, OVER};
use self::tls::{OPERATOR, Refusals, Trust, swarm_protocol};
use crate::sockets::{self, Clock, Counters, OpenError, Reach};
use crate::{Arrival, Destination, Event, SendError, Transport};

/// How long nothing may be heard over a connection before it counts as lost, and how often something is said.
const IDLE_MAX: Duration = Duration::from_secs(3);
const KEEP_ALIVE: Duration = Duration::from_millis(500);

/// How long a way there and back is thought to take before it was measured.
const FIRST_ROUND_TRIP: Duration = Duration::from_millis(50);

/// The largest UDP payload that is tried, in bytes: what an Ethernet frame carries over IPv4.
const PAYLOAD_MAX: u16 = 1_472;

/// How much of a connection may wait to be sent or taken, in bytes: of datagrams, of a stream, of all streams.
const DATAGRAMS_MAX: usize = 64 * 1_024;
const STREAM_MAX: u32 = 64 * 1_024;
const STREAMS_MAX: u32 = 256 * 1_024;

/// How many streams the other end may have open, each way and both ways. Room for all is made at once.
const FRAME_STREAMS_MAX: u32 = 16;
const OPERATOR_STREAMS_MAX: u32 = 4;

/// How many who have not proved anything yet may wait to be looked at, and how much of what they send is kept, in bytes.
const INCOMING_MAX: usize = 64;
const INCOMING_BUFFER: u64 = 4 * 1_024;

/// How long a drone takes to say that it is gone.
const FAREWELL_MAX: Duration = Duration::from_millis(100);

/// How a drone's end of the network is opened.
#[derive(Clone)]
pub struct Config {
    /// Whose it is, its sockets, and how others are found: [`Reach::Peers`] are connected with, the others are where beacons
    /// go.
    pub network: sockets::Config,
    /// Its swarm: drones of another are not connected with.
    pub swarm: SwarmId,
    /// Its key, and whom it believes.
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

/// With how many others there is a connection, and how often there was none.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Connections {
    /// With how many drones there is one.
    pub open: usize,
    /// How often there was none, by reason, whichever side began.
    pub refused: BTreeMap<Refusal, u64>,
    /// What came in among the beacons and was none, or of nobody who is believed, or heard before, or too much.
    pub beacons_refused: u64,
}

/// A drone's end of the network.
pub struct QuicTransport {
    config: sockets::Config,
    swarm: SwarmId,
    hub: Arc<Hub>,
    address: SocketAddr,
    /// The own socket once more.
    own: Arc<UdpSocket>,
    /// Where beacons come in.
    shared: Option<Arc<UdpSocket>>,
    /// What operators have to say, until somebody takes it.
    streams: Option<mpsc::Receiver<Stream>>,
    /// All that goes on meanwhile; it ends with this value.
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
    /// Opens a drone's end of the network; nobody is spoken with before [`Self::begin`]. Must be called within a runtime
    /// that drives input and time.
    ///
    /// # Errors
    /// When a socket can't be had as configured; none is left open then.
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
        let (sender, streams) = mpsc::channel(OPERATORS_MAX);
        let hub = Hub {
            id: network.id,
            protocol,
            identities,
            clock,
            endpoint,
            client,
            datagram_max: network.datagram_max,
            links: Links::default(),
            inbox: Inbox::default(),
            refusals,
            too_long: AtomicU64::new(0),
            beacons_refused: AtomicU64::new(0),
            operators: Semaphore::new(OPERATORS_MAX),
            streams: sender,
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

    /// Begins to look for others and to take connections, in this life of the drone, whose number no other one has had. What is
    /// returned tells when frames are there. To be called once, within the runtime in which this was
    /// opened.
    ///
    /// # Errors
    /// When the runtime can't watch the sockets.
    pub fn begin(&mut self, incarnation: u32) -> io::Result<Waiting> {
        let hub = &self.hub;
        match &self.config.reach {
            Reach::Peers(peers) => {
                for peer in peers {
                    self.tasks.spawn(find::keep_up_with(Arc::clone(hub), *peer));
                }
            }
            Reach::Group(all) | Reach::Broadcast(all) => {
                let beacons = Beacons {
                    swarm: self.swarm,
                    incarnation,
                    to: (*all).into(),
                    from: self.own.try_clone()?,
                };
                if let Some(shared) = &self.shared {
                    let shared = tokio::net::UdpSocket::from_std(shared.try_clone()?)?;
                    let hear = find::hear(Arc::clone(hub), self.swarm, shared, self.address);
                    self.tasks.spawn(hear);
                }
                self.tasks.spawn(find::say(Arc::clone(hub), beacons));
            }
        }
        self.tasks.spawn(Arc::clone(hub).accept());
        self.tasks.spawn(find::review(Arc::clone(hub)));
        Ok(Waiting(Arc::clone(hub)))
    }

    /// The address of its own socket.
    #[must_use]
    pub const fn address(&self) -> SocketAddr {
        self.address
    }

    /// The streams that operators open, for whoever asks first. While nobody takes them, they are refused.
    pub const fn streams(&mut self) -> Option<mpsc::Receiver<Stream>> {
        self.streams.take()
    }

    /// What it has done so far, in frames.
    #[must_use]
    pub fn counters(&self) -> Counters {
        Counters {
            too_long: self.hub.too_long.load(Ordering::Relaxed),
            ..self.counters
        }
    }

    /// How many datagrams the system has dropped because its buffers for these sockets were full, and how many frames were
    /// because too many of their sender's waited; nothing where the system does not tell.
    #[must_use]
    pub fn overflowed(&self) -> Option<u64> {
        let sockets = [Some(&self.own), self.shared.as_ref()];
        let sockets: Vec<_> = sockets.into_iter().flatten().cloned().collect();
        sockets::drops(&sockets).map(|dropped| dropped + self.hub.inbox.overflowed())
    }

    /// With how many others there is a connection, and how often there was none.
    #[must_use]
    pub fn connections(&self) -> Connections {
        Connections {
            open: self.hub.links.count(),
            refused: self.hub.refusals.all(),
            beacons_refused: self.hub.beacons_refused.load(Ordering::Relaxed),
        }
    }

    /// Closes all connections, and lets the others know; returns once they were told, or can't be. Nothing is sent or
    /// comes in any more.
    pub fn farewell(&self) -> impl Future<Output = ()> + Send + use<> {
        let endpoint = self.hub.endpoint.clone();
        async move { farewell(&endpoint).await }
    }
}

/// Closes all connections, and gives whoever is at their other ends a while to be told so.
async fn farewell(endpoint: &Endpoint) {
    let (code, why) = OVER;
    endpoint.close(code, why);
    // Whoever does not hear it notices the silence.
    let _ = timeout(FAREWELL_MAX, endpoint.wait_idle()).await;
}

impl Drop for QuicTransport {
    fn drop(&mut self) {
        let (code, why) = OVER;
        self.hub.endpoint.close(code, why);
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
        let (from, datagram) = self.hub.inbox.take()?;
        self.counters.received += 1;
        Some(Event::Arrival(Arrival {
            at: (self.hub.clock)(),
            to: self.config.id,
            datagram,
            source: Some(name(from)),
            peer: Some(from),
        }))
    }
}

/// Whom a connection is with is known, so where that leads has a name by itself, and each drone is a host.
fn name(drone: NodeId) -> Source {
    let [port_high, port_low, high, low] = drone.0.to_be_bytes();
    Source {
        host: NonZeroU16::MIN.saturating_add(u16::from_be_bytes([high, low])),
        port: u16::from_be_bytes([port_high, port_low]),
    }
}

/// Waits until frames are there, beside whoever else uses the transport.
pub struct Waiting(Arc<Hub>);

impl fmt::Debug for Waiting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Waiting").finish_non_exhaustive()
    }
}

impl Waiting {
    /// Returns once frames are there; at once while there are any.
    pub async fn frames(&self) {
        self.0.inbox.filled().await;
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
        .initial_rtt(FIRST_ROUND_TRIP)
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
