//! Who is believed: recorded frames, forged ones, and lists of the expelled that drones pass on.

use std::fs;
use std::net::{Ipv4Addr, UdpSocket};
use std::process::Command;
use std::time::{Duration, Instant};

use muster_machines::wire::{self, AUTHENTICATOR_LEN, Header};
use serde_json::{Value, json};

use super::fleet::{Fleet, MASTER, Process, replace};

/// How long a test waits for what must come; only a failing one does.
const PATIENCE: Duration = Duration::from_secs(60);

/// Somebody who has no key, and hears what a drone says to all.
fn stranger(fleet: &Fleet, overhears: u32) -> UdpSocket {
    let stranger = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    stranger.set_read_timeout(Some(PATIENCE)).unwrap();
    let address = stranger.local_addr().unwrap();
    let peers = format!("peers = [\"{address}\", ");
    replace(&fleet.file(overhears), "peers = [", &peers);
    stranger
}

/// The next so many frames that are overheard and for the routing; what radios say to each other is left out.
fn record(stranger: &UdpSocket, frames: usize) -> Vec<Vec<u8>> {
    let mut buffer = [0; wire::DATAGRAM_MAX];
    let overheard = std::iter::from_fn(|| {
        let len = stranger.recv(&mut buffer).unwrap();
        Some(buffer[..len].to_vec())
    });
    let is_for_routing = |frame: &Vec<u8>| {
        let payload = wire::decode_frame(frame).unwrap().payload;
        wire::decode_radio_packet(payload).is_none()
    };
    overheard.filter(is_for_routing).take(frames).collect()
}

/// What a drone has counted by now of the frames that it dropped, by reason.
fn dropped(drone: &mut Process) -> Vec<(String, usize)> {
    let is_counted = |line: &&Value| line["message"] == "counted";
    let before = drone.said.iter().filter(is_counted).count();
    drone.signal("HUP");
    drone.wait_for_more(before, "what it has counted", |line| is_counted(&line));
    let counted = drone.said.iter().rfind(is_counted).unwrap();
    let dropped = counted["dropped"].as_str().unwrap();
    let reasons = dropped.split(", ").filter(|it| !it.is_empty());
    let reasons = reasons.map(|it| it.rsplit_once(' ').unwrap());
    reasons
        .map(|(reason, n)| (reason.to_owned(), n.parse().unwrap()))
        .collect()
}

/// Waits until a drone has dropped so many frames in all; by reason.
fn wait_until_dropped(drone: &mut Process, frames: usize) -> Vec<(String, usize)> {
    let began = Instant::now();
    loop {
        let dropped = dropped(drone);
        let in_all: usize = dropped.iter().map(|(_, n)| n).sum();
        if in_all >= frames {
            return dropped;
        }
        assert!(began.elapsed() < PATIENCE, "{frames}: {dropped:?}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn frames_that_were_recorded_before_a_drone_started_are_not_let_in() {
    const FRAMES: usize = 5;
    let fleet = Fleet::new();
    let stranger = stranger(&fleet, MASTER);
    let mut first_incarnation = fleet.start(1, &[]);
    first_incarnation.wait_for("that it is ready", is_ready);
    drop(first_incarnation);
    // Orders, which the others would obey.
    let master = fleet.start(MASTER, &["--fly"]);
    let orders = record(&stranger, FRAMES);
    drop(master);
    // In its next life, and in the first of another journal: it is all the same to it.
    for journal in ["journal-1", "journal-new"] {
        replace(&fleet.file(1), "journal-1", journal);
        let mut drone = fleet.start(1, &[]);
        drone.wait_for("that it is ready", is_ready);
        for frame in &orders {
            stranger.send_to(frame, fleet.address(1)).unwrap();
        }
        let dropped = wait_until_dropped(&mut drone, FRAMES);
        assert_eq!(dropped, [("unproven".to_owned(), FRAMES)], "{journal}");
        drone.signal("TERM");
        assert_eq!(drone.end(), Some(0));
        let let_in = |line: &&Value| line["let_in"].as_u64() > Some(0);
        assert_eq!(drone.said.iter().find(let_in), None, "{journal}");
    }
}

#[test]
fn what_was_recorded_under_another_journal_of_its_sender_is_not_let_in_and_does_not_keep_its_sender_out()
 {
    const FRAMES: usize = 20;
    let fleet = Fleet::new();
    let stranger = stranger(&fleet, MASTER);
    // Orders, which the others would obey.
    let mut before = fleet.start(MASTER, &["--fly"]);
    let orders = record(&stranger, FRAMES);
    before.signal("KILL");
    assert_eq!(before.end(), None);
    // The same key, and nothing that the drone could remember that flight by.
    replace(&fleet.file(MASTER), "journal-2", "journal-new");
    let mut drone = fleet.start(1, &[]);
    let mut master = fleet.start(MASTER, &["--fly"]);
    drone.wait_for("that it is ready", is_ready);
    let heard = |status: &Value| {
        let heard = &status["heard"][MASTER.to_string()]["frames"];
        heard.as_u64().unwrap_or(0)
    };
    fleet.wait_for_status(1, "one that hears the master", |it| heard(it) > 0);
    for frame in &orders {
        stranger.send_to(frame, fleet.address(1)).unwrap();
    }
    let dropped = wait_until_dropped(&mut drone, FRAMES);
    let frames_of = |reason| {
        let found = dropped.iter().find(|(it, _)| it == reason);
        found.map_or(0, |(_, frames)| *frames)
    };
    assert!(frames_of("unproven") >= FRAMES, "{dropped:?}");
    assert_eq!(
        frames_of("replayed"),
        0,
        "its sender is kept out: {dropped:?}"
    );
    let now = heard(&fleet.status(1));
    fleet.wait_for_status(1, "one that hears the master still", |it| heard(it) > now);
    for process in [&mut drone, &mut master] {
        process.signal("TERM");
        assert_eq!(process.end(), Some(0));
    }
}

#[test]
fn a_disk_that_hangs_as_it_is_to_keep_a_list_of_the_expelled_does_not_hold_up_the_drone() {
    let fleet = Fleet::new();
    let list_of = fleet.divide_lists();
    let mut drones: Vec<_> = [1, 3].map(|id| fleet.start(id, &[])).into();
    for drone in &mut drones {
        drone.wait_for("that it is ready", is_ready);
    }
    // Whoever writes here waits until somebody reads.
    let disk = fleet.path("revoked-kept-1.toml.new");
    let made = Command::new("mkfifo").arg(&disk).status().unwrap();
    assert!(made.success());
    fleet.keys(&["revoke", "ours", "0"]);
    fs::copy(fleet.path("ours/revoked.toml"), list_of(1)).unwrap();
    drones[0].signal("HUP");
    drones[0].wait_for("that it read its files again", |line| line["number"] == 2);
    // It is obeyed, passed on and told to whoever asks.
    drones[1].wait_for("that a list was passed on to it", |line| {
        line["seen"] == r#"{"Radio":{"RevocationList":{"list":2}}}"#
    });
    assert_eq!(fleet.ask(1, "/health").0, 200);
    assert!(!fleet.path("revoked-kept-1.toml").exists());
    // A pipe can't be made to last, and the drone says so; the next list finds a disk again.
    let read = fs::read_to_string(&disk).unwrap();
    assert!(read.contains("number = 2"), "{read}");
    drones[0].wait_for("that the list can't be kept", |line| {
        line["level"] == "ERROR"
    });
    fs::remove_file(&disk).unwrap();
    fleet.keys(&["revoke", "ours", "4"]);
    fs::copy(fleet.path("ours/revoked.toml"), list_of(1)).unwrap();
    drones[0].signal("HUP");
    drones[0].wait_for("that it keeps the list", |line| {
        line["number"] == 3 && line["message"] == "the list of the revoked is kept"
    });
    for (drone, id) in drones.iter_mut().zip([1, 3]) {
        drone.signal("TERM");
        assert_eq!(drone.end(), Some(0));
        let kept = fleet.path(&format!("revoked-kept-{id}.toml"));
        let kept = fs::read_to_string(kept).unwrap();
        assert!(kept.contains("number = 3"), "drone {id}: {kept}");
    }
}

fn is_ready(line: &Value) -> bool {
    line["message"] == "ready"
}

#[test]
fn a_drone_in_whose_name_frames_are_forged_is_heard_all_the_same() {
    const FORGERIES: usize = 20_000;
    let fleet = Fleet::new();
    let stranger = stranger(&fleet, MASTER);
    let mut drones = fleet.fly();
    let recorded = record(&stranger, 1).pop().unwrap();
    let moving = json!({ "State": { "MovingToWaypoint": { "waypoint": 1 } } });
    drones[0].wait_for_mission(&moving);
    let forged = forged_from(&recorded);
    for nth in 0..FORGERIES {
        stranger.send_to(&forged, fleet.address(0)).unwrap();
        if nth % 50 == 0 {
            std::thread::sleep(Duration::from_millis(5));
        }
    }
    for (id, drone) in drones.iter_mut().enumerate() {
        assert_eq!(drone.end(), Some(0), "drone {id}");
    }
    let is_counted = |line: &&Value| line["message"] == "counted";
    let counted = drones[0].said.iter().rfind(is_counted).unwrap();
    let dropped = counted["dropped"].as_str().unwrap();
    assert!(dropped.contains("unverified"), "{dropped}");
    assert!(!dropped.contains("over budget"), "{dropped}");
    assert_eq!(drones[0].leader().len(), 1, "it never missed its master");
}

/// Made of a frame that was overheard: with a counter that is yet to come, so that it does not pass for a replay.
fn forged_from(frame: &[u8]) -> Vec<u8> {
    let read = wire::decode_frame(frame).unwrap();
    let header = Header {
        counter: u64::MAX,
        ..read.header
    };
    let mut later = wire::encode_covered(&header, read.payload, Vec::new());
    later.extend_from_slice(&[0x5a; AUTHENTICATOR_LEN]);
    later
}

#[test]
fn a_list_of_the_expelled_is_passed_on_obeyed_and_not_forgotten() {
    const REVOCATION_LIST: u32 = 0;
    let fleet = Fleet::new();
    let list_of = fleet.divide_lists();
    let old = fs::read(list_of(REVOCATION_LIST)).unwrap();
    let mut drones = fleet.fly();
    drones[3].wait_for_mission(&json!({ "State": { "MovingToWaypoint": { "waypoint": 1 } } }));
    fleet.keys(&["revoke", "ours", "0"]);
    fs::copy(fleet.path("ours/revoked.toml"), list_of(3)).unwrap();
    drones[3].signal("HUP");
    let passed_on = r#"{"Radio":{"RevocationList":{"list":2}}}"#;
    for (id, drone) in (0..).zip(&mut drones).filter(|(id, _)| *id != 3) {
        drone.wait_for("that a list was passed on to it", |line| {
            line["seen"] == passed_on
        });
        assert_eq!(fs::read(list_of(id)).unwrap(), old, "drone {id}");
    }
    for (id, drone) in (0..).zip(&mut drones) {
        assert_eq!(drone.end(), Some(0), "drone {id}");
        let reason = if id == REVOCATION_LIST {
            "Recalled"
        } else {
            "MissionOver"
        };
        let landing = json!({ "Landing": reason });
        assert!(drone.missions().contains(&landing), "drone {id}");
    }
    // Its file is as old as it was.
    let again = fleet.command(REVOCATION_LIST).output().unwrap();
    let said = String::from_utf8(again.stderr).unwrap();
    assert_eq!(again.status.code(), Some(2), "{said}");
    assert!(said.contains("drone 0 was revoked"), "{said}");
}
