//! Frames over UDP, one datagram each.
//!
//! A drone sends everything from its own socket, which also receives unicasts. With multicast or broadcast, a second socket
//! receives broadcasts, so that many drones can share a host. With a list of peers, each broadcast goes to each peer. The
//! datagrams of each peer then have their own kernel buffer, which no other address can fill.
//!
//! The addresses of drones are learned from authenticated frames. A unicast to a drone with an unknown address goes to all.
//! UDP has no acknowledgements, so no outcome is reported.

mod readiness;
mod receiver;
mod sources;

use std::collections::BTreeMap;
use std::fmt;
use std::io;
use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;

use bytes::Bytes;
use muster_machines::identity::NodeId;
use muster_machines::radio::Source;
use muster_machines::time::Timestamp;

pub use self::readiness::Readiness;
use self::receiver::Receiver;
use self::sources::Sources;
use crate::sockets::{self, Clock, Config, Counters, OpenError, Reach};
use crate::{Arrival, Destination, Event, SendError, Transport};

/// A drone's end of the network.
pub struct UdpTransport {
    config: Config,
    clock: Clock,
    own: Arc<UdpSocket>,
    receiver: Receiver,
    /// Learned locations of drones; their number is limited by the caller of [`Transport::learn`].
    locations: BTreeMap<NodeId, Location>,
    sources: Sources,
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
    /// Opens a drone's end of the network. The kernel buffers datagrams from then on.
    ///
    /// # Errors
    /// If a socket can't be opened as configured; none is left open then.
    pub fn open(config: Config, clock: Clock) -> Result<Self, OpenError> {
        let (own, shared) = sockets::open(&config)?;
        let others = match &config.reach {
            Reach::Peers(peers) => sockets::peer_sockets(&config, &own, peers)?,
            Reach::Group(_) | Reach::Broadcast(_) => shared.into_iter().collect(),
        };
        let (address, own) = (own.local_addr()?, Arc::new(own));
        let others = others.into_iter().map(Arc::new);
        let sockets = std::iter::once(Arc::clone(&own)).chain(others).collect();
        Ok(Self {
            receiver: Receiver::new(sockets, address, config.datagram_max),
            own,
            locations: BTreeMap::new(),
            sources: Sources::default(),
            counters: Counters::default(),
            clock,
            config,
        })
    }

    /// Address of the own socket. Datagrams from this address are dropped as echoes of the own broadcasts. A socket bound to
    /// all addresses of a machine can't recognise them, so the radio drops them.
    #[must_use]
    pub const fn address(&self) -> SocketAddr {
        self.receiver.own_address()
    }

    /// A handle that waits for datagrams. Must be called within a Tokio runtime with I/O enabled.
    ///
    /// # Errors
    /// If the runtime can't watch the sockets.
    pub fn readiness(&self) -> io::Result<Readiness> {
        self.receiver.readiness()
    }

    /// Counters since the start.
    #[must_use]
    pub const fn counters(&self) -> Counters {
        self.counters
    }

    /// Number of datagrams that the kernel dropped for full receive buffers; `None` if it does not report it.
    #[must_use]
    pub fn overflowed(&self) -> Option<u64> {
        self.receiver.kernel_drops()
    }

    /// Whether nothing was left when [`Transport::poll_event`] last returned `None`. Otherwise that call stopped after skipping
    /// the maximum of useless datagrams.
    #[must_use]
    pub const fn is_drained(&self) -> bool {
        self.receiver.is_drained()
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
            && let Some(location) = self.locations.get(&node).copied()
        {
            if send_to(&self.own, &mut self.counters, location.address, datagram) {
                return Ok(());
            }
            // The drone may have a new address.
            self.locations.remove(&node);
            self.sources.remove_drone(location.address);
        }
        self.send_to_all(datagram);
        Ok(())
    }

    fn poll_event(&mut self) -> Option<Event> {
        let (datagram, address) = self.receiver.next(&mut self.counters)?;
        Some(Event::Arrival(Arrival {
            at: (self.clock)(),
            to: self.config.id,
            datagram,
            source: Some(self.sources.source(address)),
            peer: None,
        }))
    }

    fn learn(&mut self, node: NodeId, source: Source) {
        let known = self.locations.get(&node);
        if known.is_some_and(|it| it.source == source) {
            return;
        }
        let Some(address) = self.sources.address(source) else {
            return;
        };
        self.sources.add_drone(address);
        let location = Location { address, source };
        if let Some(before) = self.locations.insert(node, location) {
            self.sources.remove_drone(before.address);
        }
    }
}

/// Sends a datagram and counts it. Returns whether the kernel accepted it.
fn send_to(own: &UdpSocket, counters: &mut Counters, address: SocketAddr, datagram: &[u8]) -> bool {
    let is_sent = own.send_to(datagram, address).is_ok();
    if is_sent {
        counters.sent += 1;
    } else {
        counters.unsent += 1;
    }
    is_sent
}

/// The learned location of a drone.
#[derive(Debug, Clone, Copy)]
struct Location {
    address: SocketAddr,
    source: Source,
}
