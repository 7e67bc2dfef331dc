//! An optical flow module beneath a simulated aircraft, at the other end of a line.

use std::io::{self, Write};
use std::net::TcpListener;
use std::thread;
use std::time::{Duration, Instant};

use muster_controller::{FlowErrors, FlowSensor, Truth};
use muster_machines::time::Timestamp;
use muster_msp::{FlowReading, Version, order};
use muster_port::raise_priority;

use crate::controller::wait;

/// Longest time until the end of the aircraft is seen.
const PAUSE: Duration = Duration::from_millis(100);

/// A module, and where it is listened to.
#[derive(Debug)]
pub struct FlowSource {
    /// What it measures, and how well.
    pub errors: FlowErrors,
    /// Draws its errors.
    pub seed: u64,
    /// Where a drone connects to: its `flow`.
    pub listener: TcpListener,
}

impl FlowSource {
    /// Measures on a thread of its own, until `truth` yields none any more. One connection after the other hears it.
    ///
    /// # Errors
    /// If the system starts no thread.
    pub(crate) fn start(
        self,
        truth: impl Fn() -> Option<Truth> + Send + 'static,
    ) -> io::Result<()> {
        self.listener.set_nonblocking(true)?;
        let mut sensor = FlowSensor::new(self.errors, self.seed, Timestamp::ZERO);
        let started = Instant::now();
        let thread = thread::Builder::new().name("flow-module".to_owned());
        thread.spawn(move || {
            // A measurement that is sent late tells of a motion before.
            let _ = raise_priority();
            while truth().is_some() {
                if let Ok(true) = wait(&self.listener, PAUSE)
                    && let Ok((line, _)) = self.listener.accept()
                    && line.set_nodelay(true).is_ok()
                {
                    // A connection that fails is closed, and the drone connects again.
                    drop(send(&mut sensor, started, &line, &truth));
                }
            }
        })?;
        Ok(())
    }
}

/// Sends what is measured, until the line fails or there is no truth any more.
fn send(
    sensor: &mut FlowSensor,
    started: Instant,
    mut line: impl Write,
    truth: &impl Fn() -> Option<Truth>,
) -> io::Result<()> {
    let mut bytes = Vec::new();
    while let Some(truth) = truth() {
        let now = Timestamp::ZERO + started.elapsed();
        bytes.clear();
        for reading in sensor.measure(now, &truth).into_iter().flatten() {
            let written = match reading {
                FlowReading::Range(range) => order(Version::V2, &range, &mut bytes),
                FlowReading::Rates(rates) => order(Version::V2, &rates, &mut bytes),
            };
            written.map_err(io::Error::other)?;
        }
        line.write_all(&bytes)?;
        thread::sleep(sensor.next_event().since(now));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use muster_controller::{Config, Controller, Settings};
    use muster_machines::geodetic::Geodetic;
    use muster_machines::geometry::{Ned, Velocity};
    use muster_port::FlowPort;

    use super::*;

    #[test]
    fn a_client_gets_the_motion_of_the_aircraft_until_that_is_gone() {
        let errors = FlowErrors {
            sigma_radps: 0.0,
            range_max_m: 8.0,
            period: Duration::from_millis(20),
        };
        let place = Geodetic::new(39.48, -0.34, 20.0).unwrap();
        let config = Config::new(place, Settings::fit());
        let mut controller = Controller::new(config, 1, Timestamp::ZERO);
        let mut truth = controller.aircraft(Timestamp::ZERO);
        (truth.position, truth.velocity) = (Ned::new(0.0, 0.0, -2.0), Velocity::ZERO);
        let aircraft = Arc::new(truth);
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = format!("tcp:{}", listener.local_addr().unwrap());
        let address = address.parse().unwrap();
        let seen = Arc::downgrade(&aircraft);
        let source = FlowSource {
            errors,
            seed: 1,
            listener,
        };
        source.start(move || Some(*seen.upgrade()?)).unwrap();
        for _ in 0..2 {
            let mut port = FlowPort::open(&address).unwrap();
            let mut distances_mm = Vec::new();
            while distances_mm.len() < 3 {
                let taken = port.read(|reading| {
                    if let FlowReading::Range(range) = reading {
                        distances_mm.push(range.distance_mm);
                    }
                });
                taken.unwrap();
            }
            assert!(distances_mm.iter().all(|it| (it - 2_000).abs() <= 80));
        }
        drop(aircraft);
        let mut port = match FlowPort::open(&address) {
            Ok(port) => port,
            Err(_) => return,
        };
        while port.read(drop).is_ok() {}
    }
}
