//! Drones on separate hosts in a line. No radio is emulated; the network loses the frames.

use std::fs::File;
use std::io::Read;
use std::net::{Ipv4Addr, UdpSocket};
use std::path::Path;
use std::sync::mpsc::{self, TryRecvError};
use std::time::Duration;

use muster_machines::identity::{Ballot, NodeId};
use muster_machines::radio::Authenticator;
use muster_machines::wire::{Header, decode_frame, encode_covered};
use muster_runtime::identity::{DroneKey, Ed25519Authenticator, FleetKey, RevocationList, Roster};
use serde_json::{Value, json};

use super::fleet::{Fleet, MASTER, Process, observation, replace, wait_until};
use super::flights::{common_ballot, others, state};
use super::network::{GROUP, Network, are_adjacent};

fn opened(waypoint: u32) -> Value {
    json!({ "Opened": { "waypoint": waypoint } })
}

/// Waits until all end, each with a complete mission.
fn assert_all_complete<'a>(drones: impl IntoIterator<Item = &'a mut Process>) {
    for drone in drones {
        assert_eq!(drone.end(), Some(0), "{:#?}", drone.missions());
        let over = json!({ "Landing": "MissionOver" });
        assert!(drone.missions().contains(&over), "{:#?}", drone.missions());
    }
}

/// The last ballot of these drones, if it is the same for all.
fn common_leader(drones: &[&mut Process]) -> Option<Value> {
    let last = |drone: &&mut Process| drone.ballots().last().cloned();
    let mut ballots = drones.iter().map(last);
    let first = ballots.next()?;
    ballots.all(|it| it == first).then_some(first)?
}

/// The common ballot, if it is from an election.
fn elected(drones: &[&mut Process]) -> Option<Value> {
    common_leader(drones).filter(|it| it["term"].as_u64() > Some(1))
}

/// The drones with these numbers.
fn select<'a>(drones: &'a mut [Process], ids: &[u32]) -> Vec<&'a mut Process> {
    let all = (0..).zip(drones);
    all.filter(|(id, _)| ids.contains(id))
        .map(|(_, drone)| drone)
        .collect()
}

/// Waits until each segment has elected one of its drones as master.
fn wait_for_elections(drones: &mut [Process], segments: &[&[u32]]) {
    for ids in segments {
        let condition = format!("{ids:?} have elected a master");
        wait_until(&condition, &mut select(drones, ids), |drones| {
            let elected = elected(drones);
            elected.is_some_and(|it| ids.iter().any(|id| it["master"] == *id))
        });
    }
}

/// Waits until all have the same leader.
fn wait_for_common_leader(drones: &mut [Process]) {
    let mut all: Vec<_> = drones.iter_mut().collect();
    wait_until("all have the same leader", &mut all, |drones| {
        common_leader(drones).is_some()
    });
}

#[test]
fn line_of_hosts_relays_frames_and_ignores_another_swarm() {
    let Some(network) = Network::line(5) else {
        return;
    };
    let [ours, theirs] = [Fleet::on_hosts(), Fleet::on_hosts()];
    for id in 0..5 {
        let own = format!("id = {id}");
        replace(&theirs.file(id), &own, &format!("{own}\nswarm = 2"));
    }
    for mut drones in [&ours, &theirs].map(|fleet| fleet.fly_on(&network)) {
        assert_all_complete(&mut drones);
        let ballot = common_ballot(&drones.iter().collect::<Vec<_>>());
        assert_eq!(ballot["master"], MASTER);
        for (drone, hops) in drones.iter().zip([2, 1, 0, 1, 2]) {
            let routes = drone.log.iter().filter_map(observation);
            let hops_of = |it: &Value| it["Routing"]["Routes"]["hops"].as_u64();
            let least = routes.filter_map(|it| hops_of(&it)).min();
            assert_eq!(least, Some(hops));
            assert!(drone.dropped("other swarm") > 0);
        }
    }
}

#[test]
fn line_without_master_splits_into_two_segments_that_merge_again() {
    let Some(network) = Network::line(5) else {
        return;
    };
    let fleet = Fleet::on_hosts();
    let mut drones = fleet.fly_on(&network);
    let master = &mut drones[MASTER as usize];
    master.wait_for_mission(&opened(1));
    master.signal("KILL");
    assert_eq!(master.end(), None);
    wait_for_elections(&mut drones, &[&[0, 1], &[3, 4]]);
    network.set_links(|from, to| are_adjacent(from, to) || from + to == 4);
    wait_for_elections(&mut drones, &[&[0, 1, 3, 4]]);

    let mut again = fleet.start_on(&network, MASTER, &["--fly"]);
    assert_eq!(
        again.end(),
        Some(4),
        "on the ground, with an incomplete mission"
    );
    assert!(!again.missions().contains(&state("TakingOff")));
    assert_all_complete(others(&mut drones, MASTER).map(|(_, drone)| drone));
}

#[test]
fn stopped_master_is_replaced_and_becomes_a_member() {
    let Some(network) = Network::line(5) else {
        return;
    };
    let fleet = Fleet::on_hosts();
    let mut drones = fleet.fly_on(&network);
    let master = &mut drones[MASTER as usize];
    master.wait_for_mission(&opened(1));
    master.signal("STOP");
    wait_for_elections(&mut drones, &[&[0, 1], &[3, 4]]);
    drones[MASTER as usize].signal("CONT");
    wait_for_elections(&mut drones, &[&[0, 1, 2, 3, 4]]);
    assert_all_complete(&mut drones);
}

#[test]
fn cut_line_splits_into_two_segments_and_merges_again() {
    let Some(network) = Network::line(5) else {
        return;
    };
    let fleet = Fleet::on_hosts();
    let mut drones = fleet.fly_on(&network);
    drones[MASTER as usize].wait_for_mission(&opened(0));
    network.set_links(|from, to| are_adjacent(from, to) && from.min(to) != 2);
    wait_for_elections(&mut drones, &[&[3, 4]]);
    network.set_links(are_adjacent);
    wait_for_common_leader(&mut drones);

    // Drone 0 hears the others, but they don't hear it: a one-way link does not count.
    drones[0].read_available();
    let before = drones[0].ballots().len();
    network.set_links(|from, to| are_adjacent(from, to) && (from, to) != (0, 1));
    let mut alone = select(&mut drones, &[0]);
    wait_until("drone 0 leads itself", &mut alone, |drones| {
        let ballots = drones[0].ballots();
        ballots.len() > before && ballots.last().unwrap()["master"] == 0
    });
    network.set_links(are_adjacent);
    wait_for_common_leader(&mut drones);
    assert_all_complete(&mut drones);
}

/// An attacker on the network with recorded frames and the key of one captured drone.
struct Attacker {
    socket: UdpSocket,
    recorded: Vec<Vec<u8>>,
    captured: Ed25519Authenticator,
}

impl Attacker {
    /// Records this many frames.
    fn record(frames: usize, keys: &Path) -> Self {
        let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 4700)).unwrap();
        let joined =
            socket.join_multicast_v4(&Ipv4Addr::new(239, 77, 0, 1), &Ipv4Addr::new(10, 77, 0, 6));
        joined.unwrap();
        socket.set_multicast_loop_v4(false).unwrap();
        socket
            .set_read_timeout(Some(Duration::from_secs(60)))
            .unwrap();
        let record = |_| {
            let mut buffer = vec![0; 2_048];
            let len = socket.recv(&mut buffer).unwrap();
            buffer.truncate(len);
            buffer
        };
        let recorded = (0..frames).map(record).collect();
        let fleet = FleetKey::load(&keys.join("fleet.pub")).unwrap();
        let roster = Roster::load(&keys.join("roster.toml"), &fleet).unwrap();
        let revoked = RevocationList::load(&keys.join("revoked.toml"), &fleet).unwrap();
        let key = DroneKey::load(&keys.join("drone-4.key")).unwrap();
        Self {
            socket,
            recorded,
            captured: Ed25519Authenticator::new(NodeId(4), key, fleet, roster, &revoked).unwrap(),
        }
    }

    fn send(&self, datagram: &[u8]) {
        // The kernel's buffer may be full.
        let _ = self.socket.send_to(datagram, GROUP);
    }

    /// Sends a datagram at a rate within the buffers and rate limits of the drones.
    fn send_slowly(&self, datagram: &[u8]) {
        self.send(datagram);
        std::thread::sleep(Duration::from_millis(30));
    }

    /// Replays all recorded frames.
    fn replay(&self) {
        self.recorded.iter().for_each(|it| self.send_slowly(it));
    }

    /// Sends recorded payloads in the name of `sender` as leader, signed with the captured key.
    fn claim_to_be(&self, sender: u32) {
        for recorded in &self.recorded[..20] {
            let frame = decode_frame(recorded).unwrap();
            let (term, rank, master) = (1_000, 0, NodeId(sender));
            let header = Header {
                sender: NodeId(sender),
                counter: frame.header.counter + 1_000_000,
                ballot: Ballot { term, rank, master },
                ..frame.header
            };
            let mut datagram = encode_covered(&header, frame.payload);
            let signature = self.captured.sign(&datagram);
            datagram.extend(signature);
            self.send_slowly(&datagram);
        }
    }

    /// Sends random datagrams at full rate.
    fn send_noise(&self, datagrams: usize) {
        let mut bytes = vec![0; 1 << 20];
        File::open("/dev/urandom")
            .unwrap()
            .read_exact(&mut bytes)
            .unwrap();
        for nth in 0..datagrams {
            let start = nth * 7 % (bytes.len() - 1_472);
            let len = usize::from(bytes[start]) * 5;
            self.send(&bytes[start..start + len]);
        }
    }
}

#[test]
fn mission_completes_over_lossy_links_despite_an_attacker() {
    let Some(network) = Network::new(6) else {
        return;
    };
    // Losses of 10 to 30 % in the line. The attacker has lossless links to all.
    network.set_losses(|from, to| match (from.abs_diff(to), from.min(to)) {
        _ if from == 5 || to == 5 => 0,
        (1, 0) => 10,
        (1, 3) => 30,
        (1, _) => 20,
        _ => 100,
    });
    let fleet = Fleet::on_hosts();
    let mut drones = fleet.fly_on(&network);
    let keys = fleet.path("ours");
    let attack = network.run(5, move || {
        let attacker = Attacker::record(50, &keys);
        attacker.replay();
        // Drone 2 leads, and drone 7 does not exist.
        [1, 2, 7]
            .into_iter()
            .for_each(|sender| attacker.claim_to_be(sender));
        // A busy drone may have lost some of the first ones.
        attacker.replay();
        attacker.send_noise(50_000);
    });
    assert_all_complete(&mut drones);
    attack.join().unwrap();
    common_ballot(&drones.iter().collect::<Vec<_>>());
    for drone in &drones {
        let is_false = |ballot: &Value| ballot["term"].as_u64() >= Some(1_000);
        assert!(!drone.ballots().iter().any(is_false));
        for reason in ["replayed", "forged", "stranger", "other version"] {
            assert!(drone.dropped(reason) > 0, "{reason}");
        }
    }
}

#[test]
fn frames_recorded_before_a_restart_in_flight_are_dropped() {
    let Some(network) = Network::new(6) else {
        return;
    };
    let fleet = Fleet::on_hosts();
    let mut drones = fleet.fly_on(&network);
    let keys = fleet.path("ours");
    let (keep_running, stop) = mpsc::channel::<()>();
    let attack = network.run(5, move || {
        let attacker = Attacker::record(50, &keys);
        while stop.try_recv() == Err(TryRecvError::Empty) {
            attacker.replay();
        }
    });
    drones[MASTER as usize].wait_for_mission(&opened(1));
    drones[0].signal("KILL");
    assert_eq!(drones[0].end(), None);
    // From now on it hears only the attacker.
    network.set_links(|from, to| to != 0 || from == 5);
    let mut again = fleet.start_on(&network, 0, &[]);
    assert_eq!(again.end(), Some(4));
    let let_in = again.log.iter().filter_map(|line| line["let_in"].as_u64());
    assert_eq!(let_in.sum::<u64>(), 0);
    assert!(again.dropped("unproven") > 0);
    assert_all_complete(others(&mut drones, 0).map(|(_, drone)| drone));
    drop(keep_running);
    attack.join().unwrap();
}

#[test]
fn swarm_continues_without_a_revoked_drone_that_does_not_know_it() {
    let Some(network) = Network::line(5) else {
        return;
    };
    let fleet = Fleet::on_hosts();
    let mut drones = fleet.fly_on(&network);
    drones[0].wait_for_mission(&json!({ "State": { "MovingToWaypoint": { "waypoint": 1 } } }));
    fleet.keys(&["revoke", "ours", "0"]);
    for id in [MASTER as usize, 3, 4, 1] {
        drones[id].signal("HUP");
        drones[id].wait_for("files reloaded", |line| line["number"] == 2);
    }
    assert_all_complete(others(&mut drones, 0).map(|(_, drone)| drone));
    assert!(drones[1].dropped("revoked") > 0);
    drones[0].end();
    assert!(drones[0].missions().contains(&state("Finished")));
}
