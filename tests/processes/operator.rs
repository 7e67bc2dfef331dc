//! `muster drone`: an operator and one drone.

use std::fs;
use std::io::{self, BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use ed25519_dalek::{Signer, SigningKey};
use muster_machines::identity::NodeId;
use muster_machines::radio::Authenticator;
use muster_transport::quic::{Distrust, Identities, Operator, Peer, PublicKey};

use super::fleet::{Fleet, MASTER, PATIENCE, Process, SCENARIO, replace, said_by};

/// The drone whose files are replaced.
const DRONE: u32 = 1;

/// A fleet over QUIC whose drone has a scenario and a mission of its own, and its process.
fn started() -> (Fleet, Process) {
    let fleet = Fleet::over("quic");
    let mission = SCENARIO.replace("hardware/swarm-short.toml", "missions/hop.waypoints");
    fs::copy(SCENARIO, fleet.path("own.toml")).unwrap();
    fs::copy(mission, fleet.path("own.waypoints")).unwrap();
    replace(&fleet.path("own.toml"), "../missions/hop", "own");
    replace(&fleet.file(DRONE), SCENARIO, "own.toml");
    let mut drone = fleet.start(DRONE, &[]);
    drone.wait_for("that it is ready", |line| line["message"] == "ready");
    (fleet, drone)
}

/// Runs `muster drone`; its exit code, and what it says.
fn drone(fleet: &Fleet, arguments: &[&str]) -> (Option<i32>, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_muster"));
    said_by(
        command
            .current_dir(fleet.path(""))
            .arg("drone")
            .args(arguments),
    )
}

#[test]
fn an_operator_hands_a_drone_on_the_ground_a_file_that_it_could_start_with() {
    let (fleet, mut process) = started();
    let at = fleet.address(DRONE);
    let upload = |file: &str| drone(&fleet, &["upload", "ours", &at, file]);
    let read = |name: &str| fs::read_to_string(fleet.path(name)).unwrap();
    let mission = read("own.waypoints");

    let faster = read("own.toml").replace("climb_mps = 8", "climb_mps = 4");
    fs::write(fleet.path("new.toml"), &faster).unwrap();
    let (code, said) = upload("new.toml");
    assert_eq!(code, Some(0), "{said}");
    assert!(
        said.contains("drone 1 has it as") && said.contains("own.toml"),
        "{said}"
    );
    assert_eq!(read("own.toml"), faster);

    let longer = mission.replace("\t8.000000\t", "\t9.000000\t");
    fs::write(fleet.path("new.waypoints"), &longer).unwrap();
    let (code, said) = upload("new.waypoints");
    assert_eq!(code, Some(0), "{said}");
    assert_eq!(read("own.waypoints"), longer);

    // What it could not start with is not taken, nor what names a mission elsewhere or is too much.
    let short = faster.replace("drones = 5", "drones = 1");
    let shipped = SCENARIO.replace("hardware/swarm-short.toml", "missions/hop.waypoints");
    let elsewhere = faster.replace("own.waypoints", &shipped);
    let folder = fleet
        .path("")
        .file_name()
        .unwrap()
        .to_str()
        .unwrap()
        .to_owned();
    let round_about = faster.replace("own.waypoints", &format!("../{folder}/own.waypoints"));
    let long = format!("{faster}# {}", "long ".repeat(100_000));
    let longer_still = format!("{longer}# {}", "long ".repeat(800_000));
    for (name, text, says) in [
        ("bad.toml", "seed = \"one\"", "`seed` is"),
        ("few.toml", &short, "numbers up to 0"),
        (
            "elsewhere.toml",
            &elsewhere,
            "hop.waypoints: is not in the folder",
        ),
        (
            "round-about.toml",
            &round_about,
            "own.waypoints: is not in the folder",
        ),
        ("long.toml", &long, "takes up to 65536 bytes"),
        ("bad.waypoints", "nonsense", "no mission"),
        ("long.waypoints", &longer_still, "takes up to 1048576 bytes"),
    ] {
        fs::write(fleet.path(name), text).unwrap();
        let (code, said) = upload(name);
        assert_eq!(code, Some(2), "{said}");
        assert!(
            said.contains("drone 1 can't use") && said.contains(says),
            "{said}"
        );
    }
    assert_eq!((read("own.toml"), read("own.waypoints")), (faster, longer));
    process.signal("TERM");
    assert_eq!(process.end(), Some(0));
}

/// What a drone is, as `musterd --check` tells it: what it would fly at its next start.
fn checked(fleet: &Fleet, id: u32) -> String {
    let run = fleet.command(id).arg("--check").output().unwrap();
    assert!(run.status.success(), "{run:?}");
    String::from_utf8(run.stdout).unwrap()
}

#[test]
fn a_drone_that_starts_again_in_flight_flies_what_it_flew_and_what_was_uploaded_after_that() {
    let (fleet, first) = started();
    let before = checked(&fleet, DRONE);
    let text = fs::read_to_string(fleet.path("own.toml")).unwrap();
    let new = text + "\n[limits]\nduration_s = 777\n";
    fs::write(fleet.path("new.toml"), new).unwrap();
    let (code, said) = drone(
        &fleet,
        &["upload", "ours", &fleet.address(DRONE), "new.toml"],
    );
    assert_eq!(code, Some(0), "{said}");
    assert!(checked(&fleet, DRONE).contains("777"));

    let mut drones: Vec<_> = [0, 3, 4].map(|id| fleet.start(id, &[])).into();
    drones.push(fleet.start(MASTER, &["--fly"]));
    let mut first = first;
    first.wait_for_mission(&serde_json::json!({ "State": "TakingOff" }));
    first.signal("KILL");
    assert_eq!(first.end(), None);
    assert_eq!(checked(&fleet, DRONE), before);
    let mut again = fleet.start(DRONE, &[]);
    assert_eq!(
        again.end(),
        Some(4),
        "its simulated vehicle stands on the ground"
    );
    assert!(checked(&fleet, DRONE).contains("777"));
    drones.iter().for_each(|it| it.signal("TERM"));
    for drone in &mut drones {
        assert_eq!(drone.end(), Some(0));
    }
}

#[test]
fn files_of_any_size_do_not_take_the_memory_that_a_service_gives_a_drone() {
    let (fleet, process) = started();
    let at = fleet.address(DRONE);
    let fields = |bytes: usize| "a=1\n".repeat(bytes / 4);
    for (name, text) in [
        ("fields.toml", fields(64 * 1_024)),
        ("items.plan", format!("[{}1]", "1,".repeat(500_000))),
        ("lines.waypoints", "1\n".repeat(500_000)),
        ("too-long.toml", fields(4_000_000)),
        ("too-long.waypoints", fields(4_000_000)),
    ] {
        fs::write(fleet.path(name), text).unwrap();
        // As many at once as there may be operators. One file is taken at a time, and connections of the files before may
        // not have ended yet.
        let is_looked_at = || {
            let uploads = || {
                let (code, said) = drone(&fleet, &["upload", "ours", &at, name]);
                let is_busy = said.contains("is being handed another file")
                    || said.contains("closed by peer: busy");
                assert_eq!(code, Some(if is_busy { 1 } else { 2 }), "{said}");
                !is_busy
            };
            std::thread::scope(|scope| {
                let uploads = [(); 4].map(|()| scope.spawn(uploads));
                uploads.map(|upload| upload.join().unwrap()).contains(&true)
            })
        };
        let asked_at = Instant::now();
        while !is_looked_at() {
            assert!(asked_at.elapsed() < PATIENCE, "{name} is not looked at");
        }
    }
    let most_kib = process.memory_kib("VmHWM");
    assert!(most_kib < 48 * 1_024, "{most_kib} KiB");
}

#[test]
fn those_who_follow_a_log_and_are_gone_keep_nobody_out() {
    let (fleet, process) = started();
    let at = fleet.address(DRONE);
    // As many as are answered at once.
    let followers = [(); 4].map(|()| {
        let mut follow = Command::new(env!("CARGO_BIN_EXE_muster"));
        follow.current_dir(fleet.path(""));
        follow.args(["drone", "logs", "ours", &at, "--follow"]);
        follow.stdout(Stdio::piped()).stderr(Stdio::null());
        follow.spawn().unwrap()
    });
    for mut follower in followers {
        // It is let in once it reads something, and has no time to say that it goes.
        let mut line = String::new();
        let mut said = BufReader::new(follower.stdout.take().unwrap());
        said.read_line(&mut line).unwrap();
        assert!(line.contains("starts"), "{line}");
        follower.kill().unwrap();
        follower.wait().unwrap();
    }
    // The drone says nothing meanwhile, on which it would notice.
    let since = Instant::now();
    while drone(&fleet, &["logs", "ours", &at]).0 != Some(0) {
        let waited = since.elapsed();
        assert!(
            waited < Duration::from_secs(60),
            "nobody is let in any more"
        );
    }
    drop(process);
}

#[test]
fn a_relay_takes_no_file_from_when_it_has_heard_of_a_master() {
    let fleet = Fleet::over("quic");
    let mission = SCENARIO.replace("hardware/swarm-short.toml", "missions/hop.waypoints");
    let relay = "\n[[relays]]\nnorth_m = 5\neast_m = 5\naltitude_m = 3\n";
    let text = fs::read_to_string(SCENARIO).unwrap() + relay;
    let text = text
        .replace("drones = 5", "drones = 4")
        .replace("../missions/hop", "own");
    fs::write(fleet.path("own.toml"), text).unwrap();
    fs::copy(mission, fleet.path("own.waypoints")).unwrap();
    (0..5).for_each(|id| replace(&fleet.file(id), SCENARIO, "own.toml"));
    let mut relay = fleet.start(4, &[]);
    relay.wait_for("that it is ready", |line| line["message"] == "ready");
    let upload = || drone(&fleet, &["upload", "ours", &fleet.address(4), "own.toml"]);
    assert_eq!(upload().0, Some(0));
    let leads = (0..4)
        .find(|id| checked(&fleet, *id).contains("leads"))
        .unwrap();
    let mut leader = fleet.start(leads, &["--fly"]);
    fleet.wait_for_status(4, "led", |status| status["ballot"]["master"] == leads);
    let (code, said) = upload();
    assert_eq!(code, Some(1), "{said}");
    assert!(
        said.contains("drone 4 flies, or has heard of a master"),
        "{said}"
    );
    for process in [&mut relay, &mut leader] {
        process.signal("TERM");
        assert_eq!(process.end(), Some(0));
    }
}

#[test]
fn an_operator_of_another_fleet_believes_no_drone_of_this_one() {
    let (fleet, _process) = started();
    fleet.keys(&["fleet", "theirs"]);
    let at = fleet.address(DRONE);
    for what in [
        &["upload", "theirs", &at, "own.toml"][..],
        &["logs", "theirs", &at],
    ] {
        let (code, said) = drone(&fleet, what);
        assert_eq!(code, Some(1), "{said}");
        assert!(said.contains("is not believed: stranger"), "{said}");
    }
    let (code, said) = drone(&fleet, &["logs", "ours", "127.0.0.1:1"]);
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("no drone answers at 127.0.0.1:1"), "{said}");
}

/// Somebody who believes whomever it speaks with, and has a key that is not the fleet's.
struct Impostor(SigningKey);

impl Authenticator for Impostor {
    fn sign(&self, covered: &[u8]) -> [u8; 64] {
        self.0.sign(covered).to_bytes()
    }

    fn verify(&self, _: NodeId, _: &[u8], _: &[u8; 64]) -> bool {
        true
    }
}

impl Identities for Impostor {
    fn public_key(&self) -> PublicKey {
        self.0.verifying_key().to_bytes()
    }

    fn peer(&self, _: &PublicKey) -> Result<Peer, Distrust> {
        Ok(Peer::Drone(NodeId(DRONE)))
    }
}

/// A secret key as its file has it.
fn key_of(path: &Path) -> SigningKey {
    let text = fs::read_to_string(path).unwrap();
    let digits = text.trim().rsplit(' ').next().unwrap().as_bytes();
    let byte = |pair: &[u8]| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap();
    let seed: Vec<u8> = digits.chunks(2).map(byte).collect();
    SigningKey::from_bytes(&seed.try_into().unwrap())
}

#[test]
fn nobody_without_the_fleets_key_hands_a_drone_a_file_or_reads_its_log() {
    let (fleet, process) = started();
    fleet.keys(&["fleet", "theirs"]);
    let at = fleet.address(DRONE).parse().unwrap();
    let before = fs::read_to_string(fleet.path("own.toml")).unwrap();
    let other = before.replace("climb_mps = 8", "climb_mps = 4");
    assert_ne!(other, before);
    let what = serde_json::json!({ "what": "scenario", "bytes": other.len() });
    let upload = format!("{}\n{other}", serde_json::json!({ "upload": what }));
    let logs = "{\"logs\":{\"follow\":false}}\n";
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .unwrap();
    let ask = async |key: &SigningKey, asked: &str| {
        let impostor = Arc::new(Impostor(key.clone()));
        // A drone proves its key first, and so is connected with; then it looks at the other one.
        let operator = Operator::connect(at, impostor).await.unwrap();
        let mut stream = operator.open().await.map_err(io::Error::other)?;
        stream.write(asked.as_bytes()).await?;
        stream.finish();
        stream.read_to_end(1_000_000).await
    };
    // Another fleet's operator, and a drone of this fleet that was captured.
    for key in ["theirs/fleet.key", "ours/drone-3.key"] {
        let key = key_of(&fleet.path(key));
        for asked in [&upload, logs] {
            let answer = runtime.block_on(ask(&key, asked));
            assert!(answer.is_err(), "{answer:?}");
        }
    }
    assert_eq!(fs::read_to_string(fleet.path("own.toml")).unwrap(), before);
    // Whoever has the key is answered, asking in the very same words.
    let key = key_of(&fleet.path("ours/fleet.key"));
    for asked in [logs, &upload] {
        let answer = runtime.block_on(ask(&key, asked)).unwrap();
        assert!(!answer.is_empty());
    }
    assert_eq!(fs::read_to_string(fleet.path("own.toml")).unwrap(), other);
    drop(process);
}

#[test]
fn an_operator_reads_what_a_drone_has_said_and_follows_what_it_goes_on_to_say() {
    let (fleet, mut process) = started();
    let at = fleet.address(DRONE);
    let (code, said) = drone(&fleet, &["logs", "ours", &at]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("\"message\":\"ready\""), "{said}");
    let following = Command::new(env!("CARGO_BIN_EXE_muster"))
        .current_dir(fleet.path(""))
        .args(["drone", "logs", "ours", &at, "--follow"])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    process.signal("HUP");
    process.wait_for("that it counted", |line| line["message"] == "counted");
    process.signal("TERM");
    assert_eq!(process.end(), Some(0));
    let followed = following.wait_with_output().unwrap();
    let said = String::from_utf8(followed.stdout).unwrap();
    assert!(followed.status.success(), "{said}");
    for message in ["ready", "counted"] {
        assert!(
            said.contains(&format!("\"message\":\"{message}\"")),
            "{said}"
        );
    }
}

#[test]
fn a_drone_that_flies_takes_no_file() {
    let fleet = Fleet::over("quic");
    let mut drones = fleet.fly();
    let flying = &mut drones[DRONE as usize];
    flying.wait_for_mission(&serde_json::json!({ "State": "TakingOff" }));
    let (code, said) = drone(&fleet, &["upload", "ours", &fleet.address(DRONE), SCENARIO]);
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("drone 1 flies"), "{said}");
    drones.iter().for_each(|it| it.signal("TERM"));
    for drone in &mut drones {
        assert_eq!(drone.end(), Some(0));
    }
}
