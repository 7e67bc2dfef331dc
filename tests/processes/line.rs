//! Drones on hosts of their own, in a line on which each hears the next ones only: no radio is emulated, frames that are
//! lost are lost on the network.

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

use super::fleet::{Fleet, MASTER, Process, replace, seen, wait_until};
use super::flights::{agreed, others, state};
use super::network::{GROUP, Network, next_to};

fn opened(waypoint: u32) -> Value {
    json!({ "Opened": { "waypoint": waypoint } })
}

/// All end as after a mission that was flown to its end.
fn end_well<'a>(drones: impl IntoIterator<Item = &'a mut Process>) {
    for drone in drones {
        assert_eq!(drone.end(), Some(0), "{:#?}", drone.missions());
        let over = json!({ "Landing": "MissionOver" });
        assert!(drone.missions().contains(&over), "{:#?}", drone.missions());
    }
}

/// The last ballot that these have obeyed, if it is the same for all.
fn leader(drones: &[&mut Process]) -> Option<Value> {
    let last = |drone: &&mut Process| drone.leader().last().cloned();
    let mut ballots = drones.iter().map(last);
    let first = ballots.next()?;
    ballots.all(|it| it == first).then_some(first)?
}

/// Likewise, if that is of an election.
fn elected(drones: &[&mut Process]) -> Option<Value> {
    leader(drones).filter(|it| it["term"].as_u64() > Some(1))
}

/// Those with these numbers.
fn part<'a>(drones: &'a mut [Process], ids: &[u32]) -> Vec<&'a mut Process> {
    let all = (0..).zip(drones);
    all.filter(|(id, _)| ids.contains(id))
        .map(|(_, drone)| drone)
        .collect()
}

/// Waits until each of these parts has elected a master, one of its own.
fn wait_for_masters(drones: &mut [Process], parts: &[&[u32]]) {
    for ids in parts {
        let what = format!("{ids:?} have elected a master");
        wait_until(&what, &mut part(drones, ids), |drones| {
            let elected = elected(drones);
            elected.is_some_and(|it| ids.iter().any(|id| it["master"] == *id))
        });
    }
}

/// Waits until all obey one and the same master.
fn wait_until_one(drones: &mut [Process]) {
    let mut all: Vec<_> = drones.iter_mut().collect();
    wait_until("all obey one", &mut all, |drones| leader(drones).is_some());
}

#[test]
fn five_hosts_in_a_line_fly_by_relaying_and_another_swarm_on_the_same_network_is_not_heeded() {
    let Some(network) = Network::line(5) else {
        return;
    };
    let [ours, theirs] = [Fleet::on_hosts(), Fleet::on_hosts()];
    for id in 0..5 {
        let own = format!("id = {id}");
        replace(&theirs.file(id), &own, &format!("{own}\nswarm = 2"));
    }
    for mut drones in [&ours, &theirs].map(|fleet| fleet.fly_on(&network)) {
        end_well(&mut drones);
        assert_eq!(agreed(&drones.iter().collect::<Vec<_>>())["master"], MASTER);
        for (drone, hops) in drones.iter().zip([2, 1, 0, 1, 2]) {
            let routes = drone.said.iter().filter_map(seen);
            let hops_of = |it: &Value| it["Routing"]["Routes"]["hops"].as_u64();
            let least = routes.filter_map(|it| hops_of(&it)).min();
            assert_eq!(least, Some(hops));
            assert!(drone.dropped("other swarm") > 0);
        }
    }
}

#[test]
fn a_line_whose_master_is_killed_is_two_parts_that_fly_on_and_one_when_they_hear_each_other() {
    let Some(network) = Network::line(5) else {
        return;
    };
    let fleet = Fleet::on_hosts();
    let mut drones = fleet.fly_on(&network);
    let master = &mut drones[MASTER as usize];
    master.wait_for_mission(&opened(1));
    master.signal("KILL");
    assert_eq!(master.end(), None);
    wait_for_masters(&mut drones, &[&[0, 1], &[3, 4]]);
    network.let_hear(|from, to| next_to(from, to) || from + to == 4);
    wait_for_masters(&mut drones, &[&[0, 1, 3, 4]]);

    let mut again = fleet.start_on(&network, MASTER, &["--fly"]);
    assert_eq!(
        again.end(),
        Some(4),
        "it is down, and its mission was not flown"
    );
    assert!(!again.missions().contains(&state("TakingOff")));
    end_well(others(&mut drones, MASTER).map(|(_, drone)| drone));
}

#[test]
fn a_master_that_stands_still_is_replaced_and_led_when_it_goes_on() {
    let Some(network) = Network::line(5) else {
        return;
    };
    let fleet = Fleet::on_hosts();
    let mut drones = fleet.fly_on(&network);
    let master = &mut drones[MASTER as usize];
    master.wait_for_mission(&opened(1));
    master.signal("STOP");
    wait_for_masters(&mut drones, &[&[0, 1], &[3, 4]]);
    drones[MASTER as usize].signal("CONT");
    wait_for_masters(&mut drones, &[&[0, 1, 2, 3, 4]]);
    end_well(&mut drones);
}

#[test]
fn a_line_that_is_cut_is_two_parts_and_one_again_however_it_was_cut() {
    let Some(network) = Network::line(5) else {
        return;
    };
    let fleet = Fleet::on_hosts();
    let mut drones = fleet.fly_on(&network);
    drones[MASTER as usize].wait_for_mission(&opened(0));
    network.let_hear(|from, to| next_to(from, to) && from.min(to) != 2);
    wait_for_masters(&mut drones, &[&[3, 4]]);
    network.let_hear(next_to);
    wait_until_one(&mut drones);

    // Drone 0 hears the others, and they don't hear it: that is no link.
    drones[0].take_in();
    let before = drones[0].leader().len();
    network.let_hear(|from, to| next_to(from, to) && (from, to) != (0, 1));
    wait_until("it leads itself", &mut part(&mut drones, &[0]), |drones| {
        let leader = drones[0].leader();
        leader.len() > before && leader.last().unwrap()["master"] == 0
    });
    network.let_hear(next_to);
    wait_until_one(&mut drones);
    end_well(&mut drones);
}

/// Somebody on the network who has recorded what others say and has the key of a drone that was captured, but no other.
struct Attacker {
    socket: UdpSocket,
    recorded: Vec<Vec<u8>>,
    captured: Ed25519Authenticator,
}

impl Attacker {
    /// Listens until so many frames were heard.
    fn listening(frames: usize, keys: &Path) -> Self {
        let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 4700)).unwrap();
        let here =
            socket.join_multicast_v4(&Ipv4Addr::new(239, 77, 0, 1), &Ipv4Addr::new(10, 77, 0, 6));
        here.unwrap();
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
            captured: Ed25519Authenticator::new(NodeId(4), key, fleet, roster, revoked).unwrap(),
        }
    }

    fn say(&self, datagram: &[u8]) {
        // The system's buffer may be full.
        let _ = self.socket.send_to(datagram, GROUP);
    }

    /// Says something at a pace at which nobody's buffers or budgets run out.
    fn say_slowly(&self, datagram: &[u8]) {
        self.say(datagram);
        std::thread::sleep(Duration::from_millis(30));
    }

    /// Says everything once more.
    fn replay(&self) {
        self.recorded.iter().for_each(|it| self.say_slowly(it));
    }

    /// Says what others said in the name of `sender`, as if it led the swarm, signed with the captured key.
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
            let mut datagram = encode_covered(&header, frame.payload, Vec::new());
            let signature = self.captured.sign(&datagram);
            datagram.extend(signature);
            self.say_slowly(&datagram);
        }
    }

    /// Says so many times anything at all, as fast as it goes.
    fn babble(&self, times: usize) {
        let mut bytes = vec![0; 1 << 20];
        File::open("/dev/urandom")
            .unwrap()
            .read_exact(&mut bytes)
            .unwrap();
        for nth in 0..times {
            let begin = nth * 7 % (bytes.len() - 1_472);
            let len = usize::from(bytes[begin]) * 5;
            self.say(&bytes[begin..begin + len]);
        }
    }
}

#[test]
fn over_lossy_links_and_whatever_a_stranger_says_the_mission_is_flown() {
    let Some(network) = Network::new(6) else {
        return;
    };
    // Between 10 and 30 % in the line; the attacker is heard by all and hears all.
    network.lose(|from, to| match (from.abs_diff(to), from.min(to)) {
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
        let attacker = Attacker::listening(50, &keys);
        attacker.replay();
        // Drone 2 leads, and there is no drone 7.
        [1, 2, 7]
            .into_iter()
            .for_each(|sender| attacker.claim_to_be(sender));
        attacker.babble(50_000);
    });
    end_well(&mut drones);
    attack.join().unwrap();
    agreed(&drones.iter().collect::<Vec<_>>());
    for drone in &drones {
        let is_false = |ballot: &Value| ballot["term"].as_u64() >= Some(1_000);
        assert!(!drone.leader().iter().any(is_false));
        for reason in ["replayed", "forged", "stranger", "other version"] {
            assert!(drone.dropped(reason) > 0, "{reason}");
        }
    }
}

#[test]
fn what_was_recorded_of_others_before_a_drone_started_again_is_not_let_in() {
    let Some(network) = Network::new(6) else {
        return;
    };
    let fleet = Fleet::on_hosts();
    let mut drones = fleet.fly_on(&network);
    let keys = fleet.path("ours");
    let (keeps_going, is_over) = mpsc::channel::<()>();
    let attack = network.run(5, move || {
        let attacker = Attacker::listening(50, &keys);
        while is_over.try_recv() == Err(TryRecvError::Empty) {
            attacker.replay();
        }
    });
    drones[MASTER as usize].wait_for_mission(&opened(1));
    drones[0].signal("KILL");
    assert_eq!(drones[0].end(), None);
    // From now on it hears nobody but the attacker.
    network.let_hear(|from, to| to != 0 || from == 5);
    let mut again = fleet.start_on(&network, 0, &[]);
    assert_eq!(again.end(), Some(4));
    let let_in = again.said.iter().filter_map(|line| line["let_in"].as_u64());
    assert_eq!(let_in.sum::<u64>(), 0);
    assert!(again.dropped("unproven") > 0);
    end_well(others(&mut drones, 0).map(|(_, drone)| drone));
    drop(keeps_going);
    attack.join().unwrap();
}

#[test]
fn an_expelled_drone_that_was_not_told_is_not_flown_with() {
    let Some(network) = Network::line(5) else {
        return;
    };
    let fleet = Fleet::on_hosts();
    let mut drones = fleet.fly_on(&network);
    drones[0].wait_for_mission(&json!({ "State": { "MovingToWaypoint": { "waypoint": 1 } } }));
    fleet.keys(&["revoke", "ours", "0"]);
    for id in [MASTER as usize, 3, 4, 1] {
        drones[id].signal("HUP");
        drones[id].wait_for("that it read its files again", |line| line["number"] == 2);
    }
    end_well(others(&mut drones, 0).map(|(_, drone)| drone));
    assert!(drones[1].dropped("revoked") > 0);
    drones[0].end();
    assert!(drones[0].missions().contains(&state("Finished")));
}
