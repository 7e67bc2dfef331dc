//! A pilot beside a flight controller, on the clock of this machine.

use std::io;
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use muster_controller::{CHANNELS, Truth};
use muster_machines::time::Timestamp;
use muster_port::raise_priority;
use muster_scenarios::controllers::Pilot;

use crate::controller::lock;

/// From one frame of the pilot's transmitter to the next.
const FRAME: Duration = Duration::from_millis(20);

/// A pilot who sees an aircraft and moves sticks and switches, 50 times a second.
#[derive(Debug)]
pub(crate) struct LivePilot(Arc<Mutex<Pilot>>);

impl LivePilot {
    /// Flies on a thread of its own, until `see` yields no aircraft any more. `send` takes all channels, in µs.
    ///
    /// # Errors
    /// If the system starts no thread.
    pub(crate) fn start(
        see: impl Fn() -> Option<Truth> + Send + 'static,
        mut send: impl FnMut(&[u16; CHANNELS]) + Send + 'static,
    ) -> io::Result<Self> {
        let pilot = Arc::<Mutex<Pilot>>::default();
        let flown = Arc::clone(&pilot);
        let started = Instant::now();
        thread::Builder::new()
            .name("pilot".to_owned())
            .spawn(move || {
                // Without it a busy machine looks like a lost receiver.
                let _ = raise_priority();
                while let Some(truth) = see() {
                    let now = Timestamp::ZERO + started.elapsed();
                    let mut pilot = lock(&flown);
                    pilot.moves(now, &truth);
                    let channels = pilot.channels;
                    drop(pilot);
                    send(&channels);
                    thread::sleep(FRAME);
                }
            })?;
        Ok(Self(pilot))
    }

    /// The pilot sees whether the drone is to take off.
    pub(crate) fn show(&self, is_to_take_off: bool) {
        lock(&self.0).is_to_take_off = is_to_take_off;
    }

    /// The pilot takes the sticks, for good.
    pub(crate) fn take_over(&self) {
        lock(&self.0).take_over();
    }
}
