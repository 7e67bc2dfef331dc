//! QUIC, over the sockets of this machine. What every transport promises is tried with lists of peers and with beacons to a
//! multicast group on the loopback interface.

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
use muster_transport::quic::{Config, Connections, QuicTransport, Waiting};
use muster_transport::sockets::{self, Clock, Reach};
use muster_transport::{Arrival, Destination, Event, Outcome, SendError, Transport};
use tokio::runtime::{Builder, Runtime};

use self::fleet::Fleet;
use crate::suite::{DATAGRAM_MAX, Network, promises};
use crate::udp::{free_addresses, free_group};

/// How long a test waits for what must come: only a failing one does.
const PATIENCE: Duration = Duration::from_secs(20);

const SWARM: SwarmId = SwarmId(1);

fn runtime() -> Runtime {
    Builder::new_current_thread().enable_all().build().unwrap()
}

fn clock() -> Clock {
    let then = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    let (then, began) = (Timestamp::ZERO + then.unwrap(), Instant::now());
    Arc::new(move || then + began.elapsed())
}

/// One drone's end, with a runtime of its own, as on an aircraft.
struct End {
    id: NodeId,
    runtime: Runtime,
    transport: QuicTransport,
    waiting: Waiting,
}

impl End {
    fn open(config: Config, incarnation: u32) -> Self {
        let (id, runtime) = (config.network.id, runtime());
        let entered = runtime.enter();
        let mut transport = QuicTransport::open(config, clock()).unwrap();
        let waiting = transport.begin(incarnation).unwrap();
        drop(entered);
        Self {
            id,
            runtime,
            transport,
            waiting,
        }
    }

    /// Lets the end do what it has to, for a moment.
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
            Event::Outcome(outcome) => panic!("QUIC tells nothing of {outcome:?}"),
        }
    }
}

/// Lets ends do what they have to until something holds of them.
fn until(what: &str, ends: &mut [&mut End], mut holds: impl FnMut(&mut [&mut End]) -> bool) {
    let began = Instant::now();
    while !holds(ends) {
        let all: Vec<_> = ends.iter().map(|it| it.connections()).collect();
        assert!(began.elapsed() < PATIENCE, "never: {what}: {all:?}");
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

/// Where drones are that have each other's addresses; nobody else uses them while this lives.
struct Places {
    addresses: [SocketAddr; 4],
    _held: UdpSocket,
}

impl Places {
    fn free() -> Self {
        let (addresses, _held) = free_addresses();
        Self { addresses, _held }
    }

    fn of(&self, id: u32) -> SocketAddr {
        self.addresses[id as usize]
    }

    /// The end of a drone that has the addresses of these.
    fn config(&self, fleet: &Fleet, id: u32, peers: &[u32]) -> Config {
        let peers = peers.iter().map(|peer| self.of(*peer)).collect();
        config(fleet, id, self.of(id), Reach::Peers(peers))
    }

    fn open(&self, fleet: &Fleet, id: u32, peers: &[u32]) -> End {
        End::open(self.config(fleet, id, peers), 1)
    }
}

const ANY: SocketAddr = SocketAddr::new(std::net::IpAddr::V4(std::net::Ipv4Addr::UNSPECIFIED), 0);

/// Four drones, each connected with each.
struct Quic {
    ends: Vec<End>,
    _held: Places,
}

impl Quic {
    fn of(mut ends: Vec<End>, held: Places) -> Self {
        let mut all: Vec<_> = ends.iter_mut().collect();
        until("each is connected with each", &mut all, |ends| {
            ends.iter().all(|end| end.connections().open == 3)
        });
        Self { ends, _held: held }
    }

    fn with_peers() -> Self {
        let (fleet, places) = (Fleet::new(), Places::free());
        let end = |id: u32| {
            let others: Vec<_> = (0..4).filter(|peer| *peer != id).collect();
            places.open(&fleet, id, &others)
        };
        let ends = (0..4).map(end).collect();
        Self::of(ends, places)
    }

    fn with_beacons() -> Self {
        let (fleet, places) = (Fleet::new(), Places::free());
        let (group, _group_held) = free_group();
        let end = |id| End::open(config(&fleet, id, ANY, Reach::Group(group)), 1);
        let ends = (0..4).map(end).collect();
        Self::of(ends, places)
    }
}

/// What is sent behind all else: as a datagram, and on a stream.
const MARKERS: [&[u8]; 2] = [b"all before this has arrived", &[0xee; DATAGRAM_MAX]];

impl Network for Quic {
    fn send(&mut self, from: NodeId, to: Destination, datagram: &Bytes) -> Result<(), SendError> {
        let end = from.0 as usize % self.ends.len();
        (self.ends[end].transport).send(Timestamp::ZERO, from, to, datagram)
    }

    /// Each drone sends markers to all, the ways that frames go: of those that go the same way on one machine, none
    /// overtakes another.
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
        assert_eq!(arrival.peer, Some(sender), "the connection says who it is");
        let source = arrival.source.unwrap();
        self.ends[drone.0 as usize].transport.learn(sender, source);
    }
}

mod peers {
    use super::*;

    promises!(Quic::with_peers());
}

mod beacons {
    use super::*;

    promises!(Quic::with_beacons());
}

#[test]
fn what_is_for_one_drone_goes_over_the_connection_with_it_alone() {
    let mut network = Quic::with_peers();
    let frame = Bytes::from_static(b"for you alone");
    let to = Destination::To(NodeId(2));
    assert_eq!(network.send(NodeId(0), to, &frame), Ok(()));
    let receivers: Vec<_> = network.arrivals().iter().map(|it| it.to).collect();
    assert_eq!(receivers, [NodeId(2)]);
}

#[test]
fn what_comes_while_too_much_waits_is_counted_and_dropped() {
    let (fleet, places) = (Fleet::new(), Places::free());
    let (mut one, mut other) = (places.open(&fleet, 0, &[1]), places.open(&fleet, 1, &[]));
    until("connected", &mut [&mut one, &mut other], |ends| {
        ends.iter().all(|end| end.connections().open == 1)
    });
    let sent = 300;
    for _ in 0..sent {
        one.send(Destination::Broadcast, &Bytes::from_static(&[7; 100]))
            .unwrap();
    }
    let mut taken = 0;
    let mut both = [&mut one, &mut other];
    until("all was taken or dropped", &mut both, |ends| {
        let end = &mut ends[1];
        let overflowed = end.transport.overflowed().unwrap();
        if overflowed > 0 {
            taken += std::iter::from_fn(|| end.next()).count();
        }
        taken as u64 + overflowed == sent
    });
    let (sender, receiver) = (one.transport.counters(), other.transport.counters());
    assert_eq!((sender.sent, sender.unsent), (sent, 0));
    assert_eq!(receiver.received, taken as u64);
}

#[test]
fn a_drone_that_was_started_anew_is_connected_with_again() {
    let (fleet, places) = (Fleet::new(), Places::free());
    let mut one = places.open(&fleet, 0, &[1]);
    let mut other = places.open(&fleet, 1, &[0]);
    for incarnation in 2..5 {
        until("connected", &mut [&mut one, &mut other], |ends| {
            ends.iter().all(|end| end.connections().open == 1)
        });
        // Its process is gone at once, and says nothing.
        other.runtime.shutdown_background();
        drop((other.transport, other.waiting));
        other = End::open(places.config(&fleet, 1, &[0]), incarnation);
        let hello = Bytes::from_static(b"here I am again");
        until("it is heard again", &mut [&mut one, &mut other], |ends| {
            let [one, other] = ends else { unreachable!() };
            other.send(Destination::Broadcast, &hello).unwrap();
            one.next().is_some_and(|it| it.datagram == hello)
        });
        while one.next().is_some() {}
    }
}
