//! Drones with simulated flight controllers, as processes in real time.

use std::fs;
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::Stdio;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread;
use std::time::{Duration, Instant};

use muster_controller::{Config, Contact, Controller, Settings, Truth};
use muster_daemon::control::{ActorFault, ControlMessage};
use muster_machines::node::Address;
use muster_machines::time::Timestamp;
use muster_msp::{Channel, Decode, Decoder, Message, ReceivedRc};
use muster_scenarios::scenario;
use serde_json::json;

use super::fleet::{Fleet, Process, SCENARIO, assert_refused, replace};
use super::flights::{common_ballot, others, state};
use super::swarm::{scenario_with, wait_until};

const DRONES: u32 = 3;
/// The first leader of three drones in line.
const LEADER: u32 = 1;
/// Longest wait for bytes.
const PAUSE: Duration = Duration::from_millis(10);

/// A simulated controller on TCP, and the RC frames that it received. Its thread ends with the test's process.
struct Receiver {
    address: String,
    seen: Arc<Mutex<Seen>>,
}

struct Seen {
    started: Instant,
    controller: Controller,
    rc: Vec<(Instant, ReceivedRc)>,
}

impl Receiver {
    fn start(config: Config) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = format!("tcp:{}", listener.local_addr().unwrap());
        let seen = Arc::new(Mutex::new(Seen {
            started: Instant::now(),
            controller: Controller::new(config, 1, Timestamp::ZERO),
            rc: Vec::new(),
        }));
        let served = Arc::clone(&seen);
        thread::spawn(move || {
            for stream in listener.incoming() {
                // A killed process resets its connection.
                let _ = serve(&stream.unwrap(), &served);
            }
        });
        Self { address, seen }
    }

    fn seen(&self) -> MutexGuard<'_, Seen> {
        self.seen.lock().unwrap()
    }

    fn truth(&self) -> Truth {
        let mut seen = self.seen();
        let now = seen.now();
        seen.controller.aircraft(now)
    }

    fn received(&self) -> usize {
        self.seen().rc.len()
    }
}

impl Seen {
    fn now(&self) -> Timestamp {
        Timestamp::ZERO + self.started.elapsed()
    }
}

fn serve(mut stream: &TcpStream, seen: &Mutex<Seen>) -> std::io::Result<()> {
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(PAUSE))?;
    let mut decoder = Decoder::default();
    let mut buffer = [0; 1_024];
    loop {
        let length = match stream.read(&mut buffer) {
            Ok(0) => return Ok(()),
            Ok(length) => length,
            Err(error) if error.kind() == ErrorKind::WouldBlock => 0,
            Err(error) => return Err(error),
        };
        let at = Instant::now();
        let mut seen = seen.lock().unwrap();
        decoder.read(&buffer[..length], |frame| {
            if frame.command == ReceivedRc::COMMAND {
                let rc = ReceivedRc::decode(frame.payload).unwrap();
                seen.rc.push((at, rc));
            }
        });
        let now = seen.now();
        seen.controller.receive(now, &buffer[..length]);
        let replies = seen.controller.transmit(now);
        let due = seen.controller.next_event();
        drop(seen);
        stream.write_all(&replies)?;
        let wait = due.map_or(PAUSE, |due| due.since(now).min(PAUSE));
        stream.set_read_timeout(Some(wait.max(Duration::from_millis(1))))?;
    }
}

/// Three drones of a fleet, each with a receiver where it starts.
fn controlled(mission: &str, settings: impl Fn(u32) -> Settings) -> (Fleet, Vec<Receiver>) {
    let fleet = Fleet::new();
    let missions = [("hop.waypoints", mission)];
    let folder = fleet.file(0);
    let folder = folder.parent().unwrap();
    let path = scenario_with("swarm-controllers.toml", &missions, folder);
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, text + "\n[limits]\nrestarts_max = 100\n").unwrap();
    let plan = scenario::load(&path, &[]).unwrap().plan;
    let places = (0..DRONES).zip(plan.start_positions());
    let receivers = places.map(|(id, place)| {
        let mut config = Config::new(plan.home, settings(id));
        config.place = place;
        let receiver = Receiver::start(config);
        let vehicle = format!(
            "vehicle = \"msp\"\nport = \"{}\"\nreceiver = \"sole\"",
            receiver.address
        );
        replace(&fleet.file(id), "vehicle = \"closed-form\"", &vehicle);
        replace(&fleet.file(id), SCENARIO, path.to_str().unwrap());
        receiver
    });
    let receivers = receivers.collect();
    (fleet, receivers)
}

fn fly(fleet: &Fleet) -> Vec<Process> {
    let arguments = |id| if id == LEADER { &["--fly"][..] } else { &[] };
    (0..DRONES)
        .map(|id| fleet.start(id, arguments(id)))
        .collect()
}

fn landing() -> Settings {
    let mut settings = Settings::fit();
    settings.failsafe.landing_s = 20;
    settings
}

#[test]
fn controller_of_a_killed_leader_lands_it_and_the_others_finish() {
    let (fleet, receivers) = controlled("hop.waypoints", |_| landing());
    let mut drones = fly(&fleet);
    let leader = &mut drones[LEADER as usize];
    leader.wait_for_mission(&json!({ "Opened": { "waypoint": 1 } }));
    let port = fleet.status(LEADER)["port"].clone();
    assert_eq!(port["state"], "open", "{port}");
    assert!(port["rc_per_s"].as_u64() >= Some(30), "{port}");
    let (_, metrics) = fleet.get(LEADER, "/metrics");
    assert!(metrics.contains("muster_port_state{state=\"open\"} 1"));
    leader.signal("KILL");
    assert_eq!(leader.end(), None);
    let lost = &receivers[LEADER as usize];
    let truth = lost.truth();
    assert!(truth.is_armed && truth.contact == Contact::Airborne);
    wait_until("the failsafe has landed it", || !lost.truth().is_armed);

    for (id, drone) in others(&mut drones, LEADER) {
        assert_eq!(drone.end(), Some(0), "drone {id}");
        let over = json!({ "Landing": "MissionOver" });
        assert!(drone.missions().contains(&over), "drone {id}");
    }
    for receiver in &receivers {
        let truth = receiver.truth();
        assert_eq!(truth.contact, Contact::Ground);
        assert!(!truth.is_armed);
    }
    let survivors: Vec<_> = others(&mut drones, LEADER).map(|(_, it)| &*it).collect();
    assert!(common_ballot(&survivors)["term"].as_u64() > Some(1));
}

/// Drones 0 and 2 are in the stage `bench`; the board of drone 1, in the stage `sim`, doesn't say that it is a simulation.
#[test]
fn neither_a_bench_drone_nor_a_board_that_is_no_simulation_is_armed() {
    let (fleet, receivers) = controlled("hop.waypoints", |id| Settings {
        says_simulator: id != LEADER,
        ..Settings::fit()
    });
    for id in [0, 2] {
        replace(&fleet.file(id), "stage = \"sim\"", "stage = \"bench\"");
    }
    let mut drones = fly(&fleet);
    for (drone, receiver) in drones.iter_mut().zip(&receivers) {
        drone.wait_for_mission(&state("TakingOff"));
        let before = receiver.received();
        // Six seconds at 50 Hz: a controller arms five seconds after its start.
        wait_until("RC goes on", || receiver.received() >= before + 300);
    }
    for (id, receiver) in (0..).zip(&receivers) {
        assert!(!receiver.truth().is_armed, "drone {id}");
        let (low, centre) = (Channel::LOW.us(), Channel::CENTRE.us());
        for (_, rc) in &receiver.seen().rc {
            // Roll, pitch, throttle, yaw, AUX1.
            let idle = [centre, centre, low, centre, low];
            assert_eq!(rc.channels_us[..5], idle, "drone {id}");
        }
    }
}

#[test]
fn serial_port_is_refused_in_the_stage_sim() {
    let (fleet, _receivers) = controlled("hop.waypoints", |_| Settings::fit());
    replace(
        &fleet.file(0),
        "port = \"tcp:",
        "port = \"serial:/dev/ttyACM0\" # ",
    );
    let expected = "in the stage \"sim\" `port` needs \"tcp:HOST:PORT\"";
    assert_refused(&mut fleet.command(0), expected);
}

/// Keeps every core busy until it is dropped.
struct Load(Arc<AtomicBool>);

impl Load {
    fn start() -> Self {
        let is_over = Arc::new(AtomicBool::new(false));
        for _ in 0..thread::available_parallelism().unwrap().get() {
            let is_over = Arc::clone(&is_over);
            thread::spawn(move || {
                while !is_over.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            });
        }
        Self(is_over)
    }
}

impl Drop for Load {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// The longest gap between RC frames since a point in time. Prints it, and the gap that 99 of 100 don't exceed; this thread's
/// own delays are in both.
#[expect(clippy::print_stdout, reason = "a measurement")]
fn longest_gap(name: &str, receiver: &Receiver, since: Instant) -> Duration {
    let seen = receiver.seen();
    let times = seen.rc.iter().map(|(at, _)| *at);
    let times: Vec<_> = times.filter(|at| *at >= since).collect();
    let mut gaps: Vec<_> = times.windows(2).map(|it| it[1] - it[0]).collect();
    gaps.sort();
    let (p99, max) = (gaps[gaps.len() * 99 / 100], gaps[gaps.len() - 1]);
    println!("{name}: {} gaps, p99 {p99:?}, max {max:?}", gaps.len());
    max
}

/// For 30 s each: with every core busy; and with the msp actor crashed every 3 s, too.
#[test]
fn armed_controller_gets_rc_in_time_while_cores_are_busy_and_the_msp_actor_crashes() {
    let (fleet, receivers) = controlled("ferry.waypoints", |_| landing());
    let mut command = fleet.command(LEADER);
    command
        .args(["--fly", "--controlled"])
        .stdin(Stdio::piped());
    let _others = [0, 2].map(|id| fleet.start(id, &[]));
    let mut leader = Process::start(LEADER, command);
    leader.wait_for_mission(&json!({ "Opened": { "waypoint": 1 } }));
    let receiver = &receivers[LEADER as usize];
    let _load = Load::start();
    let crash = ControlMessage::Inject {
        actor: Address::Msp,
        fault: ActorFault::Crashes,
    };
    for (name, crashes) in [("busy", false), ("busy, msp crashes", true)] {
        let since = Instant::now();
        for _ in 0..10 {
            if crashes {
                leader.control(&crash);
            }
            thread::sleep(Duration::from_secs(3));
        }
        let longest = longest_gap(name, receiver, since);
        assert!(receiver.truth().is_armed && receiver.truth().contact == Contact::Airborne);
        assert!(longest < Duration::from_millis(100), "{name}");
    }
    let restarts = &fleet.status(LEADER)["actors"]["msp"]["restarts"];
    assert_eq!(restarts.as_u64(), Some(10));
}
