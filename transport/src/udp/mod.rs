//! Frames as UDP datagrams, one each, over a real network.
//!
//! A drone sends everything from one socket, its own, at which it also gets what is for it alone. Where a network
//! carries frames for all by multicast or broadcast, a second socket listens there, so that any number of drones may
//! share one host. Where it does not, each frame for all goes to each of a list of peers, and what comes from each of them
//! has a buffer of its own with the system, which nobody at another address can fill.
//!
//! Which drone is at which address is learnt, from frames whose signature was right; a frame for a drone that was not
//! heard yet goes to all. Nothing below acknowledges: what becomes of a frame is never told.

mod waiting;

use std::collections::{BTreeMap, VecDeque};
use std::fmt;
use std::io;
use std::net::{SocketAddr, UdpSocket};
use std::num::NonZeroU16;
use std::sync::Arc;

use bytes::Bytes;
use muster_machines::identity::NodeId;
use muster_machines::radio::Source;
use muster_machines::time::Timestamp;

use waiting::LookedAt;
pub use waiting::Waiting;

use crate::sockets::{self, Clock, Config, Counters, OpenError, Reach};
use crate::{Arrival, Destination, Event, SendError, Transport};

/// How many hosts back a [`Source`] is remembered at which no drone was found: no more datagrams than that wait to be looked
/// at.
const HOSTS_MAX: usize = 1_024;

/// How many datagrams in a row are passed over that are of no use.
const SKIPPED_MAX: usize = 64;

/// How many datagrams of one socket come before the others get their turn.
const IN_A_ROW_MAX: usize = 16;

/// A drone's end of the network.
pub struct UdpTransport {
    config: Config,
    clock: Clock,
    own: Arc<UdpSocket>,
    /// Where that one is.
    address: SocketAddr,
    /// Where frames come in; the own socket is the first.
    sockets: Vec<Arc<UdpSocket>>,
    looked_at: Arc<LookedAt>,
    /// Where drones were last heard; at most as many as whoever calls [`Transport::learn`] lets in.
    places: BTreeMap<NodeId, Place>,
    sources: Sources,
    /// Which of the sockets is looked at.
    turn: usize,
    /// How many datagrams have come from it in its turn.
    in_a_row: usize,
    /// Whether datagrams were passed over, and more may be there.
    has_skipped: bool,
    buffer: Box<[u8]>,
    counters: Counters,
}

impl fmt::Debug for UdpTransport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("UdpTransport")
            .field("config", &self.config)
            .field("counters", &self.counters)
            .finish_non_exhaustive()
    }
}

impl UdpTransport {
    /// Opens a drone's end of the network. Datagrams are kept by the system from here on.
    ///
    /// # Errors
    /// When a socket can't be had as configured; none is left open then.
    pub fn open(config: Config, clock: Clock) -> Result<Self, OpenError> {
        let (own, shared) = sockets::open(&config)?;
        let others = match &config.reach {
            Reach::Peers(peers) => sockets::apart(&config, &own, peers)?,
            Reach::Group(_) | Reach::Broadcast(_) => shared.into_iter().collect(),
        };
        let (address, own) = (own.local_addr()?, Arc::new(own));
        let others = others.into_iter().map(Arc::new);
        Ok(Self {
            address,
            sockets: std::iter::once(Arc::clone(&own)).chain(others).collect(),
            looked_at: Arc::new(LookedAt::all()),
            own,
            places: BTreeMap::new(),
            sources: Sources::default(),
            turn: 0,
            in_a_row: 0,
            has_skipped: false,
            // One byte more than is taken tells what is too long.
            buffer: vec![0; config.datagram_max + 1].into(),
            counters: Counters::default(),
            clock,
            config,
        })
    }

    /// The address of its own socket. What comes from there is what it said itself, and dropped; a socket at all of a
    /// machine's addresses can't tell, so that the radio has to.
    #[must_use]
    pub const fn address(&self) -> SocketAddr {
        self.address
    }

    /// To be told, asynchronously, when datagrams are there. Must be called within a runtime that drives input.
    ///
    /// # Errors
    /// When the runtime can't watch the sockets.
    pub fn waiting(&self) -> io::Result<Waiting> {
        Waiting::new(&self.sockets, Arc::clone(&self.looked_at))
    }

    /// What it has done so far.
    #[must_use]
    pub const fn counters(&self) -> Counters {
        self.counters
    }

    /// How many datagrams the system has dropped because its buffers for these sockets were full; nothing where it does
    /// not tell.
    #[must_use]
    pub fn overflowed(&self) -> Option<u64> {
        sockets::drops(&self.sockets)
    }

    /// Whether all that had come in was taken when [`Transport::poll_event`] last returned nothing; otherwise it passed over
    /// as much of no use as it may in one call.
    #[must_use]
    pub const fn is_drained(&self) -> bool {
        !self.has_skipped
    }

    fn send_to_all(&mut self, datagram: &[u8]) {
        let (own, counters) = (&self.own, &mut self.counters);
        match &self.config.reach {
            Reach::Group(address) | Reach::Broadcast(address) => {
                send_to(own, counters, (*address).into(), datagram);
            }
            Reach::Peers(peers) => {
                for address in peers {
                    send_to(own, counters, *address, datagram);
                }
            }
        }
    }

    /// The next datagram; each socket has its turn, so that a flood at one keeps what comes to another waiting for a few
    /// datagrams only.
    fn next_datagram(&mut self) -> Option<(Bytes, SocketAddr)> {
        // The first is looked at again if it had had its turn.
        let has_had_its_turn = self.in_a_row == IN_A_ROW_MAX;
        for _ in 0..self.sockets.len() + usize::from(has_had_its_turn) {
            if self.in_a_row < IN_A_ROW_MAX && self.looked_at.has(self.turn) {
                let socket = Arc::clone(&self.sockets[self.turn]);
                let datagram = self.receive(&socket);
                if datagram.is_some() {
                    self.in_a_row += 1;
                    return datagram;
                }
            }
            self.turn = (self.turn + 1) % self.sockets.len();
            self.in_a_row = 0;
        }
        None
    }

    /// The next datagram of a socket that is not too long.
    fn receive(&mut self, socket: &UdpSocket) -> Option<(Bytes, SocketAddr)> {
        for _ in 0..SKIPPED_MAX {
            match socket.recv_from(&mut self.buffer) {
                Ok((len, _)) if len > self.config.datagram_max => self.counters.too_long += 1,
                // What is said to a group comes back from it.
                Ok((_, address)) if address == self.address => {}
                Ok((len, address)) => {
                    self.counters.received += 1;
                    return Some((Bytes::copy_from_slice(&self.buffer[..len]), address));
                }
                // What an earlier datagram came to is told once, in the place of the next.
                Err(error) if error.kind() != io::ErrorKind::WouldBlock => {}
                Err(_) => return None,
            }
        }
        self.has_skipped = true;
        None
    }
}

impl Transport for UdpTransport {
    fn datagram_max(&self) -> usize {
        self.config.datagram_max
    }

    fn send(
        &mut self,
        _now: Timestamp,
        from: NodeId,
        to: Destination,
        datagram: &Bytes,
    ) -> Result<(), SendError> {
        self.config.check(from, datagram)?;
        if let Destination::To(node) = to
            && let Some(place) = self.places.get(&node).copied()
        {
            if send_to(&self.own, &mut self.counters, place.address, datagram) {
                return Ok(());
            }
            // It may have another address by now.
            self.places.remove(&node);
            self.sources.leave(place.address);
        }
        self.send_to_all(datagram);
        Ok(())
    }

    fn poll_event(&mut self) -> Option<Event> {
        self.has_skipped = false;
        let (datagram, address) = self.next_datagram()?;
        Some(Event::Arrival(Arrival {
            at: (self.clock)(),
            to: self.config.id,
            datagram,
            source: Some(self.sources.name(address)),
            peer: None,
        }))
    }

    fn learn(&mut self, node: NodeId, source: Source) {
        if self.places.get(&node).is_some_and(|it| it.source == source) {
            return;
        }
        let Some(address) = self.sources.address(source) else {
            return;
        };
        self.sources.stay(address);
        if let Some(before) = self.places.insert(node, Place { address, source }) {
            self.sources.leave(before.address);
        }
    }
}

/// Sends a datagram from a socket; whether the system took it.
fn send_to(own: &UdpSocket, counters: &mut Counters, address: SocketAddr, datagram: &[u8]) -> bool {
    let is_sent = own.send_to(datagram, address).is_ok();
    if is_sent {
        counters.sent += 1;
    } else {
        counters.unsent += 1;
    }
    is_sent
}

/// Where a drone is.
#[derive(Debug, Clone, Copy)]
struct Place {
    address: SocketAddr,
    source: Source,
}

/// The names of addresses: of those of hosts at which drones are, and of the last other hosts that datagrams came from. A
/// host has one number as long as it is known.
#[derive(Debug, Default)]
struct Sources {
    hosts: BTreeMap<SocketAddr, Host>,
    /// Where they are, by number.
    addresses: BTreeMap<NonZeroU16, SocketAddr>,
    /// The last that were named, the oldest first.
    newest: VecDeque<SocketAddr>,
    /// The number that was given last.
    given: u16,
}

#[derive(Debug)]
struct Host {
    number: NonZeroU16,
    /// How many drones are there.
    drones: u32,
}

/// The machine that an address is of.
fn host(mut address: SocketAddr) -> SocketAddr {
    address.set_port(0);
    address
}

impl Sources {
    fn name(&mut self, address: SocketAddr) -> Source {
        let known = self.hosts.get(&host(address)).map(|it| it.number);
        Source {
            host: known.unwrap_or_else(|| self.enter(host(address))),
            port: address.port(),
        }
    }

    fn enter(&mut self, host: SocketAddr) -> NonZeroU16 {
        if self.newest.len() == HOSTS_MAX
            && let Some(oldest) = self.newest.pop_front()
        {
            self.forget_if_left(oldest);
        }
        let number = self.next_number();
        self.newest.push_back(host);
        self.addresses.insert(number, host);
        self.hosts.insert(host, Host { number, drones: 0 });
        number
    }

    /// The next number that no host has. Where drones are at as many hosts as there are numbers, two have the last one.
    fn next_number(&mut self) -> NonZeroU16 {
        for _ in 0..=u16::MAX {
            self.given = self.given.wrapping_add(1);
            let free = NonZeroU16::new(self.given);
            if let Some(free) = free.filter(|it| !self.addresses.contains_key(it)) {
                return free;
            }
        }
        NonZeroU16::MAX
    }

    fn address(&self, source: Source) -> Option<SocketAddr> {
        let mut address = *self.addresses.get(&source.host)?;
        address.set_port(source.port);
        Some(address)
    }

    /// A drone is there, and so its host keeps its number.
    fn stay(&mut self, address: SocketAddr) {
        if let Some(host) = self.hosts.get_mut(&host(address)) {
            host.drones += 1;
        }
    }

    /// It is there no more.
    fn leave(&mut self, address: SocketAddr) {
        let key = host(address);
        if let Some(host) = self.hosts.get_mut(&key) {
            host.drones = host.drones.saturating_sub(1);
        }
        if !self.newest.contains(&key) {
            self.forget_if_left(key);
        }
    }

    fn forget_if_left(&mut self, host: SocketAddr) {
        if let Some(left) = self.hosts.get(&host).filter(|it| it.drones == 0) {
            self.addresses.remove(&left.number);
            self.hosts.remove(&host);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A host by its number, and one of its ports.
    fn address(host: u16) -> SocketAddr {
        let [high, low] = host.to_be_bytes();
        SocketAddr::from(([10, 0, high, low], 4_700))
    }

    #[test]
    fn where_a_datagram_came_from_is_known_until_it_came_from_as_many_other_hosts() {
        let mut sources = Sources::default();
        let first = sources.name(address(1));
        let names: Vec<_> = (2..=1_024)
            .map(|host| sources.name(address(host)))
            .collect();
        assert_eq!(sources.address(first), Some(address(1)));
        assert_eq!(sources.address(names[0]), Some(address(2)));
        assert_eq!(sources.name(address(1)), first);
        let newest = sources.name(address(2_000));
        assert_eq!(sources.address(first), None);
        assert_eq!(sources.address(names[0]), Some(address(2)));
        assert_eq!(sources.address(newest), Some(address(2_000)));
    }

    #[test]
    fn whoever_has_many_ports_is_one_host() {
        let mut sources = Sources::default();
        let other = sources.name(address(1));
        let mut names = (1..=u16::MAX).map(|port| {
            let mut address = address(2);
            address.set_port(port);
            let name = sources.name(address);
            assert_eq!(sources.address(name), Some(address));
            name
        });
        let first = names.next().unwrap();
        assert!(names.all(|name| name.host == first.host && name != first));
        assert_eq!(sources.address(other), Some(address(1)));
    }

    #[test]
    fn a_host_keeps_its_number_as_long_as_a_drone_is_there() {
        let mut sources = Sources::default();
        let home = sources.name(address(1));
        sources.stay(address(1));
        let pass_by = |sources: &mut Sources| {
            for host in 2..3_000 {
                sources.name(address(host));
            }
        };
        pass_by(&mut sources);
        assert_eq!(sources.name(address(1)), home);
        assert_eq!(sources.address(home), Some(address(1)));
        assert_eq!(sources.hosts.len(), HOSTS_MAX + 1);
        sources.leave(address(1));
        assert_ne!(sources.name(address(1)), home);
        pass_by(&mut sources);
        assert_eq!(sources.hosts.len(), HOSTS_MAX);
        assert_eq!(sources.addresses.len(), HOSTS_MAX);
    }

    #[test]
    fn numbers_go_round_without_mistaking_one_host_for_another() {
        let mut sources = Sources {
            given: u16::MAX - 2,
            ..Sources::default()
        };
        let names: Vec<_> = (1..=5)
            .map(|host| (sources.name(address(host)), host))
            .collect();
        for (name, host) in names {
            assert_eq!(sources.address(name), Some(address(host)));
        }
    }
}
