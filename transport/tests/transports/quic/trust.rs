//! Who is not connected with, and what that costs those who are.

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
use super::{ANY, End, Places, config, free_group, until};

const TICK: Duration = Duration::from_millis(2);

/// Drone 0, and somebody else at the place of drone 1, each of whom tries to connect with the other.
fn meet(fleet: &Fleet, places: &Places, other: impl FnOnce(&mut Config)) -> [End; 2] {
    let mut config = places.config(fleet, 1, &[0]);
    other(&mut config);
    [places.open(fleet, 0, &[1]), End::open(config, 1)]
}

/// Tries for as long as it takes until both have been refused so and so, and none was ever connected.
fn is_refused([one, other]: [End; 2], by_one: Refusal, by_other: Refusal) {
    let [mut one, mut other] = [one, other];
    let frame = Bytes::from_static(b"let me in");
    until("refused", &mut [&mut one, &mut other], |ends| {
        for end in &mut *ends {
            end.send(Destination::Broadcast, &frame).unwrap();
            assert_eq!(end.next(), None, "nothing is taken from who is refused");
        }
        let refused = [ends[0].connections(), ends[1].connections()].map(|it| it.refused);
        refused[0].contains_key(&by_one) && refused[1].contains_key(&by_other)
    });
    assert_eq!(one.transport.counters().received, 0);
    assert_eq!(one.transport.counters().sent, 0, "nothing is told to them");
}

#[test]
fn a_stranger_is_not_connected_with() {
    let (fleet, places) = (Fleet::new(), Places::free());
    let strange = fleet.with_key_of(&Fleet::of(2), 1);
    let both = meet(&fleet, &places, |it| it.identities = strange);
    is_refused(both, Refusal::Stranger, Refusal::Denied);
}

#[test]
fn drones_of_two_fleets_do_not_believe_each_other() {
    let (fleet, places) = (Fleet::new(), Places::free());
    let theirs = Fleet::of(2).identities(1);
    let both = meet(&fleet, &places, |it| it.identities = theirs);
    is_refused(both, Refusal::Stranger, Refusal::Stranger);
}

#[test]
fn who_shows_a_drones_public_key_and_has_not_its_secret_one_is_not_connected_with() {
    let (fleet, places) = (Fleet::new(), Places::free());
    let claimed = fleet.with_public_key_only(1);
    let both = meet(&fleet, &places, |it| it.identities = claimed);
    is_refused(both, Refusal::Unproven, Refusal::Denied);
}

#[test]
fn a_drone_of_another_swarm_is_not_connected_with() {
    let (fleet, places) = (Fleet::new(), Places::free());
    let both = meet(&fleet, &places, |it| it.swarm = SwarmId(2));
    is_refused(both, Refusal::Unfinished, Refusal::Unfinished);
}

#[test]
fn an_expelled_drone_loses_its_connections_and_gets_none_again() {
    let (fleet, places) = (Fleet::new(), Places::free());
    let [mut one, mut other] = meet(&fleet, &places, |_| {});
    let connected =
        |ends: &mut [&mut End], open| ends.iter().all(|end| end.connections().open == open);
    let mut both = [&mut one, &mut other];
    until("connected", &mut both, |ends| connected(ends, 1));
    fleet.revoked.lock().unwrap().insert(NodeId(1));
    until("disconnected", &mut both, |ends| connected(ends, 0));
    until("refused since", &mut both, |ends| {
        assert!(connected(ends, 0));
        ends[0]
            .connections()
            .refused
            .contains_key(&Refusal::RevocationList)
    });
}

#[test]
fn a_drone_is_who_its_key_says_whatever_it_claims() {
    let (fleet, places) = (Fleet::new(), Places::free());
    // A captured drone 3 calls itself 1, at the place of 1, while drone 1 is elsewhere.
    let captured = fleet.identities(3);
    let [mut one, mut captured] = meet(&fleet, &places, |it| it.identities = captured);
    let mut honest = End::open(
        Config {
            identities: fleet.identities(1),
            ..places.config(&fleet, 2, &[0])
        },
        1,
    );
    let mut all = [&mut one, &mut captured, &mut honest];
    until("connected", &mut all, |ends| {
        ends[0].connections().open == 2
    });
    let frame = Bytes::from_static(b"for drone 1");
    (all[0].send(Destination::To(NodeId(1)), &frame)).unwrap();
    until("it arrives", &mut all, |ends| {
        assert_eq!(ends[1].next(), None, "it is not for who claims to be 1");
        ends[2].next().is_some()
    });
}

/// Somebody without a key, who hears what a group hears, says it again, and passes on whatever it is told to and by another.
struct Relay {
    socket: UdpSocket,
    group: SocketAddrV4,
}

impl Relay {
    fn open(group: SocketAddrV4) -> Self {
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        socket.set_read_timeout(Some(TICK)).unwrap();
        (SockRef::from(&socket).set_multicast_if_v4(&Ipv4Addr::LOCALHOST)).unwrap();
        Self { socket, group }
    }

    /// The first that a drone says in the group, in the first of its lives.
    fn record(&self, fleet: &Fleet, id: u32) -> Vec<u8> {
        let config = config(fleet, id, ANY, Reach::Group(self.group));
        self.record_of(config, 1, 1).remove(0)
    }

    /// So much of what a drone says in the group in one of its lives.
    fn record_of(&self, config: Config, incarnation: u32, beacons: usize) -> Vec<Vec<u8>> {
        let tap = Socket::new(Domain::IPV4, Type::DGRAM, None).unwrap();
        tap.set_reuse_address(true).unwrap();
        tap.bind(&SocketAddr::from(self.group).into()).unwrap();
        let tap = UdpSocket::from(tap);
        (tap.join_multicast_v4(self.group.ip(), &Ipv4Addr::LOCALHOST)).unwrap();
        tap.set_read_timeout(Some(TICK)).unwrap();
        let end = End::open(config, incarnation);
        let (mut buffer, mut heard) = ([0; 2_000], Vec::new());
        while heard.len() < beacons {
            end.run();
            if let Ok(len) = tap.recv(&mut buffer) {
                heard.push(buffer[..len].to_vec());
            }
        }
        heard
    }

    /// Says something to the group until an end has refused so many beacons; whether anybody has tried to connect.
    fn is_connected_with(&self, said: &[u8], end: &mut End, refused: u64) -> bool {
        until("refused", &mut [end], |ends| {
            self.socket.send_to(said, self.group).unwrap();
            ends[0].connections().beacons_refused >= refused
        });
        let tried = self.socket.recv(&mut [0; 2_000]);
        tried.is_ok()
    }

    /// Passes on to `other` what comes here, and back what that answers, until it is told to stop.
    fn pass_on(&self, other: SocketAddr, is_over: &AtomicBool) {
        let onward = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        onward.set_read_timeout(Some(TICK)).unwrap();
        let (mut buffer, mut victim) = ([0; 2_000], None);
        while !is_over.load(Relaxed) {
            while let Ok((len, from)) = self.socket.recv_from(&mut buffer) {
                victim = Some(from);
                onward.send_to(&buffer[..len], other).unwrap();
            }
            while let (Some(victim), Ok(len)) = (victim, onward.recv(&mut buffer)) {
                self.socket.send_to(&buffer[..len], victim).unwrap();
            }
        }
    }
}

#[test]
fn a_beacon_in_anothers_name_leads_nowhere() {
    let fleet = Fleet::new();
    let (group, _held) = free_group();
    let relay = Relay::open(group);
    // A captured drone 3 calls itself 1.
    let captured = Config {
        identities: fleet.identities(3),
        ..config(&fleet, 1, ANY, Reach::Group(group))
    };
    let false_beacon = relay.record_of(captured, 1, 1).remove(0);
    let beacon = relay.record(&fleet, 1);
    let mut one = End::open(config(&fleet, 0, ANY, Reach::Group(group)), 1);
    assert!(!relay.is_connected_with(&false_beacon, &mut one, 20));
    assert!(relay.is_connected_with(&beacon, &mut one, 40));
}

#[test]
fn beacons_that_were_recorded_on_other_flights_keep_no_drones_from_finding_each_other() {
    let fleet = Fleet::new();
    let (group, _held) = free_group();
    let relay = Relay::open(group);
    // Of two lives of each, one numbered higher and one lower than those that come.
    let mut recorded = Vec::new();
    for (id, incarnation) in [(0, 9), (1, 9), (0, 1), (1, 1)] {
        let config = config(&fleet, id, ANY, Reach::Group(group));
        recorded.extend(relay.record_of(config, incarnation, 5));
    }
    let open = |id| End::open(config(&fleet, id, ANY, Reach::Group(group)), 5);
    let mut again = recorded.iter().cycle();
    let mut one = open(0);
    until("it has heard all of that", &mut [&mut one], |ends| {
        relay.socket.send_to(again.next().unwrap(), group).unwrap();
        ends[0].connections().beacons_refused > 20
    });
    let mut other = open(1);
    let mut both = [&mut one, &mut other];
    until("they find each other", &mut both, |ends| {
        relay.socket.send_to(again.next().unwrap(), group).unwrap();
        ends.iter().all(|end| end.connections().open == 1)
    });
}

/// Says that it is over when it goes, even by a failure.
struct Over<'a>(&'a AtomicBool);

impl Drop for Over<'_> {
    fn drop(&mut self) {
        self.0.store(true, Relaxed);
    }
}

#[test]
fn a_recorded_beacon_leads_once_to_whoever_said_it_again_and_not_to_a_connection() {
    let (fleet, places) = (Fleet::new(), Places::free());
    let (group, _held) = free_group();
    let relay = Relay::open(group);
    let recorded = relay.record(&fleet, 1);
    let mut one = End::open(config(&fleet, 0, ANY, Reach::Group(group)), 1);
    // A captured drone of the very fleet answers where drone 1 seems to be.
    let captured = places.open(&fleet, 3, &[]);
    let is_over = AtomicBool::new(false);
    std::thread::scope(|threads| {
        threads.spawn(|| {
            while !is_over.load(Relaxed) {
                captured.run();
            }
        });
        threads.spawn(|| relay.pass_on(places.of(3), &is_over));
        let over = Over(&is_over);
        let mut said = 0;
        until("refused", &mut [&mut one], |ends| {
            relay.socket.send_to(&recorded, group).unwrap();
            said += 1;
            let it = ends[0].connections();
            assert_eq!(it.open, 0);
            it.refused.contains_key(&Refusal::OtherDrone) && it.beacons_refused > 10
        });
        drop(over);
        assert!(said > 10);
    });
    let refused = one.connections().refused;
    assert_eq!(refused.values().sum::<u64>(), 1, "one attempt: {refused:?}");
}

#[test]
fn strangers_who_knock_without_end_keep_nobody_out() {
    let (fleet, places) = (Fleet::new(), Places::free());
    let mut one = places.open(&fleet, 0, &[]);
    let at = places.of(0);
    // Each begins a handshake after the other, and proves nothing.
    let stranger = super::runtime();
    let strange = Fleet::of(2).operator();
    for _ in 0..64 {
        let strange = Arc::clone(&strange);
        stranger.spawn(async move {
            loop {
                let knocked = Operator::connect(at, Arc::clone(&strange)).await;
                assert!(knocked.is_err());
            }
        });
    }
    let (stop, stopped) = tokio::sync::oneshot::channel::<()>();
    let knocking = std::thread::spawn(move || {
        let noise = UdpSocket::bind(("127.0.0.1", 0)).unwrap();
        stranger.block_on(async {
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
    until("they are refused", &mut [&mut one], |ends| {
        let refused = ends[0].connections().refused;
        refused.contains_key(&Refusal::Stranger) || refused.contains_key(&Refusal::TooMany)
    });
    let mut other = places.open(&fleet, 1, &[0]);
    let frame = Bytes::from_static(b"I belong here");
    until(
        "who belongs here is heard",
        &mut [&mut one, &mut other],
        |ends| {
            ends[1].send(Destination::Broadcast, &frame).unwrap();
            ends[0].next().is_some_and(|it| it.datagram == frame)
        },
    );
    stop.send(()).unwrap();
    knocking.join().unwrap();
}
