//! A simulated flight controller on the clock of this machine, at the other end of a line.

use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpListener;
use std::os::fd::AsFd;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::{Duration, Instant};

use muster_controller::{Config, Controller, Sticks, Truth};
use muster_machines::time::Timestamp;
use muster_scenarios::controllers::FaultyController;
use muster_scenarios::scenario::ControllerFault;
use rustix::event::{PollFd, PollFlags, Timespec, poll};

use crate::pilot::LivePilot;
use crate::{FlowSource, PoseSource};

/// Longest time without a look at the line.
const PAUSE: Duration = Duration::from_millis(100);

/// A simulated flight controller and its aircraft. They move on whenever somebody looks.
#[derive(Debug)]
pub struct LiveController(Arc<Mutex<Live>>);

/// What serves the line of a [`LiveController`], until that is dropped.
#[derive(Debug)]
pub struct Server(Weak<Mutex<Live>>);

#[derive(Debug)]
struct Live {
    started: Instant,
    faulty: FaultyController,
}

impl LiveController {
    /// A controller that starts now. `seed` draws the errors of its sensors, and the bytes that faults of its line meet.
    #[must_use]
    pub fn start(config: Config, seed: u64) -> Self {
        let controller = Controller::new(config, seed, Timestamp::ZERO);
        Self(Arc::new(Mutex::new(Live {
            started: Instant::now(),
            faulty: FaultyController::new(controller, seed),
        })))
    }

    /// What serves its line. One line at a time.
    #[must_use]
    pub fn server(&self) -> Server {
        Server(Arc::downgrade(&self.0))
    }

    /// Tells a drone where its aircraft is, until it is dropped.
    ///
    /// # Errors
    /// If the system has no socket or starts no thread.
    pub fn measure_pose(&self, source: PoseSource) -> io::Result<()> {
        let live = Arc::downgrade(&self.0);
        source.start(move || {
            let live = live.upgrade()?;
            Some(lock(&live).truth().position)
        })
    }

    /// Tells a drone how the ground moves beneath its aircraft, until it is dropped.
    ///
    /// # Errors
    /// If the system starts no thread.
    pub fn measure_flow(&self, source: FlowSource) -> io::Result<()> {
        let live = Arc::downgrade(&self.0);
        source.start(move || Some(lock(&*live.upgrade()?).truth()))
    }

    /// A pilot at its receiver, until it is dropped.
    ///
    /// # Errors
    /// If the system starts no thread.
    pub(crate) fn start_pilot(&self) -> io::Result<LivePilot> {
        let (seen, moved) = (Arc::downgrade(&self.0), Arc::downgrade(&self.0));
        let see = move || {
            let live = seen.upgrade()?;
            Some(lock(&live).truth())
        };
        LivePilot::start(see, move |channels| {
            if let Some(live) = moved.upgrade() {
                let mut live = lock(&live);
                let now = live.recover();
                live.faulty.controller.pilot(now, Some(channels));
            }
        })
    }

    /// The truth about its aircraft now.
    #[must_use]
    pub fn truth(&self) -> Truth {
        lock(&self.0).truth()
    }

    /// What its receiver got since the last call.
    #[must_use]
    pub fn take_sticks(&self) -> Sticks {
        let mut live = lock(&self.0);
        let now = live.recover();
        live.faulty.controller.take_sticks(now)
    }

    /// Injects a fault now, for so long or for good.
    pub fn affect(&self, fault: ControllerFault, lasts: Option<Duration>) {
        lock(&self.0).affect(fault, lasts);
    }
}

impl Server {
    /// Serves TCP connections, one after the other, until the controller is dropped. `report` takes why a connection failed.
    ///
    /// # Errors
    /// If the system accepts no connections.
    pub fn listen(
        &self,
        listener: &TcpListener,
        mut report: impl FnMut(io::Error),
    ) -> io::Result<()> {
        listener.set_nonblocking(true)?;
        while let Some(live) = self.0.upgrade() {
            // Meanwhile its aircraft moves on: it may be in the air.
            lock(&live).advance();
            drop(live);
            if wait(listener, PAUSE)? {
                let (stream, _) = listener.accept()?;
                if let Err(error) = stream.set_nodelay(true).and_then(|()| self.serve(&stream)) {
                    report(error);
                }
            }
        }
        Ok(())
    }

    /// Carries bytes until the line is closed, by the other end or a fault, or the controller is dropped. Bytes that the
    /// reader doesn't take are lost, as on a serial line.
    ///
    /// # Errors
    /// If the line fails.
    pub fn serve(&self, mut line: impl Read + Write + AsFd) -> io::Result<()> {
        rustix::io::ioctl_fionbio(&line, true)?;
        let mut bytes = [0; 1_024];
        let mut pause = Duration::ZERO;
        loop {
            wait(&line, pause)?;
            let count = match line.read(&mut bytes) {
                Ok(0) => return Ok(()),
                Ok(count) => count,
                Err(error) if error.kind() == ErrorKind::WouldBlock => 0,
                Err(error) => return Err(error),
            };
            let Some(live) = self.0.upgrade() else {
                return Ok(());
            };
            let carried = lock(&live).carry(bytes[..count].to_vec());
            let Some((sent, next)) = carried else {
                return Ok(());
            };
            pause = next;
            match line.write(&sent) {
                Err(error) if error.kind() != ErrorKind::WouldBlock => return Err(error),
                Ok(_) | Err(_) => {}
            }
        }
    }
}

impl Live {
    fn advance(&mut self) {
        let now = self.recover();
        self.faulty.controller.advance(now);
    }

    /// Carries what was written. Returns what arrives from the controller, and how long the line may be left alone; `None` if
    /// it is closed.
    fn carry(&mut self, written: Vec<u8>) -> Option<(Vec<u8>, Duration)> {
        let now = self.recover();
        if self.faulty.is_closed(now) {
            return None;
        }
        let FaultyController {
            controller, line, ..
        } = &mut self.faulty;
        let arrived = line.carry_out(now, written);
        if !arrived.is_empty() {
            controller.receive(now, &arrived);
        }
        let sent = controller.transmit(now);
        let sent = line.carry_in(now, sent);
        let due = [controller.next_event(), line.next_arrival()];
        let due = due.into_iter().flatten().min();
        Some((sent, due.map_or(PAUSE, |due| due.since(now).min(PAUSE))))
    }

    /// Ends the faults of the controller that are over. Returns the time.
    fn recover(&mut self) -> Timestamp {
        let now = Timestamp::ZERO + self.started.elapsed();
        self.faulty.recover(now);
        now
    }

    fn truth(&mut self) -> Truth {
        let now = self.recover();
        self.faulty.controller.aircraft(now)
    }

    fn affect(&mut self, fault: ControllerFault, lasts: Option<Duration>) {
        let now = self.recover();
        self.faulty.affect(now, fault, lasts);
    }
}

/// A thread that panicked has moved what is locked as a whole, or not at all.
pub(crate) fn lock<T>(live: &Mutex<T>) -> MutexGuard<'_, T> {
    live.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Waits until there is something to read or accept. Returns whether there is.
pub(crate) fn wait(source: &impl AsFd, pause: Duration) -> io::Result<bool> {
    let pause = Timespec::try_from(pause).expect("a short pause");
    let mut polled = [PollFd::new(source, PollFlags::IN)];
    Ok(poll(&mut polled, Some(&pause))? > 0)
}

#[cfg(test)]
mod tests {
    use std::net::TcpStream;

    use muster_controller::Settings;
    use muster_machines::geodetic::Geodetic;
    use muster_msp::{Attitude, Version, request};

    use super::*;

    fn start() -> (LiveController, std::net::SocketAddr) {
        let place = Geodetic::new(39.48, -0.34, 20.0).unwrap();
        let controller = LiveController::start(Config::new(place, Settings::fit()), 1);
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let server = controller.server();
        std::thread::spawn(move || server.listen(&listener, drop));
        (controller, address)
    }

    /// Asks a question. Returns whether an answer came before the connection was closed.
    fn answers(stream: &mut TcpStream) -> bool {
        let mut question = Vec::new();
        request::<Attitude>(Version::V1, &mut question).unwrap();
        let read = |stream: &mut TcpStream| stream.read(&mut [0; 64]);
        stream.write_all(&question).is_ok() && read(stream).is_ok_and(|count| count > 0)
    }

    #[test]
    fn fault_closes_the_port_and_its_end_opens_it() {
        let (controller, address) = start();
        let mut stream = TcpStream::connect(address).unwrap();
        assert!(answers(&mut stream));
        controller.affect(ControllerFault::ClosePort, None);
        assert!(!answers(&mut stream));
        assert!(!answers(&mut TcpStream::connect(address).unwrap()));
        controller.affect(ControllerFault::ClosePort, Some(Duration::ZERO));
        assert!(answers(&mut TcpStream::connect(address).unwrap()));
    }

    #[test]
    fn dropped_controller_ends_its_server() {
        let (controller, address) = start();
        let mut stream = TcpStream::connect(address).unwrap();
        assert!(answers(&mut stream));
        drop(controller);
        // The end of the connection is read without an error.
        while stream.read(&mut [0; 64]).unwrap() > 0 {}
    }
}
