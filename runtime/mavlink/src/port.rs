//! The socket, and who is at its other end.

use std::io;
use std::net::{SocketAddr, UdpSocket};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use mavlink::dialects::common::MavMessage;
use mavlink::error::MessageReadError;
use mavlink::{MavHeader, MavlinkReader, MavlinkVersion};
use muster_machines::msp::autopilot::{AutopilotReport, Order};

use crate::address::Address;
use crate::decode::{self, Message};
use crate::encode::{self, AUTOPILOT};

/// How long a read waits before the thread looks whether anybody still listens.
const WAIT: Duration = Duration::from_millis(200);
/// How long a datagram may take to be written.
const WRITE_MAX: Duration = Duration::from_millis(5);
/// Longest datagram: an autopilot sends a few messages of at most 280 bytes in one. The rest of a longer one is lost.
const DATAGRAM_MAX: usize = 2_048;

/// State of a port.
#[derive(Debug, Clone, Copy, Default)]
pub struct Status {
    /// The autopilot's system number. `None` before its first heartbeat.
    pub system: Option<u8>,
    /// Whether the motors are armed, as the last heartbeat said. `None` before the first one.
    pub armed: Option<bool>,
    /// Messages that were believed.
    pub heard: u64,
    /// Messages that were not believed: of another system, of another autopilot than ArduPilot, with numbers that none has;
    /// and datagrams without a message of MAVLink 2 in the dialect `common`.
    pub ignored: u64,
    /// Commands that the autopilot refused.
    pub refused: u64,
    /// Time since the last heartbeat. `None` before the first one.
    pub silent_for: Option<Duration>,
    /// Datagrams that could not be sent.
    pub unsent: u64,
}

/// What happened at a port.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    /// The autopilot reported something.
    Report(AutopilotReport),
    /// The autopilot refused a command, with its name and the result.
    Refused(String),
}

/// The port of an autopilot. Its thread ends soon after it is dropped.
#[derive(Debug)]
pub struct Port {
    socket: UdpSocket,
    shared: Arc<Mutex<Shared>>,
}

#[derive(Debug, Default)]
struct Shared {
    status: Status,
    /// Where the newest heartbeat came from.
    peer: Option<SocketAddr>,
    /// When that was.
    heard_at: Option<Instant>,
    sequence: u8,
}

impl Port {
    /// Opens a port. `tell` takes what happens, on the port's thread; it returns false to end that.
    ///
    /// # Errors
    /// If the address is not free, or the system starts no thread.
    pub fn open(
        address: Address,
        mut tell: impl FnMut(Event) -> bool + Send + 'static,
    ) -> io::Result<Self> {
        let socket = UdpSocket::bind(address.socket())?;
        socket.set_write_timeout(Some(WRITE_MAX))?;
        let reader = socket.try_clone()?;
        reader.set_read_timeout(Some(WAIT))?;
        let shared = Arc::<Mutex<Shared>>::default();
        let weak = Arc::downgrade(&shared);
        let thread = std::thread::Builder::new().name("autopilot".to_owned());
        thread.spawn(move || {
            let mut datagram = [0; DATAGRAM_MAX];
            while let Some(shared) = weak.upgrade() {
                // A timeout; or an error of an earlier datagram, when nobody listens at the other end.
                let Ok((length, source)) = reader.recv_from(&mut datagram) else {
                    continue;
                };
                let events = lock(&shared).read(&datagram[..length], source);
                if !events.into_iter().all(&mut tell) {
                    return;
                }
            }
        })?;
        Ok(Self { socket, shared })
    }

    /// Sends an order to the autopilot. Before its first heartbeat nobody is known to send it to.
    pub fn send(&self, order: Order) {
        let mut shared = lock(&self.shared);
        let (Some(system), Some(peer)) = (shared.status.system, shared.peer) else {
            return;
        };
        for datagram in encode::datagrams(order, system, &mut shared.sequence) {
            let is_sent = self.socket.send_to(&datagram, peer).is_ok();
            shared.status.unsent += u64::from(!is_sent);
        }
    }

    /// State of the port.
    #[must_use]
    pub fn status(&self) -> Status {
        let shared = lock(&self.shared);
        Status {
            silent_for: shared.heard_at.map(|at| at.elapsed()),
            ..shared.status
        }
    }
}

impl Shared {
    /// Reads a datagram.
    fn read(&mut self, datagram: &[u8], source: SocketAddr) -> Vec<Event> {
        let mut events = Vec::new();
        let mut reader = MavlinkReader::with_capacity(datagram.len(), datagram);
        let mut messages = 0;
        loop {
            match reader.read_message::<MavMessage>(MavlinkVersion::V2) {
                Ok((header, message)) => events.extend(self.take(header, &message, source)),
                Err(MessageReadError::Parse(_)) => self.status.ignored += 1,
                // The end of the datagram.
                Err(MessageReadError::Io(_)) => break,
            }
            messages += 1;
        }
        self.status.ignored += u64::from(messages == 0);
        events
    }

    /// Believes a message of the autopilot that was heard first.
    fn take(
        &mut self,
        header: MavHeader,
        message: &MavMessage,
        source: SocketAddr,
    ) -> Option<Event> {
        let system = u8::try_from(header.system_id).ok();
        let system = system.filter(|it| self.status.system.is_none_or(|known| known == *it));
        let meant = match decode::message(message) {
            meant if system.is_some() && header.component_id == AUTOPILOT => meant,
            _ => Message::Bad,
        };
        match meant {
            Message::Report(report) => {
                if let AutopilotReport::Heartbeat { armed, .. } = report {
                    (self.status.system, self.peer) = (system, Some(source));
                    self.status.armed = Some(armed);
                    self.heard_at = Some(Instant::now());
                }
                self.status.system?;
                self.status.heard += 1;
                Some(Event::Report(report))
            }
            Message::Refused(why) => {
                self.status.refused += 1;
                Some(Event::Refused(why))
            }
            Message::Other => None,
            Message::Bad => {
                self.status.ignored += 1;
                None
            }
        }
    }
}

/// A thread that panicked has left whole counts.
fn lock(shared: &Mutex<Shared>) -> MutexGuard<'_, Shared> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use std::net::Ipv4Addr;

    use mavlink::dialects::common::{
        HEARTBEAT_DATA, LOCAL_POSITION_NED_DATA, MavAutopilot, MavModeFlag,
    };
    use mavlink::{write_v1_msg, write_v2_msg};
    use muster_machines::msp::autopilot::Mode;

    use super::*;

    const SOURCE: SocketAddr = SocketAddr::new(std::net::IpAddr::V4(Ipv4Addr::LOCALHOST), 14_550);

    fn heartbeat() -> MavMessage {
        MavMessage::HEARTBEAT(HEARTBEAT_DATA {
            autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
            base_mode: MavModeFlag::empty(),
            ..Default::default()
        })
    }

    fn place() -> MavMessage {
        MavMessage::LOCAL_POSITION_NED(LOCAL_POSITION_NED_DATA::default())
    }

    fn header(system_id: u32, component_id: u8) -> MavHeader {
        MavHeader {
            system_id,
            component_id,
            sequence: 0,
        }
    }

    fn written(header: MavHeader, message: &MavMessage) -> Vec<u8> {
        let mut datagram = Vec::new();
        write_v2_msg(&mut datagram, header, message).unwrap();
        datagram
    }

    #[test]
    fn only_the_autopilot_that_was_heard_first_is_believed() {
        let mut shared = Shared::default();
        let ours = header(1, AUTOPILOT);
        assert_eq!(
            shared.read(&written(ours, &place()), SOURCE),
            [],
            "no heartbeat yet"
        );
        let events = shared.read(&written(ours, &heartbeat()), SOURCE);
        let (armed, mode) = (false, Mode::Other);
        assert_eq!(
            events,
            [Event::Report(AutopilotReport::Heartbeat { armed, mode })]
        );
        for other in [header(2, AUTOPILOT), header(1, 190), header(257, AUTOPILOT)] {
            assert_eq!(shared.read(&written(other, &heartbeat()), SOURCE), []);
        }
        assert_eq!((shared.status.heard, shared.status.ignored), (1, 3));
    }

    #[test]
    fn two_messages_of_a_datagram_are_read_and_bytes_between_them_cost_neither() {
        let mut shared = Shared::default();
        let ours = header(1, AUTOPILOT);
        let noise = [0, 3, 0xFE];
        let [first, second] = [heartbeat(), place()].map(|it| written(ours, &it));
        let events = shared.read(&[&first[..], &noise, &second].concat(), SOURCE);
        assert_eq!(events.len(), 2);
    }

    #[test]
    fn altered_messages_and_those_of_mavlink_1_are_counted_and_not_believed() {
        let mut shared = Shared::default();
        let datagram = written(header(1, AUTOPILOT), &heartbeat());
        let bits = 8 * datagram.len();
        for bit in 0..bits {
            let mut altered = datagram.clone();
            altered[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(shared.read(&altered, SOURCE), [], "bit {bit}");
        }
        let mut old = Vec::new();
        write_v1_msg(&mut old, header(1, AUTOPILOT), &heartbeat()).unwrap();
        assert_eq!(shared.read(&old, SOURCE), []);
        assert_eq!(shared.status.ignored, bits as u64 + 1);
    }
}
