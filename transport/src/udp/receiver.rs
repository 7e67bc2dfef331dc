//! Reads datagrams from several sockets in turn.

use std::io;
use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;

use bytes::Bytes;

use super::readiness::{Readiness, SocketMask};
use crate::sockets::{self, Counters};

/// Most useless datagrams skipped in one call.
const SKIPPED_MAX: usize = 64;

/// Most datagrams read from one socket before the next socket is read.
const BATCH_MAX: usize = 16;

/// Reads the sockets round-robin in batches. A flood at one socket delays the others by at most a batch.
#[derive(Debug)]
pub(super) struct Receiver {
    /// At most as many as a `u64` has bits.
    sockets: Vec<Arc<UdpSocket>>,
    polled: Arc<SocketMask>,
    /// Datagrams from this address are echoes of own broadcasts.
    own_address: SocketAddr,
    /// Index of the socket that is read.
    current: usize,
    /// Number of datagrams read from it in a row.
    batch: usize,
    /// Whether the last call stopped after skipping datagrams, so that more may be waiting.
    has_skipped: bool,
    buffer: Box<[u8]>,
}

impl Receiver {
    pub(super) fn new(
        sockets: Vec<Arc<UdpSocket>>,
        own_address: SocketAddr,
        datagram_max: usize,
    ) -> Self {
        Self {
            sockets,
            polled: Arc::new(SocketMask::all()),
            own_address,
            current: 0,
            batch: 0,
            has_skipped: false,
            // The extra byte reveals datagrams that are too long.
            buffer: vec![0; datagram_max + 1].into(),
        }
    }

    pub(super) const fn own_address(&self) -> SocketAddr {
        self.own_address
    }

    pub(super) fn readiness(&self) -> io::Result<Readiness> {
        Readiness::new(&self.sockets, Arc::clone(&self.polled))
    }

    /// Number of datagrams that the kernel dropped; `None` if it does not report it.
    pub(super) fn kernel_drops(&self) -> Option<u64> {
        sockets::kernel_drops(&self.sockets)
    }

    /// Whether nothing was left when [`Self::next`] last returned `None`.
    pub(super) const fn is_drained(&self) -> bool {
        !self.has_skipped
    }

    /// Reads the next datagram and counts it.
    pub(super) fn next(&mut self, counters: &mut Counters) -> Option<(Bytes, SocketAddr)> {
        self.has_skipped = false;
        // A socket at the end of its batch is tried again after all others.
        let is_batch_complete = self.batch == BATCH_MAX;
        for _ in 0..self.sockets.len() + usize::from(is_batch_complete) {
            if self.batch < BATCH_MAX && self.polled.has(self.current) {
                let socket = Arc::clone(&self.sockets[self.current]);
                let datagram = self.receive(&socket, counters);
                if datagram.is_some() {
                    self.batch += 1;
                    return datagram;
                }
            }
            self.current = (self.current + 1) % self.sockets.len();
            self.batch = 0;
        }
        None
    }

    /// Reads the next usable datagram of a socket.
    fn receive(
        &mut self,
        socket: &UdpSocket,
        counters: &mut Counters,
    ) -> Option<(Bytes, SocketAddr)> {
        let datagram_max = self.buffer.len() - 1;
        for _ in 0..SKIPPED_MAX {
            match socket.recv_from(&mut self.buffer) {
                Ok((len, _)) if len > datagram_max => counters.too_long += 1,
                // An echo of an own multicast.
                Ok((_, address)) if address == self.own_address => {}
                Ok((len, address)) => {
                    counters.received += 1;
                    return Some((Bytes::copy_from_slice(&self.buffer[..len]), address));
                }
                // The error of an earlier send is reported here once (ICMP).
                Err(error) if error.kind() != io::ErrorKind::WouldBlock => {}
                Err(_) => return None,
            }
        }
        self.has_skipped = true;
        None
    }
}
