//! Replayed and forged frames, and the distribution of revocation lists.

use std::fs;
use std::net::{Ipv4Addr, UdpSocket};
use std::process::Command;
use std::time::{Duration, Instant};

use muster_machines::wire::{self, AUTHENTICATOR_LEN, Header};
use serde_json::{Value, json};

use super::fleet::{Fleet, MASTER, Process, replace};

/// Time limit for a condition that must come true.
const TIMEOUT: Duration = Duration::from_secs(60);

/// A peer without a key that receives the broadcasts of a drone.
fn stranger(fleet: &Fleet, drone: u32) -> UdpSocket {
    let stranger = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    stranger.set_read_timeout(Some(TIMEOUT)).unwrap();
    let address = stranger.local_addr().unwrap();
    let peers = format!("peers = [\"{address}\", ");
    replace(&fleet.file(drone), "peers = [", &peers);
    stranger
}

/// Records the next routing frames; packets between radios are skipped.
fn record(stranger: &UdpSocket, frames: usize) -> Vec<Vec<u8>> {
    let mut buffer = [0; wire::DATAGRAM_MAX];
    let received = std::iter::from_fn(|| {
        let len = stranger.recv(&mut buffer).unwrap();
        Some(buffer[..len].to_vec())
    });
    let is_for_routing = |frame: &Vec<u8>| {
        let payload = wire::decode_frame(frame).unwrap().payload;
        wire::decode_radio_packet(payload).is_none()
    };
    received.filter(is_for_routing).take(frames).collect()
}

/// Counts of dropped frames of a drone, by reason.
fn dropped(drone: &mut Process) -> Vec<(String, usize)> {
    let is_counted = |line: &&Value| line["message"] == "counted";
    let before = drone.log.iter().filter(is_counted).count();
    drone.signal("HUP");
    drone.wait_for_more(before, "counted", |line| is_counted(&line));
    let counted = drone.log.iter().rfind(is_counted).unwrap();
    let dropped = counted["dropped"].as_str().unwrap();
    let reasons = dropped.split(", ").filter(|it| !it.is_empty());
    let reasons = reasons.map(|it| it.rsplit_once(' ').unwrap());
    reasons
        .map(|(reason, n)| (reason.to_owned(), n.parse().unwrap()))
        .collect()
}

/// Waits until a drone has dropped this many frames. Returns the counts by reason.
fn wait_until_dropped(drone: &mut Process, frames: usize) -> Vec<(String, usize)> {
    let began = Instant::now();
    loop {
        let dropped = dropped(drone);
        let total: usize = dropped.iter().map(|(_, n)| n).sum();
        if total >= frames {
            return dropped;
        }
        assert!(began.elapsed() < TIMEOUT, "{frames}: {dropped:?}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn frames_recorded_before_a_start_are_dropped() {
    const FRAMES: usize = 5;
    let fleet = Fleet::new();
    let stranger = stranger(&fleet, MASTER);
    let mut first_incarnation = fleet.start(1, &[]);
    first_incarnation.wait_until_ready();
    drop(first_incarnation);
    // Orders of the master, which the drones would follow.
    let master = fleet.start(MASTER, &["--fly"]);
    let orders = record(&stranger, FRAMES);
    drop(master);
    // In its next incarnation, and in the first of a new journal.
    for journal in ["journal-1", "journal-new"] {
        replace(&fleet.file(1), "journal-1", journal);
        let mut drone = fleet.start(1, &[]);
        drone.wait_until_ready();
        for frame in &orders {
            stranger.send_to(frame, fleet.address(1)).unwrap();
        }
        let dropped = wait_until_dropped(&mut drone, FRAMES);
        assert_eq!(dropped, [("unproven".to_owned(), FRAMES)], "{journal}");
        drone.signal("TERM");
        assert_eq!(drone.end(), Some(0));
        let let_in = |line: &&Value| line["let_in"].as_u64() > Some(0);
        assert_eq!(drone.log.iter().find(let_in), None, "{journal}");
    }
}

#[test]
fn replays_from_a_lost_journal_are_dropped_without_blocking_their_sender() {
    const FRAMES: usize = 20;
    let fleet = Fleet::new();
    let stranger = stranger(&fleet, MASTER);
    // Orders of the master, which the drones would follow.
    let mut before = fleet.start(MASTER, &["--fly"]);
    let orders = record(&stranger, FRAMES);
    before.signal("KILL");
    assert_eq!(before.end(), None);
    // The same key with a new journal.
    replace(&fleet.file(MASTER), "journal-2", "journal-new");
    let mut drone = fleet.start(1, &[]);
    let mut master = fleet.start(MASTER, &["--fly"]);
    drone.wait_until_ready();
    let heard = |status: &Value| {
        let heard = &status["heard"][MASTER.to_string()]["frames"];
        heard.as_u64().unwrap_or(0)
    };
    fleet.wait_for_status(1, "hears the master", |it| heard(it) > 0);
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
        "genuine frames are dropped: {dropped:?}"
    );
    let now = heard(&fleet.status(1));
    fleet.wait_for_status(1, "still hears the master", |it| heard(it) > now);
    for process in [&mut drone, &mut master] {
        process.signal("TERM");
        assert_eq!(process.end(), Some(0));
    }
}

#[test]
fn hanging_disk_does_not_delay_a_revocation_list() {
    let fleet = Fleet::new();
    let list_of = fleet.separate_revocation_lists();
    let mut drones: Vec<_> = [1, 3].map(|id| fleet.start(id, &[])).into();
    drones.iter_mut().for_each(Process::wait_until_ready);
    // A write to a named pipe blocks until it is read.
    let disk = fleet.path("revoked-kept-1.toml.new");
    let made = Command::new("mkfifo").arg(&disk).status().unwrap();
    assert!(made.success());
    fleet.keys(&["revoke", "ours", "0"]);
    fs::copy(fleet.path("ours/revoked.toml"), list_of(1)).unwrap();
    drones[0].signal("HUP");
    drones[0].wait_for("files reloaded", |line| line["number"] == 2);
    // The list is applied and distributed, and the drone answers.
    drones[1].wait_for("revocation list received", |line| {
        line["seen"] == r#"{"Radio":{"RevocationList":{"list":2}}}"#
    });
    assert_eq!(fleet.get(1, "/health").0, 200);
    assert!(!fleet.path("revoked-kept-1.toml").exists());
    // A pipe can't be synced, which the drone logs. The next list is written to a file again.
    let read = fs::read_to_string(&disk).unwrap();
    assert!(read.contains("number = 2"), "{read}");
    drones[0].wait_for("a write error", |line| line["level"] == "ERROR");
    fs::remove_file(&disk).unwrap();
    fleet.keys(&["revoke", "ours", "4"]);
    fs::copy(fleet.path("ours/revoked.toml"), list_of(1)).unwrap();
    drones[0].signal("HUP");
    drones[0].wait_for("list kept", |line| {
        line["number"] == 3 && line["message"] == "the revocation list is stored"
    });
    for (drone, id) in drones.iter_mut().zip([1, 3]) {
        drone.signal("TERM");
        assert_eq!(drone.end(), Some(0));
        let kept = fleet.path(&format!("revoked-kept-{id}.toml"));
        let kept = fs::read_to_string(kept).unwrap();
        assert!(kept.contains("number = 3"), "drone {id}: {kept}");
    }
}

#[test]
fn forged_frames_do_not_block_their_claimed_sender() {
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
    let counted = drones[0].log.iter().rfind(is_counted).unwrap();
    let dropped = counted["dropped"].as_str().unwrap();
    assert!(dropped.contains("verification limit reached"), "{dropped}");
    assert!(!dropped.contains("over budget"), "{dropped}");
    assert_eq!(drones[0].ballots().len(), 1, "no election");
}

/// Forges a frame from a recorded one, with a future counter so that it is not a replay.
fn forged_from(frame: &[u8]) -> Vec<u8> {
    let recorded = wire::decode_frame(frame).unwrap();
    let header = Header {
        counter: u64::MAX,
        ..recorded.header
    };
    let mut forged = wire::encode_covered(&header, recorded.payload);
    forged.extend_from_slice(&[0x5a; AUTHENTICATOR_LEN]);
    forged
}

#[test]
fn revocation_list_is_distributed_applied_and_kept() {
    const REVOKED: u32 = 0;
    let fleet = Fleet::new();
    let list_of = fleet.separate_revocation_lists();
    let old = fs::read(list_of(REVOKED)).unwrap();
    let mut drones = fleet.fly();
    drones[3].wait_for_mission(&json!({ "State": { "MovingToWaypoint": { "waypoint": 1 } } }));
    fleet.keys(&["revoke", "ours", "0"]);
    fs::copy(fleet.path("ours/revoked.toml"), list_of(3)).unwrap();
    drones[3].signal("HUP");
    let received = r#"{"Radio":{"RevocationList":{"list":2}}}"#;
    for (id, drone) in (0..).zip(&mut drones).filter(|(id, _)| *id != 3) {
        drone.wait_for("revocation list received", |line| line["seen"] == received);
        assert_eq!(fs::read(list_of(id)).unwrap(), old, "drone {id}");
    }
    for (id, drone) in (0..).zip(&mut drones) {
        assert_eq!(drone.end(), Some(0), "drone {id}");
        let reason = if id == REVOKED {
            "Recalled"
        } else {
            "MissionOver"
        };
        let landing = json!({ "Landing": reason });
        assert!(drone.missions().contains(&landing), "drone {id}");
    }
    // The drone's configured list is still the old one; the kept list applies.
    let again = fleet.command(REVOKED).output().unwrap();
    let output = String::from_utf8(again.stderr).unwrap();
    assert_eq!(again.status.code(), Some(2), "{output}");
    assert!(output.contains("the key of drone 0 is revoked"), "{output}");
}
