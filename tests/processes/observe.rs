//! Status, metrics and health of drones in flight, and the command `muster status`.

use std::collections::BTreeMap;
use std::io::Read;
use std::net::{TcpListener, TcpStream, UdpSocket};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::fleet::{Fleet, MASTER, assert_refused, replace};

/// Runs `muster status`.
fn status(arguments: &[String]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_muster"));
    // Nobody listens there.
    command.env("http_proxy", "http://127.0.0.1:1");
    command.arg("status").args(arguments).output().unwrap()
}

/// Parses a page of metrics. Asserts that each metric has a description and a type.
fn samples(page: &str) -> BTreeMap<&str, f64> {
    assert!(page.ends_with("# EOF\n"), "{page}");
    let mut samples = BTreeMap::new();
    for line in page.lines().filter(|line| !line.starts_with('#')) {
        let (name, value) = line.rsplit_once(' ').unwrap();
        let bare = name.split('{').next().unwrap();
        let described = bare.strip_suffix("_total").unwrap_or(bare);
        for keyword in ["HELP", "TYPE"] {
            let description = format!("# {keyword} {described} ");
            assert!(page.contains(&description), "{description} is missing");
        }
        let is_first = samples.insert(name, value.parse().unwrap()).is_none();
        assert!(is_first, "{name} appears twice");
    }
    samples
}

fn assert_is(samples: &BTreeMap<&str, f64>, name: &str, value: f64) {
    let found = samples.get(name).copied();
    assert_eq!(found, Some(value), "{name}: {samples:#?}");
}

fn junk(fleet: &Fleet, to: u32, datagrams: usize) {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    for _ in 0..datagrams {
        socket.send_to(&[0xee; 200], fleet.address(to)).unwrap();
    }
}

fn dropped(status: &Value, reason: &str) -> u64 {
    status["frames"]["dropped"][reason].as_u64().unwrap_or(0)
}

#[test]
fn drones_in_flight_report_metrics_status_and_dropped_frames() {
    let fleet = Fleet::new();
    let mut drones = fleet.fly();
    let in_flight = json!({ "State": { "MovingToWaypoint": { "waypoint": 1 } } });
    drones[0].wait_for_mission(&in_flight);

    for id in 0..5 {
        let (code, page) = fleet.get(id, "/metrics");
        assert_eq!(code, 200);
        let samples = samples(&page);
        let leads = id == MASTER;
        let of = |holds: bool| if holds { 1.0 } else { 0.0 };
        assert_is(&samples, "muster_role{role=\"master\"}", of(leads));
        assert_is(&samples, "muster_role{role=\"member\"}", of(!leads));
        assert_is(&samples, "muster_hops", of(!leads));
        assert_is(&samples, "muster_ballot_master", MASTER.into());
        assert_is(&samples, "muster_ballot_term", 1.0);
        assert_is(&samples, "muster_neighbours", 4.0);
        assert_is(&samples, "muster_healthy", 1.0);
        assert_is(&samples, "muster_armed", 1.0);
        assert_is(&samples, "muster_journal_incarnation", 1.0);
        for actor in ["radio", "routing", "mission", "navigation", "msp"] {
            let of_actor = |name: &str| format!("muster_actor_{name}{{actor=\"{actor}\"}}");
            assert_is(&samples, &of_actor("up"), 1.0);
            assert_is(&samples, &of_actor("restarts_total"), 0.0);
            assert!(samples[&*of_actor("queue_depth")] <= samples[&*of_actor("queue_limit")]);
        }
        let states: f64 = (samples.iter())
            .filter_map(|(name, value)| name.starts_with("muster_state{").then_some(value))
            .sum();
        assert!((states - 1.0).abs() < 1e-9, "{samples:#?}");
        assert!(samples["muster_altitude_meters"] > 5.0, "{samples:#?}");
        assert!(samples["muster_frames_let_in_total{kind=\"tree\"}"] > 10.0);
        assert_eq!(fleet.get(id, "/health"), (200, "healthy\n".to_owned()));
    }
    assert_eq!(fleet.get(0, "/elsewhere").0, 404);

    let before = fleet.status(0);
    junk(&fleet, 0, 100);
    let expected = dropped(&before, "other_version") + 100;
    fleet.wait_for_status(0, "all junk dropped", |status| {
        dropped(status, "other_version") == expected
    });

    let files: Vec<_> = (0..5)
        .map(|id| fleet.file(id).display().to_string())
        .collect();
    let run = status(&files);
    let table = String::from_utf8(run.stdout).unwrap();
    assert!(run.status.success(), "{table}");
    assert!(table.contains("▸ 2"), "{table}");
    let mut arguments: Vec<_> = (0..5).map(|id| fleet.address(id)).collect();
    arguments.push("--json".to_owned());
    let run = status(&arguments);
    let answers: Value = serde_json::from_slice(&run.stdout).unwrap();
    let answers = answers["drones"].as_array().unwrap();
    let numbers: Vec<_> = answers
        .iter()
        .map(|it| it["status"]["drone"].as_u64())
        .collect();
    assert_eq!(numbers, [0, 1, 2, 3, 4].map(Some));

    drones[4].signal("STOP");
    let run = status(&files);
    assert_eq!(run.status.code(), Some(1));
    let table = String::from_utf8(run.stdout).unwrap();
    assert!(table.contains("no answer"), "{table}");
    drones[4].signal("CONT");
}

#[test]
fn unread_log_does_not_stop_a_drone_and_lost_lines_are_counted() {
    let fleet = Fleet::new();
    replace(
        &fleet.file(1),
        "log = \"json\"",
        "log = \"json\"\nlog_level = \"debug\"",
    );
    let mut command = Command::new(&*super::fleet::MUSTERD);
    command.arg("--config").arg(fleet.file(1));
    let mut drone = command.stderr(Stdio::piped()).spawn().unwrap();
    let began = Instant::now();
    while TcpStream::connect(fleet.address(1)).is_err() {
        assert!(
            began.elapsed() < Duration::from_secs(60),
            "it does not start"
        );
        std::thread::sleep(Duration::from_millis(10));
    }
    fleet.wait_for_status(1, "log lines lost", |status| {
        junk(&fleet, 1, 200);
        status["log_lines_lost"].as_u64() > Some(0)
    });
    assert_eq!(fleet.get(1, "/health").0, 200);

    // Once the log is read, the kept lines and the last line arrive.
    let mut errors = drone.stderr.take().unwrap();
    let reader = std::thread::spawn(move || {
        let mut output = String::new();
        errors.read_to_string(&mut output).map(|_| output)
    });
    let pid = drone.id();
    let mut kill = Command::new("sh");
    assert!(
        kill.args(["-c", &format!("kill -TERM {pid}")])
            .status()
            .unwrap()
            .success()
    );
    assert_eq!(drone.wait().unwrap().code(), Some(0));
    let output = reader.join().unwrap().unwrap();
    let last: Value = serde_json::from_str(output.lines().last().unwrap()).unwrap();
    assert_eq!(last["message"], "counted", "{last}");
    assert!(last["lines_lost"].as_u64() > Some(0), "{last}");
}

#[test]
fn idle_connections_are_closed_and_others_are_answered() {
    let fleet = Fleet::new();
    let mut drone = fleet.start(3, &[]);
    drone.wait_for("ready", |line| line["message"] == "ready");
    let mut idle: Vec<_> = (0..20)
        .map(|_| TcpStream::connect(fleet.address(3)).unwrap())
        .collect();
    assert_eq!(fleet.status(3)["drone"], 3);
    for stream in &mut idle {
        stream
            .set_read_timeout(Some(Duration::from_secs(60)))
            .unwrap();
        let mut rest = Vec::new();
        // Closed or reset.
        if let Err(error) = stream.read_to_end(&mut rest) {
            assert_ne!(error.kind(), std::io::ErrorKind::WouldBlock);
        }
        assert!(rest.is_empty(), "{rest:?}");
    }
}

#[test]
fn unusable_targets_of_status_are_refused() {
    let fleet = Fleet::new();
    let refused = |argument: String, expected: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_muster"));
        assert_refused(command.arg("status").arg(argument), expected);
    };
    refused(
        "nobody".to_owned(),
        "neither a file nor a folder nor an address",
    );
    let empty = fleet.path("empty");
    std::fs::create_dir(&empty).unwrap();
    refused(empty.display().to_string(), "not the folder of a flight");
    let text = std::fs::read_to_string(fleet.file(1)).unwrap();
    let (quiet, _) = text.split_once("[observe]").unwrap();
    std::fs::write(fleet.file(1), quiet).unwrap();
    refused(fleet.file(1).display().to_string(), "no table `[observe]`");

    // An unused address: a row, and exit code 1.
    let run = status(&[fleet.address(1)]);
    assert_eq!(run.status.code(), Some(1));
    let table = String::from_utf8(run.stdout).unwrap();
    assert!(table.contains("no answer"), "{table}");

    // The address for the status is in use.
    let taken = TcpListener::bind(fleet.address(2)).unwrap();
    let mut command = Command::new(&*super::fleet::MUSTERD);
    command.arg("--config").arg(fleet.file(2));
    let run = command.output().unwrap();
    let output = String::from_utf8(run.stderr).unwrap();
    assert_eq!(run.status.code(), Some(1), "{output}");
    assert!(output.contains("can't listen at"), "{output}");
    drop(taken);
}
