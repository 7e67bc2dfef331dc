//! UDP over the loopback interface. The contract of transports is tested with lists of peers and with a multicast group.

use std::net::{Ipv4Addr, SocketAddr, SocketAddrV4, UdpSocket};
use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::Bytes;
use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;
use muster_transport::sockets::{Config, OpenError, Reach};
use muster_transport::udp::UdpTransport;
use muster_transport::{Arrival, Destination, Event, Outcome, SendError, Transport};

use crate::suite::{DATAGRAM_MAX, Network, contract_tests};

/// Time limit for a datagram that must arrive.
const TIMEOUT: Duration = Duration::from_secs(10);

const MARKER: &[u8] = b"end marker";

fn config(id: u32, reach: Reach) -> Config {
    Config {
        id: NodeId(id),
        bind: SocketAddr::from((Ipv4Addr::LOCALHOST, 0)),
        reach,
        interface: None,
        datagram_max: DATAGRAM_MAX,
    }
}

fn open(config: Config) -> UdpTransport {
    UdpTransport::open(config, Arc::new(|| Timestamp::ZERO)).unwrap()
}

fn datagram(arrival: Option<Event>) -> Option<Arrival> {
    match arrival? {
        Event::Arrival(arrival) => Some(arrival),
        Event::Outcome(outcome) => panic!("UDP reported {outcome:?}"),
    }
}

/// Waits for the next datagram.
fn next(transport: &mut UdpTransport) -> Arrival {
    let began = Instant::now();
    loop {
        if let Some(arrival) = datagram(transport.poll_event()) {
            return arrival;
        }
        assert!(began.elapsed() < TIMEOUT, "no datagram arrives");
        std::thread::yield_now();
    }
}

struct Udp(Vec<UdpTransport>);

impl Udp {
    /// Four drones with each other's addresses.
    fn with_peers() -> Self {
        let (addresses, _held) = free_addresses();
        let end = |(id, bind): (u32, &SocketAddr)| {
            let others = addresses.iter().filter(|it| *it != bind).copied();
            open(Config {
                bind: *bind,
                ..config(id, Reach::Peers(others.collect()))
            })
        };
        Self((0..).zip(&addresses).map(end).collect())
    }

    /// Four drones in a multicast group.
    fn in_a_group() -> Self {
        let (group, _held) = free_group();
        let end = |id| {
            open(Config {
                interface: Some("lo".to_owned()),
                ..config(id, Reach::Group(group))
            })
        };
        Self((0..4).map(end).collect())
    }
}

/// Four unused loopback addresses. They and their port are derived from a port that the returned socket reserves.
pub(crate) fn free_addresses() -> ([SocketAddr; 4], UdpSocket) {
    let (port, held) = held_port();
    let [high, low] = port.to_be_bytes();
    // Avoids 127.0.0.0/16, which other programs use.
    let address = |id| SocketAddr::from(([127, high.max(1), low, id], port));
    ([1, 2, 3, 4].map(address), held)
}

fn held_port() -> (u16, UdpSocket) {
    let held = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    (held.local_addr().unwrap().port(), held)
}

/// An unused multicast group. Its address and port are derived from a port that the returned socket reserves.
pub(crate) fn free_group() -> (SocketAddrV4, UdpSocket) {
    let (port, held) = held_port();
    let [high, low] = port.to_be_bytes();
    (
        SocketAddrV4::new(Ipv4Addr::new(239, 77, high, low), port),
        held,
    )
}

impl Network for Udp {
    fn send(&mut self, from: NodeId, to: Destination, datagram: &Bytes) -> Result<(), SendError> {
        let end = usize::try_from(from.0).unwrap() % self.0.len();
        self.0[end].send(Timestamp::ZERO, from, to, datagram)
    }

    /// Each drone broadcasts a marker. Datagrams keep their order on one machine, so all earlier ones have arrived before it.
    fn arrivals(&mut self) -> Vec<Arrival> {
        for (id, end) in (0..).map(NodeId).zip(&mut self.0) {
            let marker = Bytes::from_static(MARKER);
            end.send(Timestamp::ZERO, id, Destination::Broadcast, &marker)
                .unwrap();
        }
        let mut arrivals = Vec::new();
        let others = self.0.len() - 1;
        for end in &mut self.0 {
            let mut markers = 0;
            while markers < others {
                let arrival = next(end);
                if arrival.datagram == MARKER {
                    markers += 1;
                } else {
                    arrivals.push(arrival);
                }
            }
            // Earlier datagrams at another socket may be read after the markers.
            arrivals.extend(std::iter::from_fn(|| datagram(end.poll_event())));
        }
        arrivals
    }

    fn outcomes(&mut self) -> Vec<Outcome> {
        Vec::new()
    }

    fn learn(&mut self, drone: NodeId, arrival: &Arrival, sender: NodeId) {
        let source = arrival.source.unwrap();
        self.0[drone.0 as usize].learn(sender, source);
    }
}

mod peers {
    use super::*;

    contract_tests!(Udp::with_peers());
}

mod group {
    use super::*;

    contract_tests!(Udp::in_a_group());
}

#[test]
fn unicast_to_a_learned_address_goes_to_no_other_drone() {
    let mut network = Udp::with_peers();
    let hello = Bytes::from_static(b"hello");
    let sent = network.send(NodeId(2), Destination::Broadcast, &hello);
    assert_eq!(sent, Ok(()));
    for arrival in network.arrivals() {
        network.learn(arrival.to, &arrival, NodeId(2));
    }
    let sent = network.send(NodeId(0), Destination::To(NodeId(2)), &hello);
    assert_eq!(sent, Ok(()));
    let receivers: Vec<_> = network.arrivals().iter().map(|it| it.to).collect();
    assert_eq!(receivers, [NodeId(2)]);
}

#[test]
fn too_long_incoming_datagrams_are_counted_and_dropped() {
    let mut end = open(config(0, Reach::Peers(Vec::new())));
    let sender = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let address = end.address();
    for len in [DATAGRAM_MAX + 1, 60_000, DATAGRAM_MAX] {
        sender.send_to(&vec![1; len], address).unwrap();
    }
    assert_eq!(next(&mut end).datagram.len(), DATAGRAM_MAX);
    let counters = end.counters();
    assert_eq!((counters.too_long, counters.received), (2, 1));
}

#[test]
fn flood_from_a_stranger_does_not_displace_datagrams_of_a_peer() {
    let ([own, peer, ..], _held) = free_addresses();
    let mut end = open(Config {
        bind: own,
        ..config(0, Reach::Peers(vec![peer]))
    });
    let (peer, stranger) = (
        UdpSocket::bind(peer).unwrap(),
        UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap(),
    );
    for number in 0..20_000_u32 {
        stranger.send_to(&[1; 1_000], own).unwrap();
        if number % 2_000 == 0 {
            peer.send_to(&[2], own).unwrap();
        }
    }
    let received: Vec<_> = std::iter::from_fn(|| datagram(end.poll_event())).collect();
    let of_peer = |it: &&Arrival| it.datagram[..] == [2];
    assert_eq!(received.iter().filter(of_peer).count(), 10);
    assert!(received.len() < 20_000, "the flood overflows the buffer");
    assert!(
        received.iter().take(40).any(|it| of_peer(&it)),
        "the peer is read before the flood ends"
    );
    let overflowed = end.overflowed().unwrap();
    assert_eq!(overflowed, 20_010 - received.len() as u64);
}

#[tokio::test]
async fn readiness_reports_all_sockets_and_left_over_datagrams() {
    let ([own, peer, ..], _held) = free_addresses();
    let mut end = open(Config {
        bind: own,
        ..config(0, Reach::Peers(vec![peer]))
    });
    let readiness = end.readiness().unwrap();
    let (peer, stranger) = (
        UdpSocket::bind(peer).unwrap(),
        UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap(),
    );
    for round in 0..20_u8 {
        for number in 0..3 {
            peer.send_to(&[round, 0, number], own).unwrap();
            stranger.send_to(&[round, 1, number], own).unwrap();
        }
        let mut received = Vec::new();
        while received.len() < 6 {
            // Reads one datagram, and claims that more are left.
            let one = readiness.datagrams(|| {
                received.extend(datagram(end.poll_event()));
                false
            });
            let one = tokio::time::timeout(TIMEOUT, one).await;
            one.expect("a datagram is left").unwrap();
        }
        received.sort_by(|a, b| a.datagram.cmp(&b.datagram));
        let sent = (0..2).flat_map(|from| (0..3).map(move |number| [round, from, number]));
        assert!(sent.eq(received.iter().map(|it| *it.datagram.as_array().unwrap())));
        let drained = readiness.datagrams(|| datagram(end.poll_event()).is_none());
        assert!(drained.await.unwrap(), "no datagram is left");
    }
}

#[test]
fn address_of_a_drone_can_not_be_bound_twice() {
    let ([own, peer, ..], _held) = free_addresses();
    let config = Config {
        bind: own,
        ..config(0, Reach::Peers(vec![peer]))
    };
    let _end = open(config.clone());
    let second = UdpTransport::open(config, Arc::new(|| Timestamp::ZERO));
    assert!(matches!(second, Err(OpenError::Bind { .. })), "{second:?}");
}

#[test]
fn drops_of_the_kernel_are_reported() {
    let mut end = open(config(0, Reach::Peers(Vec::new())));
    let sender = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let address = end.address();
    assert_eq!(end.overflowed(), Some(0));
    let sent: u64 = 20_000;
    for _ in 0..sent {
        sender.send_to(&[1; 1_000], address).unwrap();
    }
    let mut received = 0;
    while datagram(end.poll_event()).is_some() {
        received += 1;
    }
    assert_eq!(end.overflowed(), Some(sent - received));
    assert!(received < sent, "the buffer overflows");
}

#[test]
fn failed_sends_are_counted() {
    // There is no route from the loopback interface to this address.
    let peer = SocketAddr::from(([192, 0, 2, 1], 9));
    let mut end = open(config(0, Reach::Peers(vec![peer])));
    let frame = Bytes::from_static(b"lost");
    let sent = end.send(Timestamp::ZERO, NodeId(0), Destination::Broadcast, &frame);
    assert_eq!(sent, Ok(()));
    let counters = end.counters();
    assert_eq!((counters.sent, counters.unsent), (0, 1));
}

#[test]
fn broadcast_does_not_return_to_its_sender() {
    let mut network = Udp::in_a_group();
    let frame = Bytes::from_static(b"echo");
    let sent = network.send(NodeId(1), Destination::Broadcast, &frame);
    assert_eq!(sent, Ok(()));
    let arrivals = network.arrivals();
    assert!(arrivals.iter().all(|it| it.to != NodeId(1)));
}

#[test]
fn configuration_that_does_not_fit_the_machine_is_refused() {
    let refused = |config| {
        let opened = UdpTransport::open(config, Arc::new(|| Timestamp::ZERO));
        opened.map(drop).unwrap_err()
    };
    let no_peers = || Reach::Peers(Vec::new());
    let no_interface = Config {
        interface: Some("nosuch0".to_owned()),
        ..config(0, no_peers())
    };
    let refusal = refused(no_interface);
    assert!(matches!(refusal, OpenError::Interface { .. }), "{refusal}");
    let foreign_address = Config {
        bind: SocketAddr::from(([192, 0, 2, 1], 0)),
        ..config(0, no_peers())
    };
    let refusal = refused(foreign_address);
    assert!(matches!(refusal, OpenError::Bind { .. }), "{refusal}");
    let (group, held) = free_group();
    drop(held);
    let same_port = Config {
        bind: SocketAddr::from((Ipv4Addr::LOCALHOST, group.port())),
        ..config(0, Reach::Group(group))
    };
    let refusal = refused(same_port);
    assert!(matches!(refusal, OpenError::SamePort { .. }), "{refusal}");
}
