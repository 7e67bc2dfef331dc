//! A lidar's serial port.

use std::io;
use std::path::Path;
use std::time::Duration;

use muster_indoor::reading::{Echo, Mounting, Reading};
use muster_indoor::sensor::Source;
use serial2::SerialPort;

use super::decoder::{Counts, Decoder, Packet};

/// Speed of the port. Source: *LD19 Development Manual*, section 3.1.
const BAUD: u32 = 230_400;
/// How long a read waits if nothing is there: the shortest that the system's timer can.
const WAIT: Duration = Duration::from_millis(1);
/// Most bytes of a read: a third of a second at 4,500 ranges a second. More waits for the next read.
const BYTES_MAX: usize = 8_192;
/// Two turns at 10 Hz.
const USED: Duration = Duration::from_millis(200);
/// Weaker echoes are mostly dust and edges.
const CONFIDENCE_MIN: u8 = 15;

/// An LD06 or LD19 on a serial port.
#[derive(Debug)]
pub struct Ld19 {
    port: SerialPort,
    mounting: Mounting,
    decoder: Decoder,
}

impl Ld19 {
    /// Opens a port. `mounting` is the lidar's place, the direction of its arrow, and its ranges (LD19: 0.03 to 12 m).
    ///
    /// # Errors
    /// If the port can't be opened.
    pub fn open(device: &Path, mounting: Mounting) -> io::Result<Self> {
        let mut port = SerialPort::open(device, BAUD)?;
        port.set_read_timeout(WAIT)?;
        Ok(Self {
            port,
            mounting,
            decoder: Decoder::default(),
        })
    }

    /// What came in so far.
    #[must_use]
    pub fn counts(&self) -> Counts {
        self.decoder.counts()
    }
}

impl Source for Ld19 {
    type Error = io::Error;

    /// Waits at most a millisecond.
    fn read(&mut self, now: Duration, readings: &mut Vec<Reading>) -> io::Result<()> {
        let mut bytes = [0; BYTES_MAX];
        let length = match self.port.read(&mut bytes) {
            Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
            Ok(length) => length,
            Err(error) if is_nothing(&error) => return Ok(()),
            Err(error) => return Err(error),
        };
        let mounting = self.mounting;
        self.decoder.feed(&bytes[..length], |packet| {
            readings.extend(of_packet(&packet, mounting, now));
        });
        Ok(())
    }
}

fn is_nothing(error: &io::Error) -> bool {
    use io::ErrorKind::{Interrupted, TimedOut, WouldBlock};
    matches!(error.kind(), Interrupted | TimedOut | WouldBlock)
}

fn of_packet(packet: &Packet, mounting: Mounting, now: Duration) -> impl Iterator<Item = Reading> {
    packet.points.into_iter().map(move |point| {
        let clockwise_rad = (f64::from(point.angle_cdeg) / 100.0).to_radians();
        Reading {
            mounting: Mounting {
                bearing_rad: mounting.bearing_rad - clockwise_rad,
                aperture_rad: 0.0,
                ..mounting
            },
            echo: match point.range_mm {
                0 => Echo::Silence,
                _ if point.confidence < CONFIDENCE_MIN => Echo::Failed,
                range_mm => Echo::At(f64::from(range_mm) / 1_000.0),
            },
            taken: now,
            expires: now + USED,
        }
    })
}
