//! `muster drone`: an operator and one drone.

use std::fs;
use std::io;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;

use ed25519_dalek::{Signer, SigningKey};
use muster_machines::identity::NodeId;
use muster_machines::radio::Authenticator;
use muster_transport::quic::{Distrust, Identities, Operator, Peer, PublicKey};

use super::fleet::{Fleet, Process, SCENARIO, replace};

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
    let run = Command::new(env!("CARGO_BIN_EXE_muster"))
        .current_dir(fleet.path(""))
        .arg("drone")
        .args(arguments)
        .output()
        .unwrap();
    let said = String::from_utf8([run.stdout, run.stderr].concat()).unwrap();
    // It is wrapped to the width of a terminal.
    let words: Vec<_> = said.split_whitespace().collect();
    (run.status.code(), words.join(" "))
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

    // What it could not start with is not taken.
    let short = faster.replace("drones = 5", "drones = 1");
    for (name, text, says) in [
        ("bad.toml", "seed = \"one\"", "`seed` is"),
        ("few.toml", &short, "numbers up to 0"),
        ("bad.waypoints", "nonsense", "no mission"),
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
    let upload = format!("{{\"upload\":\"scenario\"}}\n{other}");
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
