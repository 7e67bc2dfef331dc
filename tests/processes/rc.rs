//! RC frames at a flight controller's receiver come on time, whatever goes wrong beside them.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use muster_controller::Contact;
use muster_daemon::control::{ActorFault, ControlMessage};
use muster_machines::node::Address;
use serde_json::json;

use super::controllers::{LEADER, controlled, landing};
use super::fleet::{Fleet, Process};
use super::receiver::{Receiver, Stalls};
use super::swarm::wait_until;

/// Environment variable with the length of each phase, in seconds.
const PHASE: &str = "MUSTER_RC_PHASE_S";
/// Its default. Take-off and all phases together last a minute.
const PHASE_S: u64 = 15;
/// From one crash of an actor to its next.
const CRASH_EVERY: Duration = Duration::from_secs(3);

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

/// Builds a library that makes a process's syncs slow, counts them, and can make its main thread hang. Returns its path.
pub(super) fn disturb(folder: &Path) -> PathBuf {
    let library = folder.join("disturb.so");
    let source = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/processes/disturb.c");
    let mut compiler = Command::new("cc");
    compiler.args(["-shared", "-fPIC", "-o"]).arg(&library);
    assert!(compiler.arg(source).status().unwrap().success());
    library
}

pub(super) fn start(fleet: &Fleet, id: u32, environment: &[(&str, &Path)]) -> Process {
    let mut command = fleet.command(id);
    command.arg("--controlled").stdin(Stdio::piped());
    command.args((id == LEADER).then_some("--fly"));
    command.envs(environment.iter().copied());
    Process::start(id, command)
}

/// Waits for the length of a phase. Meanwhile each of these actors crashes every [`CRASH_EVERY`].
fn crash(process: &mut Process, actors: &[Address], phase: Duration) {
    let count = u32::try_from(actors.len()).unwrap().max(1);
    let mut next = actors.iter().cycle();
    let began = Instant::now();
    while began.elapsed() < phase {
        if let Some(actor) = next.next() {
            process.control(&ControlMessage::Inject {
                actor: *actor,
                fault: ActorFault::Crashes,
            });
        }
        thread::sleep(CRASH_EVERY / count);
    }
}

/// The gaps between RC frames in a phase.
struct Gaps {
    /// 99 of 100 don't exceed it.
    p99: Duration,
    /// The longest, but for the time for which a processor stood still meanwhile.
    longest: Duration,
}

#[expect(clippy::print_stdout, reason = "a measurement")]
fn gaps(name: &str, receiver: &Receiver, stalls: &Stalls, since: Instant) -> Gaps {
    // The controller waits while what it has seen is looked at.
    let mut times: Vec<_> = receiver.seen().rc.iter().map(|(at, _)| *at).collect();
    let before = times.partition_point(|at| *at < since);
    times.drain(..before.saturating_sub(1));
    times.push(Instant::now());
    let mut gaps: Vec<_> = times.windows(2).map(|it| [it[0], it[1]]).collect();
    let length = |[from, to]: [Instant; 2]| to - from;
    gaps.sort_by_key(|gap| length(*gap));
    let p99 = length(gaps[gaps.len() * 99 / 100]);
    let last = gaps[gaps.len() - 1];
    println!(
        "{name}: {} gaps, p99 {p99:?}, max {:?}, during which a processor stood still for {:?}",
        gaps.len(),
        length(last),
        stalls.between(last)
    );
    let own = gaps
        .iter()
        .map(|gap| length(*gap).saturating_sub(stalls.between(*gap)));
    let longest = own.max().unwrap_or_default();
    Gaps { p99, longest }
}

/// How long RC lasts from now on, when a hang is to end it.
fn rc_outlasts_hang(receiver: &Receiver) -> Duration {
    let (since, before) = (Instant::now(), receiver.received());
    let newest = receiver.seen().rc.last().map(|(at, _)| at.elapsed());
    assert!(newest < Some(Duration::from_millis(100)), "no RC before");
    let mut count = before;
    // Ten periods without a frame.
    let mut quiet = Instant::now();
    wait_until("RC ends", || {
        let now = receiver.received();
        if std::mem::replace(&mut count, now) != now {
            quiet = Instant::now();
        }
        quiet.elapsed() > Duration::from_millis(200)
    });
    let seen = receiver.seen();
    let last = seen.rc.last().map(|(at, _)| *at);
    last.map_or(Duration::ZERO, |at| at.saturating_duration_since(since))
}

/// The phases after take-off, and the actors that crash in each, every [`CRASH_EVERY`].
const PHASES: [(&str, &[Address]); 3] = [
    ("busy", &[]),
    (
        "other actors crash",
        &[
            Address::Radio,
            Address::Routing,
            Address::Mission,
            Address::Navigation,
        ],
    ),
    ("msp crashes", &[Address::Msp]),
];

/// The controller is still armed and in the air, and got RC in time since then.
fn assert_in_time(name: &str, receiver: &Receiver, stalls: &Stalls, since: Instant) {
    let gaps = gaps(name, receiver, stalls, since);
    let truth = receiver.truth();
    let flies = truth.is_armed && truth.contact == Contact::Airborne;
    assert!(flies, "{name}: {truth:?}");
    assert!(gaps.p99 <= Duration::from_millis(30), "{name}");
    let longest = gaps.longest;
    assert!(longest < Duration::from_millis(100), "{name}: {longest:?}");
}

/// Take-off and three phases with every core busy, while each sync of the leader's journal takes half a second more. At the end
/// the actor msp hangs in one process, and the main thread, on which all actors run, in another one.
#[test]
fn armed_controller_gets_rc_in_time_whatever_crashes_and_none_from_what_hangs() {
    let lasts = std::env::var(PHASE).map_or(PHASE_S, |text| text.parse().unwrap());
    let lasts = Duration::from_secs(lasts);
    let replacements = [
        ("hop.waypoints", "ferry.waypoints"),
        // A leg of 13 minutes.
        ("climb_mps = 3", "speed_mps = 3\nclimb_mps = 3"),
        ("[safety]", "[limits]\nrestart_window_s = 10\n\n[safety]"),
    ];
    let (fleet, receivers) = controlled(&replacements, |_| landing());
    let syncs = fleet.path("syncs");
    fs::write(&syncs, "").unwrap();
    let count_syncs = || fs::metadata(&syncs).unwrap().len();
    let (library, hang) = (disturb(&fleet.path("")), fleet.path("hang"));
    let environment = [
        ("LD_PRELOAD", &*library),
        ("SLOW_SYNC", &*syncs),
        ("HANG", &*hang),
    ];
    let (load, stalls) = (Load::start(), Stalls::watch());
    let mut others = [0, 2].map(|id| start(&fleet, id, &[]));
    let mut leader = start(&fleet, LEADER, &environment);
    let receiver = &receivers[LEADER as usize];
    wait_until("the leader is armed", || receiver.truth().is_armed);
    let (armed, before) = (Instant::now(), count_syncs());
    // It may no longer lead: while a sync lasts, what rests on it isn't sent.
    leader.wait_for_mission(&json!({ "State": { "MovingToWaypoint": { "waypoint": 1 } } }));
    assert_in_time("take-off", receiver, &stalls, armed);
    assert!(count_syncs() > before, "no sync was slow");
    for (name, actors) in PHASES {
        let since = Instant::now();
        crash(&mut leader, actors, lasts);
        assert_in_time(name, receiver, &stalls, since);
    }
    drop(load);
    let actors = &fleet.status(LEADER)["actors"];
    for address in Address::ALL {
        let restarts = actors[address.to_string()]["restarts"].as_u64();
        assert!(restarts >= Some(lasts.as_secs() / 3), "{address}: {actors}");
    }

    others[0].control(&ControlMessage::Inject {
        actor: Address::Msp,
        fault: ActorFault::Hangs(None),
    });
    let hung_actor = rc_outlasts_hang(&receivers[0]);
    fs::write(&hang, "").unwrap();
    let hung_process = rc_outlasts_hang(receiver);
    println!("RC of a hung actor: {hung_actor:?}, of a hung process: {hung_process:?}");
    assert!(hung_actor <= Duration::from_millis(150));
    assert!(hung_process <= Duration::from_millis(150));
}
