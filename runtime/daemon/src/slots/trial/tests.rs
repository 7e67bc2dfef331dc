use std::collections::BTreeSet;
use std::fs;
use std::io::{Read, Write};
use std::net::{IpAddr, Ipv4Addr, TcpListener};
use std::os::unix::fs::symlink;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use muster_machines::mission::State;
use tempfile::TempDir;

use super::super::disk::Disk;
use super::super::flight::tests::fly;
use super::super::gate::GateLimits;
use super::super::systemd::Systemd;
use super::*;

/// A host in a folder, with a `systemctl` that does as it is told and drones that say that they are healthy.
struct Bench {
    folder: TempDir,
    host: Host,
    address: SocketAddr,
    in_flight: Arc<AtomicBool>,
}

impl Bench {
    /// A host without a slot.
    fn empty() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let systemctl = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/slots/trial/systemctl");
        let program = folder.path().join("systemctl");
        symlink(systemctl, &program).unwrap();
        let disk = Disk::at(&folder.path().join("host"));
        disk.create().unwrap();
        let in_flight = Arc::new(AtomicBool::new(false));
        Self {
            host: Host {
                disk,
                systemd: Systemd { program },
            },
            address: answer(Arc::clone(&in_flight)),
            in_flight,
            folder,
        }
    }

    /// A host with the good slot `a`, which has these drones.
    fn with_good(drones: &[u32]) -> Self {
        let bench = Self::empty();
        bench.install("a", drones);
        assert!(bench.try_slot("a"), "{:?}", bench.host.disk.failure());
        let _ = fs::remove_file(bench.folder.path().join("log"));
        bench
    }

    fn install(&self, slot: &str, drones: &[u32]) {
        let incoming = self.host.disk.new_incoming().unwrap();
        fs::create_dir(incoming.join("config")).unwrap();
        for name in [DRONES, BOOT] {
            fs::write(incoming.join(name), slot).unwrap();
        }
        let facts = SlotFacts {
            version: slot.to_owned(),
            release: String::new(),
            configuration: String::new(),
            wire: vec![1],
            journal: vec![1],
            drones: drones.iter().map(|id| (*id, self.address)).collect(),
            peers: BTreeSet::new(),
            gate: GateLimits {
                within_s: 1,
                hold_s: 0,
            },
            network: None,
        };
        fs::write(
            incoming.join("slot.json"),
            serde_json::to_vec(&facts).unwrap(),
        )
        .unwrap();
        for drone in drones {
            fly(&incoming.join("config"), *drone, State::Start);
        }
        self.host.disk.finish_incoming(&slot.to_owned()).unwrap();
    }

    /// As the service of a trial does.
    fn try_slot(&self, slot: &str) -> bool {
        let is_good = run(&self.host, &slot.to_owned()).unwrap();
        settle(&self.host).unwrap();
        is_good
    }

    fn log(&self) -> String {
        fs::read_to_string(self.folder.path().join("log")).unwrap_or_default()
    }

    /// A service that runs, with a process of no slot unless it is another one.
    fn set_running(&self, drone: u32, process: u32) {
        let name = format!("unit-{}", service(drone));
        let text = format!("ActiveState=active\nMainPID={process}\n");
        fs::write(self.folder.path().join(name), text).unwrap();
    }

    fn end(&self, drone: u32) {
        let name = format!("unit-{}", service(drone));
        fs::remove_file(self.folder.path().join(name)).unwrap();
    }

    /// Tries a slot that may not be tried.
    #[track_caller]
    fn assert_refuses(&self, slot: &str, drone: u32) {
        let before = self.host.disk.slots().unwrap().current;
        let refused = run(&self.host, &slot.to_owned()).unwrap_err().to_string();
        let expected = format!(
            "drone {drone} runs already and may be in flight; once it has landed, stop it on the host: systemctl stop {}",
            service(drone)
        );
        assert_eq!(refused, expected);
        assert_eq!(
            start(&self.host, &slot.to_owned()).unwrap_err().to_string(),
            expected
        );
        assert_eq!(self.host.disk.slots().unwrap().current, before);
        assert_eq!(self.log(), "", "systemd is asked for nothing");
    }

    /// Lets systemd refuse orders that fit a pattern.
    fn refuse(&self, pattern: &str) {
        fs::write(self.folder.path().join("refused"), pattern).unwrap();
    }

    fn unit(&self, name: &str) -> String {
        fs::read_to_string(self.host.disk.unit(name)).unwrap_or_default()
    }

    fn is_enabled(&self, drone: u32) -> bool {
        let name = format!("enabled-{}", service(drone));
        self.folder.path().join(name).exists()
    }

    #[track_caller]
    fn assert_runs(&self, slot: &str) {
        let slots = self.host.disk.slots().unwrap();
        assert_eq!(slots.current.as_deref(), Some(slot));
        assert_eq!(slots.good.as_deref(), Some(slot));
        assert_eq!(
            (self.unit(DRONES), self.unit(BOOT)),
            (slot.into(), slot.into())
        );
    }
}

/// Where nobody listens.
const NO_PEER: SocketAddr = SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), 1);

/// Answers as drones do.
fn answer(in_flight: Arc<AtomicBool>) -> SocketAddr {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let address = listener.local_addr().unwrap();
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            let mut stream = stream.unwrap();
            let _ = stream.read(&mut [0; 1_024]);
            let in_flight = in_flight.load(Ordering::Relaxed);
            let _ = write!(
                stream,
                "HTTP/1.0 200 OK\r\n\r\n{{\"faults\":[],\"in_flight\":{in_flight}}}"
            );
        }
    });
    address
}

#[test]
fn slot_is_enabled_before_it_is_good() {
    let bench = Bench::with_good(&[0]);
    bench.install("b", &[0, 1]);
    assert!(bench.try_slot("b"));
    bench.assert_runs("b");
    let log = bench.log();
    assert!(
        log.contains("good=a boot=b: enable musterd@1.service"),
        "{log}"
    );
}

#[test]
fn slot_that_can_not_be_enabled_is_taken_back() {
    let bench = Bench::with_good(&[0]);
    bench.install("b", &[0, 1]);
    bench.refuse("^enable musterd@1");
    assert!(!bench.try_slot("b"));
    bench.assert_runs("a");
    let failure = bench.host.disk.failure().unwrap();
    assert!(
        failure.why.contains("enable musterd@1.service failed"),
        "{failure:?}"
    );
}

#[test]
fn slot_under_which_no_service_starts_is_taken_back() {
    let bench = Bench::with_good(&[0]);
    bench.install("b", &[0]);
    bench.refuse("restart");
    assert!(!run(&bench.host, &"b".to_owned()).unwrap_or(false));
    bench.refuse("^$");
    settle(&bench.host).unwrap();
    bench.assert_runs("a");
    let failure = bench.host.disk.failure().unwrap();
    assert!(
        failure.why.contains("restart musterd@0.service failed"),
        "{failure:?}"
    );
}

#[test]
fn boot_goes_back_by_the_good_slot_while_another_is_on_trial() {
    let bench = Bench::with_good(&[0]);
    bench.install("b", &[0]);
    assert!(bench.try_slot("b"));
    let log = bench.log();
    assert!(
        log.contains("good=a boot=a: --no-block restart musterd@0.service"),
        "{log}"
    );
}

#[test]
fn settling_restores_the_units_of_the_good_slot() {
    let bench = Bench::with_good(&[0]);
    for name in [DRONES, BOOT] {
        fs::write(bench.host.disk.unit(name), "of a slot that failed").unwrap();
    }
    settle(&bench.host).unwrap();
    bench.assert_runs("a");
    assert!(bench.log().contains("daemon-reload"));
}

#[test]
fn settling_enables_and_starts_what_a_power_cut_left_disabled() {
    let bench = Bench::with_good(&[0]);
    let name = format!("enabled-{}", service(0));
    fs::remove_file(bench.folder.path().join(name)).unwrap();
    settle(&bench.host).unwrap();
    assert!(bench.is_enabled(0));
    assert!(bench.log().contains("--no-block start musterd@0.service"));
}

#[test]
fn settling_leaves_a_running_trial_alone() {
    let bench = Bench::with_good(&[0]);
    bench.install("b", &[0]);
    let trial = bench.host.disk.try_lock(LOCK).unwrap();
    bench.host.disk.reach(&Goal::Try("b".to_owned())).unwrap();
    settle(&bench.host).unwrap();
    assert!(bench.host.disk.slots().unwrap().is_on_trial());
    drop(trial);
    settle(&bench.host).unwrap();
    bench.assert_runs("a");
}

#[test]
fn drone_that_moved_away_is_stopped_and_comes_back_with_its_slot() {
    let bench = Bench::with_good(&[0, 1]);
    bench.install("b", &[0]);
    assert!(bench.try_slot("b"));
    let log = bench.log();
    assert!(
        log.contains("stop musterd@1.service") && !bench.is_enabled(1),
        "{log}"
    );
    roll_back(&bench.host).unwrap();
    bench.assert_runs("a");
    assert!(bench.is_enabled(1));
}

#[test]
fn drones_of_a_failed_slot_that_the_good_one_has_not_are_stopped() {
    let bench = Bench::with_good(&[0]);
    bench.install("b", &[0, 1]);
    bench.refuse("^enable musterd@0");
    assert!(!bench.try_slot("b"));
    bench.assert_runs("a");
    let log = bench.log();
    assert!(
        log.contains("stop musterd@1.service") && !bench.is_enabled(1),
        "{log}"
    );
}

#[test]
fn nothing_is_tried_or_taken_back_while_a_drone_is_in_flight() {
    let bench = Bench::with_good(&[0]);
    bench.install("b", &[0]);
    assert!(bench.try_slot("b"));
    bench.install("c", &[0]);
    bench.in_flight.store(true, Ordering::Relaxed);
    assert!(!bench.try_slot("c"));
    assert_eq!(bench.host.disk.failure(), None, "it is deferred");
    let refused = roll_back(&bench.host).unwrap_err().to_string();
    assert!(
        refused.contains("drone 0 takes part in a flight"),
        "{refused}"
    );
    bench.assert_runs("b");
    assert!(bench.host.disk.slots().unwrap().rollback_slot().is_some());
}

#[test]
fn drone_in_flight_that_does_not_answer_is_not_killed() {
    let mut bench = Bench::with_good(&[0]);
    bench.address = NO_PEER;
    bench.install("b", &[0]);
    bench.host.disk.reach(&Goal::Try("b".to_owned())).unwrap();
    fly(
        &bench.host.disk.slot("b").join("config"),
        0,
        State::TakingOff,
    );
    let drone = (0, bench.address);
    assert!(!kill_unless_in_flight(&bench.host, "b", drone).unwrap());
    assert!(!bench.log().contains("kill"), "{}", bench.log());
    fly(
        &bench.host.disk.slot("b").join("config"),
        0,
        State::Finished,
    );
    assert!(kill_unless_in_flight(&bench.host, "b", drone).unwrap());
}

#[test]
fn first_slot_is_not_tried_while_a_drone_started_by_hand_may_be_in_flight() {
    let mut bench = Bench::empty();
    let answering = bench.address;
    bench.address = NO_PEER;
    bench.install("a", &[0]);
    // The test's own program, and none: systemd starts it again.
    for process in [std::process::id(), 0] {
        bench.set_running(0, process);
        bench.assert_refuses("a", 0);
    }
    bench.address = answering;
    bench.install("b", &[0]);
    bench.in_flight.store(true, Ordering::Relaxed);
    bench.assert_refuses("b", 0);
    bench.in_flight.store(false, Ordering::Relaxed);
    assert!(bench.try_slot("b"), "it has said that it is not in flight");
    bench.assert_runs("b");
}

#[test]
fn first_slot_is_tried_once_the_drone_started_by_hand_has_ended() {
    let bench = Bench::empty();
    bench.install("a", &[0]);
    bench.set_running(0, std::process::id());
    bench.in_flight.store(true, Ordering::Relaxed);
    bench.assert_refuses("a", 0);
    bench.in_flight.store(false, Ordering::Relaxed);
    bench.end(0);
    assert!(bench.try_slot("a"));
    bench.assert_runs("a");
}

#[test]
fn slot_with_another_drone_is_not_tried_while_that_one_runs_by_hand() {
    let mut bench = Bench::with_good(&[0]);
    bench.address = NO_PEER;
    bench.install("b", &[0, 1]);
    bench.set_running(1, std::process::id());
    bench.assert_refuses("b", 1);
}

#[test]
fn silent_drone_of_a_slot_is_judged_by_its_journal_and_another_is_not_killed() {
    let mut bench = Bench::with_good(&[0]);
    bench.address = NO_PEER;
    bench.install("b", &[0]);
    let slot = bench.host.disk.slot("b");
    fly(&slot.join("config"), 0, State::Finished);
    bench.set_running(0, std::process::id());
    let drone = (0, bench.address);
    assert!(!kill_unless_in_flight(&bench.host, "b", drone).unwrap());
    assert_eq!(bench.log(), "");
    let program = slot.join("musterd");
    let copy = "cp \"$(command -v sleep)\" \"$0\"";
    let copied = Command::new("sh").args(["-c", copy]).arg(&program).status();
    assert!(copied.unwrap().success());
    let mut process = Command::new(&program).arg("60").spawn().unwrap();
    bench.set_running(0, process.id());
    let was_killed = kill_unless_in_flight(&bench.host, "b", drone);
    process.kill().unwrap();
    process.wait().unwrap();
    assert!(was_killed.unwrap());
}

#[test]
fn unit_that_was_put_on_a_host_by_hand_stays_until_a_slot_runs() {
    let bench = Bench::empty();
    let unit = bench.host.disk.unit(DRONES);
    fs::create_dir_all(unit.parent().unwrap()).unwrap();
    fs::write(&unit, "by hand").unwrap();
    settle(&bench.host).unwrap();
    assert_eq!(fs::read_to_string(&unit).unwrap(), "by hand");
    bench.install("a", &[0]);
    assert!(bench.try_slot("a"));
    assert_ne!(fs::read_to_string(&unit).unwrap(), "by hand");
}
