//! A sensor beside a simulated aircraft that tells its drone where it is.

use std::io;
use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::thread;
use std::time::Instant;

use muster_controller::{PoseErrors, PoseSensor};
use muster_daemon::pose::Message;
use muster_machines::geometry::Ned;
use muster_machines::time::Timestamp;
use muster_port::raise_priority;

/// A sensor, and who is told.
#[derive(Debug, Clone, Copy)]
pub struct PoseSource {
    /// What it measures, and how well.
    pub errors: PoseErrors,
    /// Draws its errors.
    pub seed: u64,
    /// Who is told: a drone's `pose`.
    pub to: SocketAddr,
}

impl PoseSource {
    /// Measures on a thread of its own, until `position` yields no position any more.
    ///
    /// # Errors
    /// If the system has no socket or starts no thread.
    pub(crate) fn start(
        self,
        position: impl Fn() -> Option<Ned> + Send + 'static,
    ) -> io::Result<()> {
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
        socket.connect(self.to)?;
        let started = Instant::now();
        let mut sensor = PoseSensor::new(self.errors, self.seed, Timestamp::ZERO);
        let thread = thread::Builder::new().name("pose-sensor".to_owned());
        thread.spawn(move || {
            // A pose that is sent late is older than it says.
            let _ = raise_priority();
            while let Some(position) = position() {
                let now = Timestamp::ZERO + started.elapsed();
                sensor.measure(now, position);
                while let Some(pose) = sensor.arrived(now) {
                    // Nobody may listen yet.
                    drop(socket.send(&Message::from(pose).to_bytes()));
                }
                thread::sleep(sensor.next_event().since(now));
            }
        })?;
        Ok(())
    }
}
