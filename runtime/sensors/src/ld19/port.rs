//! A lidar's serial port.

use std::io;
use std::path::Path;
use std::time::Duration;

use muster_indoor::reading::{Mounting, Reading};
use muster_indoor::sensor::Source;
use serial2::SerialPort;

use super::decoder::{Counts, Decoder};
use super::readings;

/// Speed of the port. Source: *LD19 Development Manual*, section 3.1.
const BAUD: u32 = 230_400;
/// How long a read waits if nothing is there: the shortest that the system's timer can.
const WAIT: Duration = Duration::from_millis(1);
/// Most bytes of a read: 0.46 s at 4,500 ranges a second. More waits for the next read.
const BYTES_MAX: usize = 8_192;
/// Most bytes that the system hands out at once are twice as many. After so many there may be more, and newer ones.
const MORE: usize = 2_048;

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
        let length = self.take(&mut bytes)?;
        let mut packets = Vec::new();
        self.decoder
            .feed(&bytes[..length], |packet| packets.push(packet));
        readings.extend(readings::of_packets(&packets, self.mounting, now));
        Ok(())
    }
}

impl Ld19 {
    /// Reads what is there; how many bytes that were.
    fn take(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let mut length = 0;
        while length < bytes.len() {
            match self.port.read(&mut bytes[length..]) {
                Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
                Ok(more) => {
                    length += more;
                    if more < MORE {
                        break;
                    }
                }
                Err(error) if is_nothing(&error) => break,
                Err(error) => return Err(error),
            }
        }
        Ok(length)
    }
}

fn is_nothing(error: &io::Error) -> bool {
    use io::ErrorKind::{Interrupted, TimedOut, WouldBlock};
    matches!(error.kind(), Interrupted | TimedOut | WouldBlock)
}
