//! The aircraft of a firmware in real time: 1,000 steps a second.
//!
//! A board doesn't stand still, but a firmware on a busy host does at times, and so does the thread of its aircraft. An aircraft
//! that went on with the motors' last duties would tip over. So it waits.

use std::io;
use std::net::{Ipv4Addr, UdpSocket};
use std::sync::{Mutex, Weak};
use std::thread;
use std::time::{Duration, Instant};

use muster_controller::{InLoop, MOTORS_BYTES, Truth};
use muster_machines::time::Timestamp;
use muster_port::raise_priority;
use muster_scenarios::report::FirmwareStalls;

/// Where the firmware takes the aircraft's state, and where it sends its motors'.
const STATE: (Ipv4Addr, u16) = (Ipv4Addr::LOCALHOST, 9003);
const MOTORS: (Ipv4Addr, u16) = (Ipv4Addr::LOCALHOST, 9002);
/// From one state to the next.
const STEP: Duration = Duration::from_millis(1);
/// Time without motors from which on the firmware stands still. In twelve flights on a calm host it was 17 ms at most.
const STALL_MIN: Duration = Duration::from_millis(20);
/// The aircraft waits no longer than this: a firmware that is gone doesn't keep it in the air.
const WAIT_MAX: Duration = Duration::from_millis(500);

/// What is seen of an aircraft.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen {
    pub(super) truth: Truth,
    /// How often its firmware stood still.
    pub(super) stalls: FirmwareStalls,
}

/// The clock of an aircraft, which stands still while its firmware does.
#[derive(Debug, Default)]
struct Pace {
    /// The aircraft's time.
    now: Timestamp,
    /// Real time of the last step.
    at: Duration,
    /// Real time of the newest motors. `None` before the first.
    motors_at: Option<Duration>,
    is_still: bool,
    stalls: FirmwareStalls,
}

impl Pace {
    /// The aircraft's time at a real time. `has_motors`: motors have come since the last step. `turns`: some motor turns.
    fn step(&mut self, at: Duration, has_motors: bool, turns: bool) -> Timestamp {
        let passed = at.saturating_sub(self.at);
        self.at = at;
        let silent = self.motors_at.map_or(Duration::ZERO, |it| at - it);
        let is_stall = turns && silent >= STALL_MIN;
        if is_stall {
            self.stalls.note(!self.is_still, silent);
        }
        self.is_still = is_stall && !has_motors;
        if has_motors {
            self.motors_at = Some(at);
        }
        self.now += match turns {
            true if self.is_still && silent < WAIT_MAX => Duration::ZERO,
            true => passed.min(STALL_MIN),
            false => passed,
        };
        self.now
    }
}

/// Opens the socket to the firmware in this thread's network.
pub(super) fn open() -> io::Result<UdpSocket> {
    let socket = UdpSocket::bind(MOTORS)?;
    socket.set_nonblocking(true)?;
    Ok(socket)
}

/// Moves an aircraft, and shows the truth about it, until `seen` is dropped. `started`: its time zero.
pub(super) fn run(
    mut aircraft: InLoop,
    seen: &Weak<Mutex<Seen>>,
    started: Instant,
    socket: &UdpSocket,
) {
    // Without it a busy machine looks like a lost sensor.
    let _ = raise_priority();
    let mut packet = [0; MOTORS_BYTES + 1];
    let (mut pace, mut turns) = (Pace::default(), false);
    let mut due = Instant::now();
    while let Some(seen) = seen.upgrade() {
        let mut newest = None;
        while let Ok(length) = socket.recv(&mut packet) {
            newest = Some(length);
        }
        let now = pace.step(started.elapsed(), newest.is_some(), turns);
        if let Some(length) = newest {
            aircraft.receive(now, &packet[..length]);
        }
        // A state that the firmware misses is followed by the next.
        drop(socket.send_to(&aircraft.transmit(now), STATE));
        let truth = aircraft.aircraft(now);
        turns = truth.is_armed;
        // A thread that looks has a lower priority and may be kept waiting while it holds the lock.
        if let Ok(mut seen) = seen.try_lock() {
            *seen = Seen {
                truth,
                stalls: pace.stalls,
            };
        }
        drop(seen);
        due = (due + STEP).max(Instant::now());
        thread::sleep(due.saturating_duration_since(Instant::now()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(it: u64) -> Duration {
        Duration::from_millis(it)
    }

    /// Real time goes on to `until` in steps of 1 ms; motors come with each, or not at all. Returns the aircraft's time.
    fn pass(pace: &mut Pace, until: u64, has_motors: bool, turns: bool) -> Duration {
        while pace.at < ms(until) {
            pace.step(pace.at + STEP, has_motors, turns);
        }
        pace.now.since(Timestamp::ZERO)
    }

    fn assert_stall(pace: &Pace, longest_s: f64) {
        assert_eq!(pace.stalls.count, 1);
        assert!((pace.stalls.longest_s - longest_s).abs() < 1e-9);
    }

    #[test]
    fn aircraft_waits_for_a_firmware_that_stands_still_in_flight() {
        let mut pace = Pace::default();
        assert_eq!(pass(&mut pace, 100, true, true), ms(100));
        assert_eq!(pass(&mut pace, 400, false, true), ms(119));
        assert_eq!(pass(&mut pace, 500, true, true), ms(219));
        assert_stall(&pace, 0.301);
    }

    #[test]
    fn aircraft_flies_on_without_a_firmware_that_is_gone() {
        let mut pace = Pace::default();
        pass(&mut pace, 100, true, true);
        assert_eq!(pass(&mut pace, 1_100, false, true), ms(620));
        assert_stall(&pace, 1.0);
    }

    #[test]
    fn aircraft_waits_where_its_own_thread_stood_still() {
        let mut pace = Pace::default();
        pass(&mut pace, 100, true, true);
        let now = pace.step(ms(300), false, true);
        assert_eq!(now.since(Timestamp::ZERO), ms(100));
        assert_eq!(pass(&mut pace, 400, true, true), ms(200));
        assert_stall(&pace, 0.201);
    }

    #[test]
    fn nothing_waits_on_the_ground() {
        let mut pace = Pace::default();
        pass(&mut pace, 100, true, false);
        let now = pace.step(ms(300), false, false);
        assert_eq!(now.since(Timestamp::ZERO), ms(300));
        assert_eq!(pass(&mut pace, 400, false, false), ms(400));
        pass(&mut pace, 500, true, false);
        assert_eq!(pace.stalls, FirmwareStalls::default());
    }
}
