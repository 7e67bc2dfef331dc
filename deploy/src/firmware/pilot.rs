//! A pilot with a transmitter, who arms the aircraft and gives the companion the sticks.

use std::io;
use std::net::{Ipv4Addr, UdpSocket};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

/// Where the firmware takes the pilot's channels.
const CHANNELS: (Ipv4Addr, u16) = (Ipv4Addr::LOCALHOST, 9004);
/// From one packet to the next.
const PERIOD: Duration = Duration::from_millis(20);
/// When the pilot turns the transmitter on: the firmware forgets one that sends while it starts.
const ON_AFTER: Duration = Duration::from_secs(3);
/// When the pilot arms, after the firmware's time of grace.
const ARMS_AFTER: Duration = Duration::from_secs(10);
/// Roll, pitch, throttle, yaw, ARM, ANGLE, MSP OVERRIDE in µs: at rest, then armed under override.
const AT_REST: [u16; 7] = [1_500, 1_500, 1_000, 1_500, 1_000, 1_800, 1_000];
const GIVEN: [u16; 7] = [1_500, 1_500, 1_000, 1_500, 1_800, 1_800, 1_800];

/// A transmitter.
#[derive(Debug)]
pub(super) struct Radio(UdpSocket);

impl Radio {
    /// Opens its socket in this thread's network.
    pub(super) fn open() -> io::Result<Self> {
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
        socket.connect(CHANNELS)?;
        Ok(Self(socket))
    }

    pub(super) fn run(&self, is_over: &AtomicBool) {
        let started = Instant::now();
        while !is_over.load(Ordering::Relaxed) {
            let passed = started.elapsed();
            if passed >= ON_AFTER {
                let sticks = if passed < ARMS_AFTER { AT_REST } else { GIVEN };
                // A packet that is lost is followed by the next.
                drop(self.0.send(&packet(passed, sticks)));
            }
            thread::sleep(PERIOD);
        }
    }
}

/// A time as `f64` seconds and 16 channels as `u16`, little-endian.
fn packet(time: Duration, sticks: [u16; 7]) -> Vec<u8> {
    let channels = sticks.into_iter().chain([1_000; 9]);
    let mut packet = time.as_secs_f64().to_le_bytes().to_vec();
    packet.extend(channels.flat_map(u16::to_le_bytes));
    packet
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_packet_has_a_time_and_sixteen_channels() {
        let packet = packet(Duration::from_secs(2), GIVEN);
        assert_eq!(packet.len(), 8 + 2 * 16);
        assert_eq!(packet[8..10], 1_500_u16.to_le_bytes());
    }
}
