//! Refused peers, and attacks on discovery and handshakes.

use std::net::{Ipv4Addr, SocketAddr, SocketAddrV4, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Duration;

use bytes::Bytes;
use muster_machines::identity::{NodeId, SwarmId};
use muster_transport::Destination;
use muster_transport::quic::{Config, Operator, Refusal};
use muster_transport::sockets::Reach;
use socket2::{Domain, SockRef, Socket, Type};

use super::fleet::Fleet;
use super::{ANY, Addresses, End, config, free_group, until};

const TICK: Duration = Duration::from_millis(2);

/// Drone 0, and a changed drone at the address of drone 1. Each tries to connect to the other.
fn pair(fleet: &Fleet, addresses: &Addresses, change: impl FnOnce(&mut Config)) -> [End; 2] {
    let mut config = addresses.config(fleet, 1, &[0]);
    change(&mut config);
    [addresses.open(fleet, 0, &[1]), End::open(config, 1)]
}

/// Runs both ends until they have counted these refusals. No frame may pass.
fn assert_refused([one, other]: [End; 2], by_one: Refusal, by_other: Refusal) {
    let [mut one, mut other] = [one, other];
    let frame = Bytes::from_static(b"refused");
    until("refused", &mut [&mut one, &mut other], |ends| {
        for end in &mut *ends {
            end.send(Destination::Broadcast, &frame).unwrap();
            assert_eq!(end.next(), None, "no frame of a refused peer");
        }
        let refused = [ends[0].connections(), ends[1].connections()].map(|it| it.refused);
        refused[0].contains_key(&by_one) && refused[1].contains_key(&by_other)
    });
    assert_eq!(one.transport.counters().received, 0);
    assert_eq!(one.transport.counters().sent, 0, "no frame is sent to it");
}

#[test]
fn stranger_is_refused() {
    let (fleet, addresses) = (Fleet::new(), Addresses::free());
    let stranger = fleet.with_key_of(&Fleet::of(2), 1);
    let both = pair(&fleet, &addresses, |it| it.identities = stranger);
    assert_refused(both, Refusal::Stranger, Refusal::Denied);
}

#[test]
fn drones_of_two_fleets_refuse_each_other() {
    let (fleet, addresses) = (Fleet::new(), Addresses::free());
    let other_fleet = Fleet::of(2).identities(1);
    let both = pair(&fleet, &addresses, |it| it.identities = other_fleet);
    assert_refused(both, Refusal::Stranger, Refusal::Stranger);
}

#[test]
fn public_key_without_the_secret_key_is_refused() {
    let (fleet, addresses) = (Fleet::new(), Addresses::free());
    let unproven = fleet.with_public_key_only(1);
    let both = pair(&fleet, &addresses, |it| it.identities = unproven);
    assert_refused(both, Refusal::Unproven, Refusal::Denied);
}

#[test]
fn drone_of_another_swarm_is_refused() {
    let (fleet, addresses) = (Fleet::new(), Addresses::free());
    let both = pair(&fleet, &addresses, |it| it.swarm = SwarmId(2));
    assert_refused(both, Refusal::Unfinished, Refusal::Unfinished);
}

#[test]
fn revoked_drone_is_disconnected_and_refused() {
    let (fleet, addresses) = (Fleet::new(), Addresses::free());
    let [mut one, mut other] = pair(&fleet, &addresses, |_| {});
    let connected =
        |ends: &mut [&mut End], open| ends.iter().all(|end| end.connections().open == open);
    let mut both = [&mut one, &mut other];
    until("connected", &mut both, |ends| connected(ends, 1));
    fleet.revoked.lock().unwrap().insert(NodeId(1));
    until("disconnected", &mut both, |ends| connected(ends, 0));
    // Drone 1 is told only after its own handshake, so for a moment it counts a connection.
    until("refused", &mut both, |ends| {
        let counted = ends[0].connections();
        assert_eq!(counted.open, 0);
        counted.refused.contains_key(&Refusal::Revoked)
    });
}

#[test]
fn drone_is_identified_by_its_key() {
    let (fleet, addresses) = (Fleet::new(), Addresses::free());
    // A captured drone 3 claims to be drone 1, at the address of drone 1. Drone 1 has another address.
    let captured = fleet.identities(3);
    let [mut one, mut captured] = pair(&fleet, &addresses, |it| it.identities = captured);
    let mut honest = End::open(
        Config {
            identities: fleet.identities(1),
            ..addresses.config(&fleet, 2, &[0])
        },
        1,
    );
    let mut all = [&mut one, &mut captured, &mut honest];
    until("connected", &mut all, |ends| {
        ends[0].connections().open == 2
    });
    let frame = Bytes::from_static(b"for drone 1");
    (all[0].send(Destination::To(NodeId(1)), &frame)).unwrap();
    until("the frame arrives", &mut all, |ends| {
        assert_eq!(ends[1].next(), None, "the impostor gets no frame");
        ends[2].next().is_some()
    });
}

/// An attacker without a key: records and replays beacons of a group, and relays connections.
struct Attacker {
    socket: UdpSocket,
    group: SocketAddrV4,
}

impl Attacker {
    fn open(group: SocketAddrV4) -> Self {
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        socket.set_read_timeout(Some(TICK)).unwrap();
        (SockRef::from(&socket).set_multicast_if_v4(&Ipv4Addr::LOCALHOST)).unwrap();
        Self { socket, group }
    }

    /// Records the first beacon of a drone in its first incarnation.
    fn record(&self, fleet: &Fleet, id: u32) -> Vec<u8> {
        let config = config(fleet, id, ANY, Reach::Group(self.group));
        self.record_many(config, 1, 1).remove(0)
    }

    /// Records the first beacons of a drone in an incarnation.
    fn record_many(&self, config: Config, incarnation: u32, count: usize) -> Vec<Vec<u8>> {
        let tap = Socket::new(Domain::IPV4, Type::DGRAM, None).unwrap();
        tap.set_reuse_address(true).unwrap();
        tap.bind(&SocketAddr::from(self.group).into()).unwrap();
        let tap = UdpSocket::from(tap);
        (tap.join_multicast_v4(self.group.ip(), &Ipv4Addr::LOCALHOST)).unwrap();
        tap.set_read_timeout(Some(TICK)).unwrap();
        let end = End::open(config, incarnation);
        let (mut buffer, mut recorded) = ([0; 2_000], Vec::new());
        while recorded.len() < count {
            end.run();
            if let Ok(len) = tap.recv(&mut buffer) {
                recorded.push(buffer[..len].to_vec());
            }
        }
        recorded
    }

    /// Sends a beacon to the group until an end has refused this many. Returns whether the end tried to connect.
    fn attracts_connection(&self, beacon: &[u8], end: &mut End, refused: u64) -> bool {
        until("refused", &mut [end], |ends| {
            self.socket.send_to(beacon, self.group).unwrap();
            ends[0].connections().beacons_refused >= refused
        });
        let attempt = self.socket.recv(&mut [0; 2_000]);
        attempt.is_ok()
    }

    /// Relays datagrams between a victim and `other` until `stop` is set.
    fn relay(&self, other: SocketAddr, stop: &AtomicBool) {
        let forward = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        forward.set_read_timeout(Some(TICK)).unwrap();
        let (mut buffer, mut victim) = ([0; 2_000], None);
        while !stop.load(Relaxed) {
            while let Ok((len, from)) = self.socket.recv_from(&mut buffer) {
                victim = Some(from);
                forward.send_to(&buffer[..len], other).unwrap();
            }
            while let (Some(victim), Ok(len)) = (victim, forward.recv(&mut buffer)) {
                self.socket.send_to(&buffer[..len], victim).unwrap();
            }
        }
    }
}

#[test]
fn beacon_with_a_false_number_is_refused() {
    let fleet = Fleet::new();
    let (group, _held) = free_group();
    let attacker = Attacker::open(group);
    // A captured drone 3 claims to be drone 1.
    let captured = Config {
        identities: fleet.identities(3),
        ..config(&fleet, 1, ANY, Reach::Group(group))
    };
    let false_beacon = attacker.record_many(captured, 1, 1).remove(0);
    let beacon = attacker.record(&fleet, 1);
    let mut one = End::open(config(&fleet, 0, ANY, Reach::Group(group)), 1);
    assert!(!attacker.attracts_connection(&false_beacon, &mut one, 20));
    assert!(attacker.attracts_connection(&beacon, &mut one, 40));
}

#[test]
fn replayed_beacons_of_other_flights_do_not_prevent_discovery() {
    let fleet = Fleet::new();
    let (group, _held) = free_group();
    let attacker = Attacker::open(group);
    // Two incarnations of each drone: one above and one below the current incarnation.
    let mut recorded = Vec::new();
    for (id, incarnation) in [(0, 9), (1, 9), (0, 1), (1, 1)] {
        let config = config(&fleet, id, ANY, Reach::Group(group));
        recorded.extend(attacker.record_many(config, incarnation, 5));
    }
    let open = |id| End::open(config(&fleet, id, ANY, Reach::Group(group)), 5);
    let mut replayed = recorded.iter().cycle();
    let mut replay = || {
        let beacon = replayed.next().unwrap();
        attacker.socket.send_to(beacon, group).unwrap();
    };
    let mut one = open(0);
    until("all replays are received", &mut [&mut one], |ends| {
        replay();
        ends[0].connections().beacons_refused > 20
    });
    let mut other = open(1);
    let mut both = [&mut one, &mut other];
    until("they are connected", &mut both, |ends| {
        replay();
        ends.iter().all(|end| end.connections().open == 1)
    });
}

/// Sets a flag when dropped, even after a panic.
struct SetOnDrop<'a>(&'a AtomicBool);

impl Drop for SetOnDrop<'_> {
    fn drop(&mut self) {
        self.0.store(true, Relaxed);
    }
}

#[test]
fn replayed_beacon_causes_one_attempt_and_no_connection() {
    let (fleet, addresses) = (Fleet::new(), Addresses::free());
    let (group, _held) = free_group();
    let attacker = Attacker::open(group);
    let recorded = attacker.record(&fleet, 1);
    let mut one = End::open(config(&fleet, 0, ANY, Reach::Group(group)), 1);
    // A captured drone of the same fleet answers at the address of the replayed beacon.
    let captured = addresses.open(&fleet, 3, &[]);
    let stop = AtomicBool::new(false);
    std::thread::scope(|threads| {
        threads.spawn(|| {
            while !stop.load(Relaxed) {
                captured.run();
            }
        });
        threads.spawn(|| attacker.relay(addresses.of(3), &stop));
        let stop_at_end = SetOnDrop(&stop);
        let mut sent = 0;
        until("refused", &mut [&mut one], |ends| {
            attacker.socket.send_to(&recorded, group).unwrap();
            sent += 1;
            let it = ends[0].connections();
            assert_eq!(it.open, 0);
            it.refused.contains_key(&Refusal::OtherDrone) && it.beacons_refused > 10
        });
        drop(stop_at_end);
        assert!(sent > 10);
    });
    let refused = one.connections().refused;
    assert_eq!(refused.values().sum::<u64>(), 1, "one attempt: {refused:?}");
}

#[test]
fn handshake_flood_of_strangers_blocks_no_member() {
    let (fleet, addresses) = (Fleet::new(), Addresses::free());
    let mut one = addresses.open(&fleet, 0, &[]);
    let at = addresses.of(0);
    // 64 strangers that start one handshake after the other.
    let runtime = super::runtime();
    let stranger = Fleet::of(2).operator();
    for _ in 0..64 {
        let stranger = Arc::clone(&stranger);
        runtime.spawn(async move {
            loop {
                let attempt = Operator::connect(at, Arc::clone(&stranger)).await;
                assert!(attempt.is_err());
            }
        });
    }
    let (stop, stopped) = tokio::sync::oneshot::channel::<()>();
    let flood = std::thread::spawn(move || {
        let noise = UdpSocket::bind(("127.0.0.1", 0)).unwrap();
        runtime.block_on(async {
            let mut ticks = tokio::time::interval(std::time::Duration::from_micros(200));
            tokio::select! {
                _ = stopped => {}
                () = async {
                    for byte in (0..=255).cycle() {
                        ticks.tick().await;
                        noise.send_to(&[byte; 1_200], at).unwrap();
                    }
                } => {}
            }
        });
    });
    until("strangers are refused", &mut [&mut one], |ends| {
        let refused = ends[0].connections().refused;
        refused.contains_key(&Refusal::Stranger) || refused.contains_key(&Refusal::TooMany)
    });
    let mut other = addresses.open(&fleet, 1, &[0]);
    let frame = Bytes::from_static(b"member");
    let mut both = [&mut one, &mut other];
    until("a frame of the member arrives", &mut both, |ends| {
        ends[1].send(Destination::Broadcast, &frame).unwrap();
        ends[0].next().is_some_and(|it| it.datagram == frame)
    });
    stop.send(()).unwrap();
    flood.join().unwrap();
}
