//! The aircraft of a firmware in real time: 1,000 steps a second.

use std::io;
use std::net::{Ipv4Addr, UdpSocket};
use std::sync::{Mutex, Weak};
use std::thread;
use std::time::{Duration, Instant};

use muster_controller::{InLoop, MOTORS_BYTES, Truth};
use muster_machines::time::Timestamp;
use muster_port::raise_priority;

/// Where the firmware takes the aircraft's state, and where it sends its motors'.
const STATE: (Ipv4Addr, u16) = (Ipv4Addr::LOCALHOST, 9003);
const MOTORS: (Ipv4Addr, u16) = (Ipv4Addr::LOCALHOST, 9002);
/// From one state to the next.
const STEP: Duration = Duration::from_millis(1);

/// Opens the socket to the firmware in this thread's network.
pub(super) fn open() -> io::Result<UdpSocket> {
    let socket = UdpSocket::bind(MOTORS)?;
    socket.set_nonblocking(true)?;
    Ok(socket)
}

/// Moves an aircraft, and shows the truth about it, until `shown` is dropped. `started`: its time zero.
pub(super) fn run(
    mut aircraft: InLoop,
    shown: &Weak<Mutex<Truth>>,
    started: Instant,
    socket: &UdpSocket,
) {
    // Without it a busy machine looks like a lost sensor.
    let _ = raise_priority();
    let mut packet = [0; MOTORS_BYTES + 1];
    let mut due = Instant::now();
    while let Some(shown) = shown.upgrade() {
        let now = Timestamp::ZERO + started.elapsed();
        while let Ok(length) = socket.recv(&mut packet) {
            aircraft.receive(now, &packet[..length]);
        }
        // A state that the firmware misses is followed by the next.
        drop(socket.send_to(&aircraft.transmit(now), STATE));
        // A thread that looks has a lower priority and may be kept waiting while it holds the lock.
        if let Ok(mut shown) = shown.try_lock() {
            *shown = aircraft.aircraft(now);
        }
        drop(shown);
        due = (due + STEP).max(Instant::now());
        thread::sleep(due.saturating_duration_since(Instant::now()));
    }
}
