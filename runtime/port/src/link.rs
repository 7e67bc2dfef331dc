//! A port for flying: one thread opens and reads, one writes on time.

mod armed_status;
mod events;
mod inbox;
mod rc_counts;

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use muster_msp::check::ReceiverMode;
use muster_msp::{Decoder, Message, SetRawRc, TICK};

pub use self::events::Event;
use self::inbox::Inbox;
use crate::address::Address;
use crate::fitness::{self, Look};
use crate::priority::raise_priority;
use crate::session::{AskError, Session};
use crate::status::Status;
use crate::wire::Wire;

/// How long a read waits.
const WAIT: Duration = Duration::from_millis(50);
/// First pause before a port is opened again; it doubles up to the last one.
pub(crate) const BACK_OFF_MIN: Duration = Duration::from_millis(100);
/// Longest pause before a port is opened again.
pub(crate) const BACK_OFF_MAX: Duration = Duration::from_secs(2);

/// A port that is kept open, with RC on time and telemetry beside it. Its threads end with it, and RC with them.
#[derive(Debug)]
pub struct Link {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

#[derive(Debug)]
struct Shared {
    started: Instant,
    stopped: AtomicBool,
    inbox: Mutex<Inbox>,
    arrived: Condvar,
}

impl Shared {
    fn now(&self) -> Duration {
        self.started.elapsed()
    }

    fn is_stopped(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }

    /// A thread that panicked left nothing half done: what is shared is replaced as a whole.
    fn inbox(&self) -> MutexGuard<'_, Inbox> {
        self.inbox.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Link {
    /// Starts to open a port, and keeps it open. Whenever it is opened, the controller is first looked at, whether it is fit to
    /// be flown in `mode`, unless it was armed when the port closed. The settings of one that is armed are looked at once it has
    /// landed. `None` looks at nothing.
    ///
    /// # Errors
    /// If the system starts no threads.
    pub fn start(address: Address, mode: Option<ReceiverMode>) -> io::Result<Self> {
        let shared = Arc::new(Shared {
            started: Instant::now(),
            stopped: AtomicBool::new(false),
            inbox: Mutex::new(Inbox::default()),
            arrived: Condvar::new(),
        });
        let mut link = Self {
            shared: shared.clone(),
            threads: Vec::new(),
        };
        let writer = shared.clone();
        let rc = thread::Builder::new().name("rc".into());
        link.threads.push(rc.spawn(move || write_on_time(&writer))?);
        let port = thread::Builder::new().name("port".into());
        link.threads
            .push(port.spawn(move || keep_open(&shared, &address, mode))?);
        Ok(link)
    }

    /// Gives the newest sticks and switches. They are repeated for [`RC_HOLD`](muster_msp::RC_HOLD) at most.
    pub fn set_channels(&self, channels: SetRawRc) {
        let now = self.shared.now();
        self.shared.inbox().conversation.set_channels(now, channels);
    }

    /// Whether the controller was armed when it told so last. `None` if it never has.
    #[must_use]
    pub fn is_armed(&self) -> Option<bool> {
        self.shared.inbox().is_armed()
    }

    /// Whether the controller is disarmed: it told so several times in a row, so that one false status does not count.
    #[must_use]
    pub fn is_disarmed(&self) -> bool {
        self.shared.inbox().is_disarmed()
    }

    /// Stops RC at once; the controller's failsafe acts.
    pub fn release(&self) {
        self.shared.inbox().conversation.release();
    }

    /// State of the link.
    #[must_use]
    pub fn status(&self) -> Status {
        self.shared.inbox().status(self.shared.now())
    }

    /// The next event; `None` if there is none in time.
    #[must_use]
    pub fn next_event(&self, timeout: Duration) -> Option<Event> {
        let shared = &self.shared;
        let none = |inbox: &mut Inbox| inbox.events.is_empty();
        let waited = shared
            .arrived
            .wait_timeout_while(shared.inbox(), timeout, none);
        let (mut inbox, _) = waited.unwrap_or_else(PoisonError::into_inner);
        inbox.events.pop()
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        self.shared.stopped.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            thread.thread().unpark();
            // A thread that panicked has said so on standard error.
            let _ = thread.join();
        }
    }
}

/// Opens the port whenever it is closed, and reads while it is open.
fn keep_open(shared: &Shared, address: &Address, mode: Option<ReceiverMode>) {
    let mut back_off = BACK_OFF_MIN;
    while !shared.is_stopped() {
        // It flies: RC must not wait, and its settings were looked at on the ground.
        let now_looked = mode.filter(|_| shared.inbox().is_armed() != Some(true));
        let error = match open(address, now_looked) {
            Ok((wire, look)) => {
                let (wire, now) = (Arc::new(wire), shared.now());
                shared.inbox().open(now, wire.clone(), look, mode.is_some());
                read_while_open(shared, &wire, &mut back_off)
            }
            Err(error) => Some(error),
        };
        if let Some(error) = error {
            shared.inbox().close(&error);
            shared.arrived.notify_all();
        }
        if !shared.is_stopped() {
            thread::park_timeout(back_off);
        }
        back_off = BACK_OFF_MAX.min(2 * back_off);
    }
}

/// Opens the port. Looks at the controller if there is a `mode`.
fn open(address: &Address, mode: Option<ReceiverMode>) -> io::Result<(Wire, Option<Look>)> {
    let Some(mode) = mode else {
        return Ok((Wire::open(address, WAIT)?, None));
    };
    let mut session = Session::open(address)?;
    let look = fitness::look(&mut session, mode).map_err(|error| match error {
        AskError::Port(error) => error,
        error => io::Error::new(io::ErrorKind::TimedOut, error),
    })?;
    session.wire.set_wait(WAIT)?;
    Ok((session.wire, Some(look)))
}

/// Returns why the port failed; `None` if the writer closed it, or the link ends.
fn read_while_open(shared: &Shared, wire: &Wire, back_off: &mut Duration) -> Option<io::Error> {
    let mut decoder = Decoder::default();
    let mut buffer = [0; 1024];
    while !shared.is_stopped() && shared.inbox().wire.is_some() {
        let length = match wire.read(&mut buffer) {
            Ok(length) => length,
            Err(error) => return Some(error),
        };
        let now = shared.now();
        let mut frames = 0;
        let mut take = |frame: muster_msp::Frame<'_>| {
            frames += 1;
            shared.inbox().take(now, &frame);
        };
        decoder.read(&buffer[..length], &mut take);
        decoder.expire(now, &mut take);
        if frames > 0 {
            *back_off = BACK_OFF_MIN;
            shared.arrived.notify_all();
        }
        shared.inbox().set_counts(decoder.counts());
    }
    None
}

/// Writes one command a tick.
fn write_on_time(shared: &Shared) {
    let is_realtime = raise_priority();
    shared.inbox().set_realtime(is_realtime);
    let mut bytes = Vec::new();
    let mut due = Instant::now();
    while !shared.is_stopped() {
        let write = shared.inbox().tick(shared.now());
        if let Some((wire, write)) = write {
            bytes.clear();
            write.encode(&mut bytes);
            let result = wire.write(&bytes);
            shared.inbox().written(shared.now(), &wire, &write, result);
        }
        due += TICK;
        let now = Instant::now();
        match due.checked_duration_since(now) {
            Some(pause) => thread::sleep(pause),
            // The system held it up: no burst of what was missed.
            None => due = now,
        }
    }
}

/// Number of the messages that acknowledge RC.
pub(crate) const RC: u16 = SetRawRc::COMMAND;
