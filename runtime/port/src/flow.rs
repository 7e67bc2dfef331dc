//! The port of an optical flow module, which speaks by itself.

use std::io;
use std::thread;
use std::time::{Duration, Instant};

use muster_msp::{Counts, Decoder, FlowReading};

use crate::address::Address;
use crate::link::{BACK_OFF_MAX, BACK_OFF_MIN};
use crate::wire::Wire;

/// How long a read waits.
const WAIT: Duration = Duration::from_millis(100);

/// An open port of an optical flow module. Nothing is written to it.
#[derive(Debug)]
pub struct FlowPort {
    wire: Wire,
    decoder: Decoder,
    opened: Instant,
}

impl FlowPort {
    /// Opens a port, for this process alone.
    ///
    /// # Errors
    /// If it can't be opened.
    pub fn open(address: &Address) -> io::Result<Self> {
        Ok(Self {
            wire: Wire::open(address, WAIT)?,
            decoder: Decoder::default(),
            opened: Instant::now(),
        })
    }

    /// Reads what has come; waits for up to 100 ms if nothing has. What is no measurement is left out.
    ///
    /// # Errors
    /// If the port fails. It must be opened again then.
    pub fn read(&mut self, mut take: impl FnMut(FlowReading)) -> io::Result<()> {
        let mut buffer = [0; 256];
        let length = self.wire.read(&mut buffer)?;
        let mut frame = |frame: muster_msp::Frame<'_>| {
            if let Some(reading) = FlowReading::read(&frame) {
                take(reading);
            }
        };
        self.decoder.read(&buffer[..length], &mut frame);
        self.decoder.expire(self.opened.elapsed(), &mut frame);
        Ok(())
    }

    /// What has been read, and what of it was noise.
    #[must_use]
    pub fn counts(&self) -> Counts {
        self.decoder.counts()
    }
}

/// Keeps a port open on a thread of its own. `take` gets the measurements, and says whether it wants more; `report` gets why the
/// port failed or could not be opened, once until it is open again.
///
/// # Errors
/// If the system starts no thread.
pub fn listen_flow(
    address: Address,
    mut take: impl FnMut(FlowReading) -> bool + Send + 'static,
    mut report: impl FnMut(&io::Error) + Send + 'static,
) -> io::Result<()> {
    let thread = thread::Builder::new().name("optical-flow".to_owned());
    thread.spawn(move || {
        let (mut back_off, mut is_wanted, mut was_open) = (BACK_OFF_MIN, true, true);
        while is_wanted {
            let read = FlowPort::open(&address).and_then(|mut port| {
                while is_wanted {
                    port.read(|reading| {
                        (back_off, was_open) = (BACK_OFF_MIN, true);
                        is_wanted &= take(reading);
                    })?;
                }
                Ok(())
            });
            let Err(error) = read else { return };
            if std::mem::replace(&mut was_open, false) {
                report(&error);
            }
            thread::sleep(back_off);
            back_off = BACK_OFF_MAX.min(2 * back_off);
        }
    })?;
    Ok(())
}
