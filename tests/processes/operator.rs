//! The command `muster drone`.

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

use super::fleet::{Fleet, MASTER, Process, SCENARIO, TIMEOUT, replace, run_command};

/// The drone under test.
const DRONE: u32 = 1;

/// A fleet over QUIC and the process of its drone, which has its own scenario and mission.
fn started() -> (Fleet, Process) {
    let fleet = Fleet::over("quic");
    let mission = SCENARIO.replace("hardware/swarm-short.toml", "missions/hop.waypoints");
    fs::copy(SCENARIO, fleet.path("own.toml")).unwrap();
    fs::copy(mission, fleet.path("own.waypoints")).unwrap();
    replace(&fleet.path("own.toml"), "../missions/hop", "own");
    replace(&fleet.file(DRONE), SCENARIO, "own.toml");
    let mut drone = fleet.start(DRONE, &[]);
    drone.wait_until_ready();
    (fleet, drone)
}

/// Runs `muster drone`. Returns its exit code and output.
fn drone(fleet: &Fleet, arguments: &[&str]) -> (Option<i32>, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_muster"));
    run_command(
        command
            .current_dir(fleet.path(""))
            .arg("drone")
            .args(arguments),
    )
}

#[test]
fn drone_on_the_ground_accepts_only_usable_uploads() {
    let (fleet, mut process) = started();
    let at = fleet.address(DRONE);
    let upload = |file: &str| drone(&fleet, &["upload", "ours", &at, file]);
    let read = |name: &str| fs::read_to_string(fleet.path(name)).unwrap();
    let mission = read("own.waypoints");

    let faster = read("own.toml").replace("climb_mps = 8", "climb_mps = 4");
    fs::write(fleet.path("new.toml"), &faster).unwrap();
    let (code, output) = upload("new.toml");
    assert_eq!(code, Some(0), "{output}");
    assert!(
        output.contains("drone 1 stored it as") && output.contains("own.toml"),
        "{output}"
    );
    assert_eq!(read("own.toml"), faster);

    let longer = mission.replace("\t8.000000\t", "\t9.000000\t");
    fs::write(fleet.path("new.waypoints"), &longer).unwrap();
    let (code, output) = upload("new.waypoints");
    assert_eq!(code, Some(0), "{output}");
    assert_eq!(read("own.waypoints"), longer);

    // Unusable files, missions in another folder, and too long files are refused.
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
    for (name, text, expected) in [
        ("bad.toml", "seed = \"one\"", "`seed` takes"),
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
        ("long.toml", &long, "accepts up to 65536 bytes"),
        ("bad.waypoints", "nonsense", "not a mission file"),
        (
            "long.waypoints",
            &longer_still,
            "accepts up to 1048576 bytes",
        ),
    ] {
        fs::write(fleet.path(name), text).unwrap();
        let (code, output) = upload(name);
        assert_eq!(code, Some(2), "{output}");
        assert!(
            output.contains("drone 1 can't use") && output.contains(expected),
            "{output}"
        );
    }
    assert_eq!((read("own.toml"), read("own.waypoints")), (faster, longer));
    process.signal("TERM");
    assert_eq!(process.end(), Some(0));
}

/// Output of `musterd --check`: the flight of the next start.
fn checked(fleet: &Fleet, id: u32) -> String {
    let run = fleet.command(id).arg("--check").output().unwrap();
    assert!(run.status.success(), "{run:?}");
    String::from_utf8(run.stdout).unwrap()
}

#[test]
fn restart_in_flight_ignores_an_upload_until_the_next_flight() {
    let (fleet, first) = started();
    let before = checked(&fleet, DRONE);
    let text = fs::read_to_string(fleet.path("own.toml")).unwrap();
    let new = text + "\n[limits]\nduration_s = 777\n";
    fs::write(fleet.path("new.toml"), new).unwrap();
    let (code, output) = drone(
        &fleet,
        &["upload", "ours", &fleet.address(DRONE), "new.toml"],
    );
    assert_eq!(code, Some(0), "{output}");
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
        "the new simulated vehicle is on the ground"
    );
    assert!(checked(&fleet, DRONE).contains("777"));
    drones.iter().for_each(|it| it.signal("TERM"));
    for drone in &mut drones {
        assert_eq!(drone.end(), Some(0));
    }
}

#[test]
fn uploads_of_any_size_stay_within_the_memory_limit() {
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
        // As many uploads as there may be operators. The drone handles one at a time, and earlier connections may still be open.
        let is_handled = || {
            let uploads = || {
                let (code, output) = drone(&fleet, &["upload", "ours", &at, name]);
                let is_busy = output.contains("is busy with another upload")
                    || output.contains("closed by peer: busy");
                assert_eq!(code, Some(if is_busy { 1 } else { 2 }), "{output}");
                !is_busy
            };
            std::thread::scope(|scope| {
                let uploads = [(); 4].map(|()| scope.spawn(uploads));
                uploads.map(|upload| upload.join().unwrap()).contains(&true)
            })
        };
        let since = Instant::now();
        while !is_handled() {
            assert!(since.elapsed() < TIMEOUT, "{name} is not handled");
        }
    }
    let peak_kib = process.memory_kib("VmHWM");
    assert!(peak_kib < 48 * 1_024, "{peak_kib} KiB");
}

#[test]
fn dead_followers_of_a_log_do_not_block_others() {
    let (fleet, process) = started();
    let at = fleet.address(DRONE);
    // As many as there may be operators.
    let followers = [(); 4].map(|()| {
        let mut follow = Command::new(env!("CARGO_BIN_EXE_muster"));
        follow.current_dir(fleet.path(""));
        follow.args(["drone", "logs", "ours", &at, "--follow"]);
        follow.stdout(Stdio::piped()).stderr(Stdio::null());
        follow.spawn().unwrap()
    });
    for mut follower in followers {
        // It is connected once it reads a line, and dies without closing the connection.
        let mut line = String::new();
        let mut output = BufReader::new(follower.stdout.take().unwrap());
        output.read_line(&mut line).unwrap();
        assert!(line.contains("starts"), "{line}");
        follower.kill().unwrap();
        follower.wait().unwrap();
    }
    // The drone logs nothing meanwhile, so it can't notice by a failed write.
    let since = Instant::now();
    while drone(&fleet, &["logs", "ours", &at]).0 != Some(0) {
        let waited = since.elapsed();
        assert!(
            waited < Duration::from_secs(60),
            "a further operator is refused"
        );
    }
    drop(process);
}

#[test]
fn relay_refuses_uploads_once_it_knows_a_master() {
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
    relay.wait_for("ready", |line| line["message"] == "ready");
    let upload = || drone(&fleet, &["upload", "ours", &fleet.address(4), "own.toml"]);
    assert_eq!(upload().0, Some(0));
    let leads = (0..4)
        .find(|id| checked(&fleet, *id).contains("leads"))
        .unwrap();
    let mut leader = fleet.start(leads, &["--fly"]);
    fleet.wait_for_status(4, "has a leader", |status| {
        status["ballot"]["master"] == leads
    });
    let (code, output) = upload();
    assert_eq!(code, Some(1), "{output}");
    assert!(
        output.contains("drone 4 takes part in a flight"),
        "{output}"
    );
    for process in [&mut relay, &mut leader] {
        process.signal("TERM");
        assert_eq!(process.end(), Some(0));
    }
}

#[test]
fn operator_refuses_drones_of_another_fleet() {
    let (fleet, _process) = started();
    fleet.keys(&["fleet", "theirs"]);
    let at = fleet.address(DRONE);
    for arguments in [
        &["upload", "theirs", &at, "own.toml"][..],
        &["logs", "theirs", &at],
    ] {
        let (code, output) = drone(&fleet, arguments);
        assert_eq!(code, Some(1), "{output}");
        assert!(output.contains("is not trusted: stranger"), "{output}");
    }
    let (code, output) = drone(&fleet, &["logs", "ours", "127.0.0.1:1"]);
    assert_eq!(code, Some(1), "{output}");
    assert!(
        output.contains("no drone answers at 127.0.0.1:1"),
        "{output}"
    );
}

/// An operator that trusts everyone, with a given key.
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

    fn is_trusted(&self, _: NodeId) -> bool {
        true
    }

    fn peer(&self, _: &PublicKey) -> Result<Peer, Distrust> {
        Ok(Peer::Drone(NodeId(DRONE)))
    }
}

/// Reads a secret key from its file.
fn key_of(path: &Path) -> SigningKey {
    let text = fs::read_to_string(path).unwrap();
    let digits = text.trim().rsplit(' ').next().unwrap().as_bytes();
    let byte = |pair: &[u8]| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap();
    let seed: Vec<u8> = digits.chunks(2).map(byte).collect();
    SigningKey::from_bytes(&seed.try_into().unwrap())
}

#[test]
fn drone_refuses_operators_without_the_fleets_key() {
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
    let send = async |key: &SigningKey, request: &str| {
        let impostor = Arc::new(Impostor(key.clone()));
        // The drone authenticates first, so the connection opens; then it checks the operator.
        let operator = Operator::connect(at, impostor).await.unwrap();
        let mut stream = operator.open().await.map_err(io::Error::other)?;
        stream.write(request.as_bytes()).await?;
        stream.finish();
        stream.read_to_end(1_000_000).await
    };
    // Another fleet's operator, and a captured drone of this fleet.
    for key in ["theirs/fleet.key", "ours/drone-3.key"] {
        let key = key_of(&fleet.path(key));
        for request in [&upload, logs] {
            let answer = runtime.block_on(send(&key, request));
            assert!(answer.is_err(), "{answer:?}");
        }
    }
    assert_eq!(fs::read_to_string(fleet.path("own.toml")).unwrap(), before);
    // The same requests with the fleet's key are answered.
    let key = key_of(&fleet.path("ours/fleet.key"));
    for request in [logs, &upload] {
        let answer = runtime.block_on(send(&key, request)).unwrap();
        assert!(!answer.is_empty());
    }
    assert_eq!(fs::read_to_string(fleet.path("own.toml")).unwrap(), other);
    drop(process);
}

#[test]
fn operator_reads_and_follows_the_log_of_a_drone() {
    let (fleet, mut process) = started();
    let at = fleet.address(DRONE);
    let (code, output) = drone(&fleet, &["logs", "ours", &at]);
    assert_eq!(code, Some(0), "{output}");
    assert!(output.contains("\"message\":\"ready\""), "{output}");
    let following = Command::new(env!("CARGO_BIN_EXE_muster"))
        .current_dir(fleet.path(""))
        .args(["drone", "logs", "ours", &at, "--follow"])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    process.signal("HUP");
    process.wait_for("counted", |line| line["message"] == "counted");
    process.signal("TERM");
    assert_eq!(process.end(), Some(0));
    let followed = following.wait_with_output().unwrap();
    let output = String::from_utf8(followed.stdout).unwrap();
    assert!(followed.status.success(), "{output}");
    for message in ["ready", "counted"] {
        assert!(
            output.contains(&format!("\"message\":\"{message}\"")),
            "{output}"
        );
    }
}

#[test]
fn flying_drone_refuses_uploads() {
    let fleet = Fleet::over("quic");
    let mut drones = fleet.fly();
    let flying = &mut drones[DRONE as usize];
    flying.wait_for_mission(&serde_json::json!({ "State": "TakingOff" }));
    let (code, output) = drone(&fleet, &["upload", "ours", &fleet.address(DRONE), SCENARIO]);
    assert_eq!(code, Some(1), "{output}");
    assert!(
        output.contains("drone 1 takes part in a flight"),
        "{output}"
    );
    drones.iter().for_each(|it| it.signal("TERM"));
    for drone in &mut drones {
        assert_eq!(drone.end(), Some(0));
    }
}
