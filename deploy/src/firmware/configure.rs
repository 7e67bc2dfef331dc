//! Settings of a firmware, by its command line, and whether it takes RC. In its network.

use std::io::{self, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use muster_machines::msp::controller::Receiver;
use muster_msp::{Decode, Decoder, Message, Rc, SetRawRc, Sticks, Version, order, request};

use super::MSP;

/// How long an answer of the command line may take.
const ANSWERS_WITHIN: Duration = Duration::from_secs(3);
/// Time between two attempts to open the command line.
const ASKS_EVERY: Duration = Duration::from_millis(300);
/// How long RC may take to count.
const TAKES_RC_WITHIN: Duration = Duration::from_secs(4);
/// What ends an answer.
const PROMPT: &[u8] = b"\r\n# ";

/// MSP is the only receiver: ANGLE is on AUX2.
const SOLE: [&str; 1] = ["aux 1 1 1 1300 2100 0 0"];
/// A pilot's receiver: ANGLE is always on, AUX3 lets MSP replace roll, pitch, throttle and yaw.
const OVERRIDE: [&str; 4] = [
    "aux 1 1 1 900 2100 0 0",
    "aux 2 50 2 1700 2100 0 0",
    "set msp_override_channels_mask = 15",
    "set msp_override_failsafe = OFF",
];

/// The settings for a receiver: one command a line.
fn settings(receiver: Receiver) -> impl Iterator<Item = &'static str> {
    let lines = include_str!("settings.txt").lines().map(str::trim);
    let own: &[&str] = match receiver {
        Receiver::Sole => &SOLE,
        Receiver::Override => &OVERRIDE,
    };
    let lines = lines.filter(|line| !line.is_empty() && !line.starts_with('#'));
    lines.chain(own.iter().copied())
}

/// Sets the firmware up and saves that, which ends it.
pub(super) fn set_up(receiver: Receiver) -> io::Result<()> {
    let mut stream = connect()?;
    open_command_line(&mut stream)?;
    for line in settings(receiver) {
        stream.write_all(format!("{line}\n").as_bytes())?;
        let answer = answer(&mut stream)?;
        if answer.contains("###ERROR") || answer.contains("Invalid") {
            let message = format!("the firmware refuses `{line}`: {}", answer.trim());
            return Err(io::Error::other(message));
        }
    }
    stream.write_all(b"save\n")
}

/// Opens the command line by `#`. The firmware loses bytes until it has served its port once, so `#` is repeated. Repeated ones
/// that it got are a comment, which a last one ends.
fn open_command_line(stream: &mut TcpStream) -> io::Result<()> {
    let started = Instant::now();
    let mut answer = Vec::new();
    let mut asked = None;
    while !answer.windows(PROMPT.len()).any(|it| it == PROMPT) {
        if asked.is_none_or(|asked: Instant| asked.elapsed() > ASKS_EVERY) {
            if started.elapsed() > ANSWERS_WITHIN {
                return Err(no_answer());
            }
            stream.write_all(b"#")?;
            asked = Some(Instant::now());
        }
        read_into(stream, &mut answer)?;
    }
    stream.write_all(b"#\n")?;
    self::answer(stream).map(drop)
}

fn answer(stream: &mut TcpStream) -> io::Result<String> {
    let started = Instant::now();
    let mut answer = Vec::new();
    while !answer.ends_with(PROMPT) {
        if read_into(stream, &mut answer)? == 0 && started.elapsed() > ANSWERS_WITHIN {
            return Err(no_answer());
        }
    }
    Ok(String::from_utf8_lossy(&answer).into_owned())
}

fn no_answer() -> io::Error {
    let message = "the firmware's command line doesn't answer";
    io::Error::new(io::ErrorKind::TimedOut, message)
}

/// Whether the firmware shows the channels that it is told.
pub(super) fn takes_rc() -> io::Result<()> {
    let mut stream = connect()?;
    let idle = SetRawRc::new(Sticks::IDLE, &[]).expect("no channels beside the sticks");
    let mut frames = Vec::new();
    let framed = order(Version::V1, &idle, &mut frames);
    framed
        .and_then(|()| request::<Rc>(Version::V1, &mut frames))
        .expect("both fit into a frame");
    let started = Instant::now();
    let mut decoder = Decoder::default();
    let mut buffer = [0; 512];
    let mut is_taken = false;
    while !is_taken {
        if started.elapsed() > TAKES_RC_WITHIN {
            let message = "the firmware doesn't take RC frames";
            return Err(io::Error::new(io::ErrorKind::TimedOut, message));
        }
        stream.write_all(&frames)?;
        let length = read(&mut stream, &mut buffer)?;
        decoder.read(&buffer[..length], |frame| {
            let rc = (frame.command == Rc::COMMAND).then(|| Rc::decode(frame.payload));
            is_taken |= matches!(rc, Some(Ok(rc)) if rc.throttle_us == idle.sticks().throttle.us());
        });
    }
    Ok(())
}

fn connect() -> io::Result<TcpStream> {
    let stream = TcpStream::connect(MSP)?;
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(Duration::from_millis(20)))?;
    Ok(stream)
}

/// Appends what is there. Returns how much; 0 if nothing comes in time.
fn read_into(stream: &mut TcpStream, bytes: &mut Vec<u8>) -> io::Result<usize> {
    let mut buffer = [0; 512];
    let length = read(stream, &mut buffer)?;
    bytes.extend(&buffer[..length]);
    Ok(length)
}

/// Reads what is there; 0 if nothing comes in time.
fn read(stream: &mut TcpStream, buffer: &mut [u8]) -> io::Result<usize> {
    match stream.read(buffer) {
        Ok(0) => Err(io::ErrorKind::UnexpectedEof.into()),
        Err(error) if error.kind() == io::ErrorKind::WouldBlock => Ok(0),
        read => read,
    }
}
