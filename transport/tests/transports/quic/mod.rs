//! QUIC over the loopback interface. The contract of transports is tested with lists of peers and with beacons to a multicast
//! group.

mod fleet;
mod operator;
mod real_time;
mod trust;

use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};

use bytes::Bytes;
use muster_machines::identity::{NodeId, SwarmId};
use muster_machines::time::Timestamp;
use muster_transport::quic::{Config, Connections, QuicTransport, Readiness};
use muster_transport::sockets::{self, Clock, Reach};
use muster_transport::{Arrival, Destination, Event, Outcome, SendError, Transport};
use tokio::runtime::{Builder, Runtime};

use self::fleet::Fleet;
use crate::suite::{DATAGRAM_MAX, Network, contract_tests};
use crate::udp::{free_addresses, free_group};

/// Time limit for a condition that must come true. A closed connection counts for three probe timeouts more (RFC 9000, section
/// 10.2), which is 18 s after a handshake of 2 s on a busy machine.
const TIMEOUT: Duration = Duration::from_secs(60);

const SWARM: SwarmId = SwarmId(1);

fn runtime() -> Runtime {
    Builder::new_current_thread().enable_all().build().unwrap()
}

fn clock() -> Clock {
    let then = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    let (then, began) = (Timestamp::ZERO + then.unwrap(), Instant::now());
    Arc::new(move || then + began.elapsed())
}

/// One drone's end, with its own runtime as on an aircraft.
struct End {
    id: NodeId,
    runtime: Runtime,
    transport: QuicTransport,
    readiness: Readiness,
}

impl End {
    fn open(config: Config, incarnation: u32) -> Self {
        let (id, runtime) = (config.network.id, runtime());
        let entered = runtime.enter();
        let mut transport = QuicTransport::open(config, clock()).unwrap();
        let readiness = transport.start(incarnation).unwrap();
        drop(entered);
        Self {
            id,
            runtime,
            transport,
            readiness,
        }
    }

    /// Runs the end's tasks for a moment.
    fn run(&self) {
        let moment = async { tokio::time::sleep(Duration::from_micros(500)).await };
        self.runtime.block_on(moment);
    }

    fn connections(&self) -> Connections {
        self.transport.connections()
    }

    fn send(&mut self, to: Destination, datagram: &Bytes) -> Result<(), SendError> {
        self.transport.send(Timestamp::ZERO, self.id, to, datagram)
    }

    fn next(&mut self) -> Option<Arrival> {
        match self.transport.poll_event()? {
            Event::Arrival(arrival) => Some(arrival),
            Event::Outcome(outcome) => panic!("QUIC reported {outcome:?}"),
        }
    }
}

/// Runs ends until a condition holds.
fn until(condition: &str, ends: &mut [&mut End], mut holds: impl FnMut(&mut [&mut End]) -> bool) {
    let began = Instant::now();
    while !holds(ends) {
        let all: Vec<_> = ends.iter().map(|it| it.connections()).collect();
        assert!(began.elapsed() < TIMEOUT, "never: {condition}: {all:?}");
        ends.iter().for_each(|end| end.run());
    }
}

fn config(fleet: &Fleet, id: u32, bind: SocketAddr, reach: Reach) -> Config {
    let interface = matches!(reach, Reach::Group(_)).then(|| "lo".to_owned());
    Config {
        network: sockets::Config {
            id: NodeId(id),
            bind,
            reach,
            interface,
            datagram_max: DATAGRAM_MAX,
        },
        swarm: SWARM,
        identities: fleet.identities(id),
    }
}

/// Reserved addresses of four drones.
struct Addresses {
    by_id: [SocketAddr; 4],
    _held: UdpSocket,
}

impl Addresses {
    fn free() -> Self {
        let (by_id, _held) = free_addresses();
        Self { by_id, _held }
    }

    fn of(&self, id: u32) -> SocketAddr {
        self.by_id[id as usize]
    }

    /// The configuration of a drone with these peers.
    fn config(&self, fleet: &Fleet, id: u32, peers: &[u32]) -> Config {
        let peers = peers.iter().map(|peer| self.of(*peer)).collect();
        config(fleet, id, self.of(id), Reach::Peers(peers))
    }

    fn open(&self, fleet: &Fleet, id: u32, peers: &[u32]) -> End {
        End::open(self.config(fleet, id, peers), 1)
    }
}

const ANY: SocketAddr = SocketAddr::new(std::net::IpAddr::V4(std::net::Ipv4Addr::UNSPECIFIED), 0);

/// Four drones, all connected with each other.
struct Quic {
    ends: Vec<End>,
    _held: Addresses,
}

impl Quic {
    fn of(mut ends: Vec<End>, held: Addresses) -> Self {
        let mut all: Vec<_> = ends.iter_mut().collect();
        // Of two connections that both ends open at once one is closed, with what was sent on it.
        until("all are connected, once each", &mut all, |ends| {
            let mut connections = ends.iter().map(|end| end.connections());
            connections.all(|it| (it.open, it.all) == (3, 3))
        });
        Self { ends, _held: held }
    }

    fn with_peers() -> Self {
        let (fleet, addresses) = (Fleet::new(), Addresses::free());
        // One end of each pair connects, so that none connects again because both did at once.
        let end = |id: u32| addresses.open(&fleet, id, &Vec::from_iter(id + 1..4));
        let ends = (0..4).map(end).collect();
        Self::of(ends, addresses)
    }

    fn with_beacons() -> Self {
        let (fleet, addresses) = (Fleet::new(), Addresses::free());
        let (group, _group_held) = free_group();
        let end = |id| End::open(config(&fleet, id, ANY, Reach::Group(group)), 1);
        let ends = (0..4).map(end).collect();
        Self::of(ends, addresses)
    }
}

/// End markers: one that fits into a datagram, and one that needs a stream.
const MARKERS: [&[u8]; 2] = [b"end marker", &[0xee; DATAGRAM_MAX]];

impl Network for Quic {
    fn send(&mut self, from: NodeId, to: Destination, datagram: &Bytes) -> Result<(), SendError> {
        let end = from.0 as usize % self.ends.len();
        (self.ends[end].transport).send(Timestamp::ZERO, from, to, datagram)
    }

    /// Each drone broadcasts both markers. Datagrams keep their order on one machine, and so do streams.
    fn arrivals(&mut self) -> Vec<Arrival> {
        for end in &mut self.ends {
            for marker in MARKERS {
                let marker = Bytes::from_static(marker);
                end.send(Destination::Broadcast, &marker).unwrap();
            }
        }
        let mut arrivals = Vec::new();
        let mut markers = vec![0; self.ends.len()];
        let mut all: Vec<_> = self.ends.iter_mut().collect();
        until("all has arrived", &mut all, |ends| {
            for (end, markers) in ends.iter_mut().zip(&mut markers) {
                while let Some(arrival) = end.next() {
                    if MARKERS.contains(&&*arrival.datagram) {
                        *markers += 1;
                    } else {
                        arrivals.push(arrival);
                    }
                }
            }
            markers.iter().all(|it| *it == 3 * MARKERS.len())
        });
        arrivals
    }

    fn outcomes(&mut self) -> Vec<Outcome> {
        Vec::new()
    }

    fn learn(&mut self, drone: NodeId, arrival: &Arrival, sender: NodeId) {
        assert_eq!(arrival.peer, Some(sender), "the connection names the peer");
        let source = arrival.source.unwrap();
        self.ends[drone.0 as usize].transport.learn(sender, source);
    }
}

mod peers {
    use super::*;

    contract_tests!(Quic::with_peers());
}

mod beacons {
    use super::*;

    contract_tests!(Quic::with_beacons());
}

#[test]
fn unicast_uses_only_the_connection_with_its_drone() {
    let mut network = Quic::with_peers();
    let frame = Bytes::from_static(b"unicast");
    let to = Destination::To(NodeId(2));
    assert_eq!(network.send(NodeId(0), to, &frame), Ok(()));
    let receivers: Vec<_> = network.arrivals().iter().map(|it| it.to).collect();
    assert_eq!(receivers, [NodeId(2)]);
}

#[test]
fn frames_for_a_full_inbox_are_counted_and_dropped() {
    let (fleet, addresses) = (Fleet::new(), Addresses::free());
    let mut one = addresses.open(&fleet, 0, &[1]);
    let mut other = addresses.open(&fleet, 1, &[]);
    until("connected", &mut [&mut one, &mut other], |ends| {
        ends.iter().all(|end| end.connections().open == 1)
    });
    let sent = 300;
    for _ in 0..sent {
        one.send(Destination::Broadcast, &Bytes::from_static(&[7; 100]))
            .unwrap();
    }
    let mut received = 0;
    let mut both = [&mut one, &mut other];
    until("all frames are received or dropped", &mut both, |ends| {
        let end = &mut ends[1];
        let overflowed = end.transport.overflowed().unwrap();
        if overflowed > 0 {
            received += std::iter::from_fn(|| end.next()).count();
        }
        received as u64 + overflowed == sent
    });
    let (sender, receiver) = (one.transport.counters(), other.transport.counters());
    assert_eq!((sender.sent, sender.unsent), (sent, 0));
    assert_eq!(receiver.received, received as u64);
}

#[test]
fn drone_that_was_connected_by_its_peer_does_not_connect_again() {
    let (fleet, addresses) = (Fleet::new(), Addresses::free());
    let mut one = addresses.open(&fleet, 0, &[1]);
    let mut config = addresses.config(&fleet, 1, &[]);
    config.swarm = SwarmId(2);
    let mut stranger = End::open(config, 1);
    // Its next attempt is at least 0.4 s away then, and at most 0.8 s.
    until(
        "four attempts fail",
        &mut [&mut one, &mut stranger],
        |ends| ends[0].connections().refused.values().sum::<u64>() == 4,
    );
    drop(stranger);
    let mut other = addresses.open(&fleet, 1, &[0]);
    let mut both = [&mut one, &mut other];
    until("its peer connects", &mut both, |ends| {
        ends.iter().all(|end| end.connections().open == 1)
    });
    let connected = Instant::now();
    until("a second passes", &mut both, |ends| {
        assert_eq!(ends[1].connections().all, 1);
        connected.elapsed() > Duration::from_secs(1)
    });
}

#[test]
fn restarted_drone_is_reconnected() {
    let (fleet, addresses) = (Fleet::new(), Addresses::free());
    let mut one = addresses.open(&fleet, 0, &[1]);
    let mut other = addresses.open(&fleet, 1, &[0]);
    for incarnation in 2..5 {
        until("connected", &mut [&mut one, &mut other], |ends| {
            ends.iter().all(|end| end.connections().open == 1)
        });
        // Its process dies without closing its connections.
        other.runtime.shutdown_background();
        drop((other.transport, other.readiness));
        other = End::open(addresses.config(&fleet, 1, &[0]), incarnation);
        let hello = Bytes::from_static(b"restarted");
        until("its frames arrive", &mut [&mut one, &mut other], |ends| {
            let [one, other] = ends else { unreachable!() };
            other.send(Destination::Broadcast, &hello).unwrap();
            one.next().is_some_and(|it| it.datagram == hello)
        });
        while one.next().is_some() {}
    }
}
