//! Bytes of a port to frames.

use std::time::Duration;

use crate::frame::{
    CRC8, Direction, FRAME_MAX, Frame, JUMBO, PAYLOAD_MAX, V2_INSIDE, Version, xor,
};

/// How long a frame may take from its first byte to its last. The longest takes 90 ms at 115,200 baud.
pub const FRAME_TIME_MAX: Duration = Duration::from_millis(100);

/// What a decoder has read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// Bytes given to it.
    pub bytes: u64,
    /// Frames that it yielded.
    pub frames: u64,
    /// Bytes that belong to no frame.
    pub noise_bytes: u64,
    /// `$` that no header follows.
    pub bad_header: u64,
    /// Frames with a payload over [`PAYLOAD_MAX`], or with sizes that contradict each other.
    pub bad_size: u64,
    /// Frames with a wrong checksum.
    pub bad_checksum: u64,
    /// Frames that took longer than [`FRAME_TIME_MAX`].
    pub late: u64,
}

impl Counts {
    /// Frames that were not understood.
    #[must_use]
    pub fn bad(&self) -> u64 {
        self.bad_header + self.bad_size + self.bad_checksum + self.late
    }
}

/// Finds frames in a stream of bytes.
///
/// What looked like a frame and isn't is scanned again from its second byte: a false header costs no later frame. It holds
/// at most [`FRAME_MAX`] bytes.
#[derive(Debug)]
pub struct Decoder {
    /// Empty, or a `$` and what came after it.
    held: Vec<u8>,
    /// How many bytes the next attempt needs.
    needed: usize,
    /// Where in the stream the held frame starts, and when it was first looked at.
    since: Option<(u64, Duration)>,
    counts: Counts,
}

/// The start of what is held.
enum Attempt {
    /// More bytes are needed to tell.
    Unfinished {
        needed: usize,
    },
    Whole(Found),
    Bad(Reason),
}

/// A whole frame at the start of what is held.
#[derive(Clone, Copy)]
struct Found {
    version: Version,
    direction: Direction,
    command: u16,
    flag: u8,
    /// Where the payload starts.
    start: usize,
    /// Where the payload ends.
    end: usize,
    /// Length of the frame.
    length: usize,
}

enum Reason {
    Header,
    Size,
    Checksum,
}

/// Length of the shortest frame without its checksum; enough to know the size of the others.
const HEADER: usize = 5;

impl Default for Decoder {
    fn default() -> Self {
        Self {
            held: Vec::with_capacity(FRAME_MAX),
            needed: HEADER,
            since: None,
            counts: Counts::default(),
        }
    }
}

impl Decoder {
    /// What it has read so far.
    #[must_use]
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// How many bytes of an unfinished frame are held, at most [`FRAME_MAX`].
    #[must_use]
    pub fn held(&self) -> usize {
        self.held.len()
    }

    /// Reads bytes; calls `take` with each frame that is now whole, in order.
    pub fn read(&mut self, bytes: &[u8], mut take: impl FnMut(Frame<'_>)) {
        for byte in bytes {
            self.counts.bytes += 1;
            if self.held.is_empty() && *byte != b'$' {
                self.counts.noise_bytes += 1;
                continue;
            }
            self.held.push(*byte);
            if self.held.len() >= self.needed || self.held.len() <= HEADER {
                self.scan(&mut take);
            }
        }
    }

    /// Gives up a frame that has taken too long, and scans what was held after its first byte: a false header may hold whole
    /// frames back. To call after each read, and while nothing is read. `now` is a duration since any start.
    pub fn expire(&mut self, now: Duration, mut take: impl FnMut(Frame<'_>)) {
        if self.held.is_empty() {
            return;
        }
        let start = self.counts.bytes - self.held.len() as u64;
        match self.since {
            Some((place, since)) if place == start => {
                if now.saturating_sub(since) >= FRAME_TIME_MAX {
                    self.counts.late += 1;
                    self.skip();
                    self.scan(&mut take);
                }
            }
            _ => self.since = Some((start, now)),
        }
    }

    /// Takes all frames and all noise from the start of what is held.
    fn scan(&mut self, take: &mut impl FnMut(Frame<'_>)) {
        while !self.held.is_empty() {
            match attempt(&self.held) {
                Attempt::Unfinished { needed } => {
                    self.needed = needed;
                    return;
                }
                Attempt::Whole(found) => {
                    self.counts.frames += 1;
                    take(Frame {
                        version: found.version,
                        direction: found.direction,
                        command: found.command,
                        flag: found.flag,
                        payload: &self.held[found.start..found.end],
                    });
                    self.held.drain(..found.length);
                    self.drop_noise();
                }
                Attempt::Bad(reason) => {
                    match reason {
                        Reason::Header => self.counts.bad_header += 1,
                        Reason::Size => self.counts.bad_size += 1,
                        Reason::Checksum => self.counts.bad_checksum += 1,
                    }
                    self.skip();
                }
            }
        }
        self.needed = HEADER;
    }

    /// Drops the `$` at the start, and what comes before the next.
    fn skip(&mut self) {
        self.held.remove(0);
        self.counts.noise_bytes += 1;
        self.drop_noise();
    }

    fn drop_noise(&mut self) {
        let noise = self.held.iter().position(|byte| *byte == b'$');
        let noise = noise.unwrap_or(self.held.len());
        self.counts.noise_bytes += noise as u64;
        self.held.drain(..noise);
    }
}

fn attempt(held: &[u8]) -> Attempt {
    let is_v2 = match held.get(1) {
        None => return Attempt::Unfinished { needed: HEADER },
        Some(b'M') => false,
        Some(b'X') => true,
        Some(_) => return Attempt::Bad(Reason::Header),
    };
    let direction = match held.get(2) {
        None => return Attempt::Unfinished { needed: HEADER },
        Some(byte) => Direction::from_byte(*byte),
    };
    match direction {
        None => Attempt::Bad(Reason::Header),
        Some(direction) if is_v2 => attempt_v2(held, direction),
        Some(direction) => attempt_v1(held, direction),
    }
}

fn attempt_v2(held: &[u8], direction: Direction) -> Attempt {
    let Some(header) = held.get(3..8) else {
        return Attempt::Unfinished { needed: 8 };
    };
    let size = usize::from(u16::from_le_bytes([header[3], header[4]]));
    if size > PAYLOAD_MAX {
        return Attempt::Bad(Reason::Size);
    }
    let length = 8 + size + 1;
    if held.len() < length {
        return Attempt::Unfinished { needed: length };
    }
    if CRC8.checksum(&held[3..length - 1]) != held[length - 1] {
        return Attempt::Bad(Reason::Checksum);
    }
    Attempt::Whole(Found {
        version: Version::V2,
        direction,
        command: u16::from_le_bytes([header[1], header[2]]),
        flag: header[0],
        start: 8,
        end: length - 1,
        length,
    })
}

fn attempt_v1(held: &[u8], direction: Direction) -> Attempt {
    let Some(&[size, command]) = held.get(3..5) else {
        return Attempt::Unfinished { needed: HEADER };
    };
    let (start, size) = match (size, held.get(5..7)) {
        (JUMBO, None) => return Attempt::Unfinished { needed: 7 },
        (JUMBO, Some(size)) => (7, usize::from(u16::from_le_bytes([size[0], size[1]]))),
        (size, _) => (5, usize::from(size)),
    };
    // A v2 header and its checksum may be in the payload.
    let size_max = PAYLOAD_MAX + if command == V2_INSIDE { 6 } else { 0 };
    if size > size_max || (command == V2_INSIDE && size < 6) {
        return Attempt::Bad(Reason::Size);
    }
    let end = start + size;
    let length = end + 1;
    if held.len() < length {
        return Attempt::Unfinished { needed: length };
    }
    if xor(&held[3..end]) != held[end] {
        return Attempt::Bad(Reason::Checksum);
    }
    let outer = Found {
        version: Version::V1,
        direction,
        command: command.into(),
        flag: 0,
        start,
        end,
        length,
    };
    if command == V2_INSIDE {
        attempt_inside(held, outer)
    } else {
        Attempt::Whole(outer)
    }
}

/// The v2 frame inside a v1 frame whose checksum is right.
fn attempt_inside(held: &[u8], outer: Found) -> Attempt {
    let body = &held[outer.start..outer.end];
    let size = usize::from(u16::from_le_bytes([body[3], body[4]]));
    if size + 6 != body.len() {
        return Attempt::Bad(Reason::Size);
    }
    if CRC8.checksum(&body[..5 + size]) != body[5 + size] {
        return Attempt::Bad(Reason::Checksum);
    }
    Attempt::Whole(Found {
        version: Version::V2OverV1,
        command: u16::from_le_bytes([body[1], body[2]]),
        flag: body[0],
        start: outer.start + 5,
        end: outer.end - 1,
        ..outer
    })
}
