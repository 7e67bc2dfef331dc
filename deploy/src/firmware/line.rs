//! The line between a companion and a firmware, and the RC that passes on it.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::Mutex;
use std::thread;
use std::time::Instant;

use muster_controller::{RcFrames, Sticks};
use muster_machines::time::Timestamp;
use muster_msp::{Decode, Decoder, Direction, Message, ReceivedRc};

use super::{MSP, Network};
use crate::controller::lock;

/// Bytes that are passed on at once.
const CHUNK: usize = 4_096;

/// A line to a firmware. That doesn't tell which RC frames it gets, so they are looked at on their way.
#[derive(Debug)]
pub(super) struct Line {
    started: Instant,
    seen: Mutex<Seen>,
}

/// RC frames that have passed.
#[derive(Debug, Default)]
struct Seen {
    frames: RcFrames,
    /// `None` before the first.
    throttle_us: Option<u16>,
}

/// An RC frame that has passed, and its throttle.
type Passed = (Timestamp, u16);

impl Line {
    pub(super) fn new() -> Self {
        Self {
            started: Instant::now(),
            seen: Mutex::default(),
        }
    }

    fn now(&self) -> Timestamp {
        Timestamp::ZERO + self.started.elapsed()
    }

    /// What RC said since the last call. `None` before the first frame.
    pub(super) fn take_sticks(&self) -> Option<Sticks> {
        let mut seen = lock(&self.seen);
        let throttle_us = seen.throttle_us?;
        let rc_gap = seen.frames.take_gap(self.now());
        Some(Sticks {
            throttle_us,
            rc_gap,
        })
    }

    /// Carries bytes until either end is closed.
    pub(super) fn carry(&self, network: &Network, companion: &TcpStream) -> io::Result<()> {
        companion.set_nonblocking(false)?;
        let firmware = network.inside(|| TcpStream::connect(MSP))?;
        for stream in [companion, &firmware] {
            stream.set_nodelay(true)?;
        }
        // The other direction ends with one.
        let end = || {
            for stream in [companion, &firmware] {
                drop(stream.shutdown(Shutdown::Both));
            }
        };
        thread::scope(|scope| {
            scope.spawn(|| {
                drop(io::copy(&mut &firmware, &mut &*companion));
                end();
            });
            let passed = self.pass_on(companion, &firmware);
            end();
            passed
        })
    }

    /// Passes a companion's bytes on, and sees RC frames in them.
    fn pass_on(&self, mut companion: impl Read, mut firmware: impl Write) -> io::Result<()> {
        let mut decoder = Decoder::default();
        let mut passed = Vec::new();
        let mut bytes = [0; CHUNK];
        loop {
            let length = match companion.read(&mut bytes) {
                Ok(0) => return Ok(()),
                Ok(length) => length,
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(error) => return Err(error),
            };
            firmware.write_all(&bytes[..length])?;
            let now = self.now();
            decoder.read(&bytes[..length], |frame| {
                if (frame.direction, frame.command) == (Direction::Request, ReceivedRc::COMMAND)
                    && let Ok(rc) = ReceivedRc::decode(frame.payload)
                {
                    passed.push((now, rc.channels_us[2]));
                }
            });
            self.show(&mut passed);
        }
    }

    /// Notes what has passed. A thread that looks has a lower priority and may be kept waiting while it holds the lock: then it
    /// is noted with the next.
    fn show(&self, passed: &mut Vec<Passed>) {
        let Ok(mut seen) = self.seen.try_lock() else {
            return;
        };
        for (now, throttle_us) in passed.drain(..) {
            seen.frames.count(now);
            seen.throttle_us = Some(throttle_us);
        }
    }
}

#[cfg(test)]
mod tests {
    use muster_msp::{Channel, SetRawRc, Sticks as SentSticks, Version, order};

    use super::*;

    #[test]
    fn bytes_pass_unchanged_and_rc_in_them_is_seen() {
        let mut bytes = b"noise".to_vec();
        let sticks = SentSticks {
            throttle: Channel::new(1_234).unwrap(),
            ..SentSticks::IDLE
        };
        let rc = SetRawRc::new(sticks, &[Channel::LOW]).unwrap();
        order(Version::V1, &rc, &mut bytes).unwrap();
        bytes.extend(b"more");
        let line = Line::new();
        assert_eq!(line.take_sticks(), None);
        let mut firmware = Vec::new();
        line.pass_on(&bytes[..], &mut firmware).unwrap();
        assert_eq!(firmware, bytes);
        let seen = line.take_sticks().unwrap();
        assert_eq!(seen.throttle_us, 1_234);
        assert!(seen.rc_gap.is_some());
    }
}
