//! A simulated flight controller that notes when RC frames come.

use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread;
use std::time::{Duration, Instant};

use muster_controller::{CHANNELS, Config, Controller, Truth};
use muster_machines::time::Timestamp;
use muster_msp::{Decode, Decoder, Message, ReceivedRc};
use rustix::thread::{CpuSet, sched_setaffinity};
use thread_priority::{
    RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id,
};

/// Longest wait for bytes.
const PAUSE: Duration = Duration::from_millis(10);

/// How often [`Stalls`] looks.
const WAKES_EVERY: Duration = Duration::from_millis(5);
/// Shorter delays are the scheduler's.
const STALL_MIN: Duration = Duration::from_millis(10);

/// A simulated controller on TCP, and the RC frames that it received. Its thread ends with the test's process. It has real-time
/// priority if the system grants it, as its delays are in what it measures.
pub(super) struct Receiver {
    pub(super) address: String,
    seen: Arc<Mutex<Seen>>,
}

pub(super) struct Seen {
    started: Instant,
    controller: Controller,
    pub(super) rc: Vec<(Instant, ReceivedRc)>,
}

impl Receiver {
    pub(super) fn start(config: Config) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = format!("tcp:{}", listener.local_addr().unwrap());
        let seen = Arc::new(Mutex::new(Seen {
            started: Instant::now(),
            controller: Controller::new(config, 1, Timestamp::ZERO),
            rc: Vec::new(),
        }));
        let served = Arc::clone(&seen);
        thread::spawn(move || {
            raise_priority(50);
            for stream in listener.incoming() {
                // A killed process resets its connection.
                let _ = serve(&stream.unwrap(), &served);
            }
        });
        Self { address, seen }
    }

    pub(super) fn seen(&self) -> MutexGuard<'_, Seen> {
        self.seen.lock().unwrap()
    }

    pub(super) fn truth(&self) -> Truth {
        let mut seen = self.seen();
        let now = seen.now();
        seen.controller.aircraft(now)
    }

    /// The pilot's sticks and switches: roll, pitch, yaw, throttle, ARM, ANGLE, MSP OVERRIDE.
    pub(super) fn pilot(&self, channels: [u16; 7]) {
        let mut all = [1_000; CHANNELS];
        all[..7].copy_from_slice(&channels);
        let mut seen = self.seen();
        let now = seen.now();
        seen.controller.pilot(now, Some(&all));
    }

    pub(super) fn received(&self) -> usize {
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
        if let Some(answer) = command_line(&buffer[..length]) {
            stream.write_all(answer.as_bytes())?;
            continue;
        }
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

/// What the command line says to a line, or to what opens it. The simulated controller has none: it has the settings that
/// [`Settings::fit_overriding`](muster_controller::Settings::fit_overriding) stands for.
fn command_line(said: &[u8]) -> Option<String> {
    let name = match std::str::from_utf8(said).ok()? {
        "#" => return Some("Entering CLI Mode\r\n# ".to_owned()),
        "exit noreboot\n" => return Some(String::new()),
        line => line.strip_prefix("get ")?.trim_end(),
    };
    let value = match name {
        "msp_override_channels_mask" => "15",
        "msp_override_failsafe" => "OFF",
        "angle_feedforward" => "0",
        _ => return None,
    };
    // It echoes what it reads.
    Some(format!("get {name}\r\n{name} = {value}\r\n\r\n# "))
}

/// Asks for real time for this thread. Returns whether it was granted; without it the measured delays are longer.
fn raise_priority(priority: u8) -> bool {
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    let priority = ThreadPriorityValue::try_from(priority).unwrap();
    let priority = ThreadPriority::Crossplatform(priority);
    set_thread_priority_and_policy(thread_native_id(), priority, policy).is_ok()
}

/// When each processor stood still: a virtual one may not run for a tenth of a second, which explains a gap that no program on it
/// can help. A thread of the highest priority here wakes on it every 5 ms and sees it. None are seen if the system grants no real
/// time.
pub(super) struct Stalls(Vec<Arc<Mutex<Intervals>>>);

/// Beginnings and ends.
type Intervals = Vec<(Instant, Instant)>;

impl Stalls {
    /// Looks for them until the test's process ends.
    pub(super) fn watch() -> Self {
        let processors = 0..thread::available_parallelism().unwrap().get();
        let watch = processors.map(|processor| {
            let stalls = Arc::default();
            let seen = Arc::clone(&stalls);
            thread::spawn(move || {
                if is_alone_on(processor) {
                    watch(&seen);
                }
            });
            stalls
        });
        Self(watch.collect())
    }

    /// For how long a processor stood still between two moments; of the one that did for longest.
    pub(super) fn between(&self, [from, to]: [Instant; 2]) -> Duration {
        let still = self.0.iter().map(|stalls| {
            let stalls = stalls.lock().unwrap();
            let within = stalls
                .iter()
                .map(|(began, end)| (*end).min(to).saturating_duration_since((*began).max(from)));
            within.sum()
        });
        still.max().unwrap_or_default()
    }
}

/// Asks for a priority above all others here, on one processor.
fn is_alone_on(processor: usize) -> bool {
    let mut set = CpuSet::new();
    set.set(processor);
    sched_setaffinity(None, &set).is_ok() && raise_priority(60)
}

fn watch(seen: &Mutex<Intervals>) -> ! {
    loop {
        let due = Instant::now() + WAKES_EVERY;
        thread::sleep(WAKES_EVERY);
        let woke = Instant::now();
        if woke.saturating_duration_since(due) >= STALL_MIN {
            seen.lock().unwrap().push((due, woke));
        }
    }
}
