//! A controller that answers as a test tells it to.

use std::fs::File;
use std::io::{Read, Write};
use std::net::TcpListener;
use std::os::fd::OwnedFd;
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread;
use std::time::Instant;

use muster_msp::{
    ApiVersion, Attitude, BoardInfo, BoxIds, Decode, Decoder, Direction, FcVariant, FcVersion,
    Frame, Letters, Message, Mode, ReceivedRc, Status, StatusHead, acknowledge, encode, refuse,
    reply,
};
use muster_port::Address;

/// What a controller does with the bytes that it reads.
#[derive(Clone, Copy)]
pub(crate) struct Manner {
    /// How many questions it answers; it always takes RC.
    pub(crate) answers_max: usize,
    /// Written before each answer.
    pub(crate) noise: &'static [u8],
    /// Closes the first connection after so many frames.
    pub(crate) frames_max: usize,
    /// How many statuses say that it is armed.
    pub(crate) armed_statuses: usize,
}

pub(crate) const KIND: Manner = Manner {
    answers_max: usize::MAX,
    noise: b"",
    frames_max: usize::MAX,
    armed_statuses: 0,
};

/// What a controller has read.
#[derive(Default)]
pub(crate) struct Seen {
    pub(crate) rc: Vec<(Instant, ReceivedRc)>,
    pub(crate) commands: Vec<u16>,
    /// Bytes that are in no frame.
    pub(crate) noise: u64,
    pub(crate) connections: usize,
}

pub(crate) struct Controller {
    pub(crate) address: Address,
    seen: Arc<Mutex<Seen>>,
}

impl Controller {
    /// One that listens on TCP. Its thread ends with the test's process.
    pub(crate) fn on_tcp(manner: Manner) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let address = format!("tcp:{}", listener.local_addr().expect("it is bound"));
        let controller = Self {
            address: address.parse().expect("a port"),
            seen: Arc::default(),
        };
        let seen = controller.seen.clone();
        thread::spawn(move || {
            for stream in listener.incoming() {
                let stream = stream.expect("a connection");
                let mut manner = manner;
                if locked(&seen).connections > 0 {
                    manner.frames_max = usize::MAX;
                }
                serve(stream.try_clone().expect("a handle"), stream, manner, &seen);
            }
        });
        controller
    }

    /// One behind a serial line.
    pub(crate) fn on_a_serial_line(manner: Manner) -> Self {
        let flags = rustix::pty::OpenptFlags::RDWR | rustix::pty::OpenptFlags::NOCTTY;
        let near: OwnedFd = rustix::pty::openpt(flags).expect("a pty");
        rustix::pty::grantpt(&near).expect("a pty");
        rustix::pty::unlockpt(&near).expect("a pty");
        let name = rustix::pty::ptsname(&near, Vec::new()).expect("a pty");
        let name = name.into_string().expect("UTF-8");
        // Kept open: a line without a reader ends.
        let far = File::open(&name).expect("a pty");
        let controller = Self {
            address: format!("serial:{name}").parse().expect("a port"),
            seen: Arc::default(),
        };
        let seen = controller.seen.clone();
        thread::spawn(move || {
            let near = File::from(near);
            serve(near.try_clone().expect("a handle"), near, manner, &seen);
            drop(far);
        });
        controller
    }

    pub(crate) fn with_seen<T>(&self, look: impl FnOnce(&Seen) -> T) -> T {
        look(&locked(&self.seen))
    }
}

fn locked(seen: &Mutex<Seen>) -> MutexGuard<'_, Seen> {
    seen.lock().expect("no thread panics while it looks")
}

fn serve(mut from: impl Read, mut to: impl Write, manner: Manner, seen: &Mutex<Seen>) {
    locked(seen).connections += 1;
    let mut decoder = Decoder::default();
    let mut buffer = [0; 256];
    let (mut frames, mut answers, mut noise) = (0, 0, 0);
    while let Ok(length @ 1..) = from.read(&mut buffer) {
        let mut out = Vec::new();
        decoder.read(&buffer[..length], |frame| {
            frames += 1;
            let mut seen = locked(seen);
            seen.commands.push(frame.command);
            if frame.command == ReceivedRc::COMMAND {
                let received = ReceivedRc::decode(frame.payload).expect("RC");
                seen.rc.push((Instant::now(), received));
                acknowledge(frame.version, frame.command, &mut out).expect("v1");
            } else if answers < manner.answers_max {
                answers += 1;
                out.extend(manner.noise);
                let asked = seen.commands.iter().filter(|it| **it == Status::COMMAND);
                answer(&frame, asked.count() <= manner.armed_statuses, &mut out);
            }
        });
        locked(seen).noise += decoder.counts().noise_bytes - noise;
        noise = decoder.counts().noise_bytes;
        if to.write_all(&out).is_err() || frames >= manner.frames_max {
            return;
        }
    }
}

fn answer(question: &Frame<'_>, is_armed: bool, out: &mut Vec<u8>) {
    let version = question.version;
    match question.command {
        ApiVersion::COMMAND => reply(version, &ApiVersion::default(), out),
        FcVariant::COMMAND => {
            let variant = Letters(*b"BTFL");
            reply(version, &FcVariant { variant }, out)
        }
        FcVersion::COMMAND => reply(version, &FcVersion::default(), out),
        BoardInfo::COMMAND => reply(version, &BoardInfo::default(), out),
        BoxIds::COMMAND => boxes(question, out),
        Status::COMMAND => reply(version, &status(is_armed), out),
        Attitude::COMMAND => reply(version, &ATTITUDE, out),
        other => refuse(version, other, out),
    }
    .expect("it fits");
}

/// The mode ARM is the first one.
fn status(is_armed: bool) -> Status {
    let head = StatusHead {
        modes: u32::from(is_armed),
        ..StatusHead::default()
    };
    Status {
        head,
        ..Status::default()
    }
}

pub(crate) const ATTITUDE: Attitude = Attitude {
    roll_ddeg: 12,
    pitch_ddeg: -34,
    yaw_deg: 56,
};

/// 33 modes: 32 on the first page.
fn boxes(question: &Frame<'_>, out: &mut Vec<u8>) -> Result<(), muster_msp::EncodeError> {
    let modes: Vec<u8> = match question.payload {
        [1] => vec![u8::from(Mode::MspOverride)],
        _ => (0..32).collect(),
    };
    let frame = Frame {
        version: question.version,
        direction: Direction::Reply,
        command: BoxIds::COMMAND,
        flag: 0,
        payload: &modes,
    };
    encode(&frame, out)
}
