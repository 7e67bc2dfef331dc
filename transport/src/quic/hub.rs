//! How connections come to be, and what is done with one while it lasts.

use std::collections::VecDeque;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use bytes::Bytes;
use muster_machines::identity::NodeId;
use quinn::{Connection, Endpoint, Incoming, ReadToEndError};
use tokio::sync::{Semaphore, mpsc, oneshot};
use tokio::task::JoinSet;
use tokio::time::timeout;

use super::budget::{Budget, Budgets};
use super::identity::{Identities, Peer};
use super::inbox::Inbox;
use super::links::{BUSY, Link, Links, NOT_TRUSTED, Opened, close};
use super::stream::Stream;
use super::tls::{OPERATOR, Refusal, Refusals, expected_name, proved};
use crate::sockets::Clock;

/// How long a handshake may take.
pub(super) const HANDSHAKE_MAX: Duration = Duration::from_secs(2);

/// How many handshakes that others began are under way at most: for one more, the oldest is given up. So whoever begins
/// many and finishes none has to begin as many while one takes place, to keep others out.
const HANDSHAKES_MAX: usize = 32;

/// How many handshakes an address may begin at once, and how long it takes until it may begin one more: drones share an
/// address only where they share a machine.
const HANDSHAKES_OF_ONE: Budget = Budget {
    burst: 64,
    refill: Duration::from_millis(50),
};

/// How many all addresses together may begin with which there is no connection.
const HANDSHAKES_OF_STRANGERS: Budget = Budget {
    burst: 512,
    refill: Duration::from_millis(5),
};

/// How many frames that are too long for a datagram may wait for a stream.
const LONG_MAX: usize = 16;

/// How long a frame may take on its stream; an older one is of no use.
const LONG_LASTS: Duration = Duration::from_secs(1);

/// How many operators are spoken with at once, and how many streams of theirs may wait to be looked at.
pub(super) const OPERATORS_MAX: usize = 4;

/// What the transport and its tasks share.
pub(super) struct Hub {
    pub(super) id: NodeId,
    pub(super) protocol: Vec<u8>,
    pub(super) identities: Arc<dyn Identities>,
    pub(super) clock: Clock,
    pub(super) endpoint: Endpoint,
    pub(super) client: quinn::ClientConfig,
    pub(super) datagram_max: usize,
    pub(super) links: Links,
    pub(super) inbox: Inbox,
    pub(super) refusals: Arc<Refusals>,
    /// Frames that were dropped because they were too long.
    pub(super) too_long: AtomicU64,
    /// What came in among the beacons and was none, or of nobody who is believed.
    pub(super) beacons_refused: AtomicU64,
    pub(super) operators: Semaphore,
    pub(super) streams: mpsc::Sender<Stream>,
}

impl Hub {
    /// Takes connections, until the endpoint is closed.
    pub(super) async fn accept(self: Arc<Self>) {
        let mut budgets = Budgets::new(HANDSHAKES_OF_ONE, HANDSHAKES_OF_STRANGERS);
        let mut handshakes = VecDeque::new();
        // They end with this task.
        let mut served = JoinSet::new();
        while let Some(incoming) = self.endpoint.accept().await {
            while served.try_join_next().is_some() {}
            if !incoming.remote_address_validated() {
                // It costs nothing here, and whoever answers is where it says.
                let _ = incoming.retry();
                continue;
            }
            let address = incoming.remote_address().ip();
            if !budgets.take((self.clock)(), address, self.links.lead_to(address)) {
                self.refusals.count(Refusal::TooMany);
                incoming.ignore();
                continue;
            }
            handshakes.retain(|given_up: &oneshot::Sender<()>| !given_up.is_closed());
            if handshakes.len() >= HANDSHAKES_MAX {
                handshakes.pop_front();
            }
            let (given_up, is_given_up) = oneshot::channel();
            handshakes.push_back(given_up);
            served.spawn(Arc::clone(&self).take(incoming, is_given_up));
        }
    }

    /// Takes a connection and serves it to its end.
    async fn take(self: Arc<Self>, incoming: Incoming, mut given_up: oneshot::Receiver<()>) {
        let handshake = timeout(HANDSHAKE_MAX, incoming.into_future());
        let connection = tokio::select! {
            connection = handshake => connection,
            _ = &mut given_up => return self.refusals.count(Refusal::TooMany),
        };
        drop(given_up);
        match connection {
            Err(_) => self.refusals.count(Refusal::Unfinished),
            Ok(Err(error)) => self.refuse(&error),
            Ok(Ok(connection)) => match proved(&*self.identities, &connection) {
                Some((Peer::Drone(drone), protocol))
                    if protocol == self.protocol && drone != self.id =>
                {
                    self.serve(drone, drone, connection).await;
                }
                Some((Peer::Operator, protocol)) if protocol == OPERATOR => {
                    self.serve_operator(connection).await;
                }
                _ => {
                    self.refusals.count(Refusal::Unfinished);
                    close(&connection, NOT_TRUSTED);
                }
            },
        }
    }

    /// What this very drone is to others, and never to itself.
    const fn peer(&self) -> Peer {
        Peer::Drone(self.id)
    }

    fn refuse(&self, error: &quinn::ConnectionError) {
        if let Some(refusal) = Refusal::of(error) {
            self.refusals.count(refusal);
        }
    }

    /// Opens a connection and serves it to its end: with whom it was, or nothing if it never was.
    pub(super) async fn connect(
        &self,
        address: SocketAddr,
        drone: Option<NodeId>,
    ) -> Option<NodeId> {
        let config = self.client.clone();
        let connecting = self
            .endpoint
            .connect_with(config, address, &expected_name(drone));
        let Ok(connecting) = connecting else {
            self.refusals.count(Refusal::Unfinished);
            return None;
        };
        let connection = match timeout(HANDSHAKE_MAX, connecting).await {
            Ok(Ok(connection)) => connection,
            Ok(Err(error)) => {
                self.refuse(&error);
                return None;
            }
            Err(_) => {
                self.refusals.count(Refusal::Unfinished);
                return None;
            }
        };
        let proved = proved(&*self.identities, &connection);
        let Some((Peer::Drone(drone), _)) = proved.filter(|(it, _)| *it != self.peer()) else {
            close(&connection, NOT_TRUSTED);
            return None;
        };
        let served = connection.clone();
        self.serve(drone, self.id, connection).await;
        // Only what is said at the end tells who is not believed at the other end: there, this one proves its key last.
        if let Some(error) = served.close_reason()
            && Refusal::of(&error) == Some(Refusal::Denied)
        {
            self.refusals.count(Refusal::Denied);
        }
        Some(drone)
    }

    /// Takes in what comes over a connection with a drone, until it ends.
    async fn serve(&self, drone: NodeId, opened_by: NodeId, connection: Connection) {
        let (long, waiting) = mpsc::channel(LONG_MAX);
        let link = Link {
            connection: connection.clone(),
            opened: Opened {
                by: opened_by,
                at: (self.clock)(),
            },
            long,
        };
        if !self.links.admit(drone, link) {
            return;
        }
        tokio::select! {
            () = self.read_datagrams(drone, &connection) => {}
            () = self.read_streams(drone, &connection) => {}
            () = write_streams(&connection, waiting) => {}
        }
        self.links.dismiss(drone, &connection);
    }

    async fn read_datagrams(&self, drone: NodeId, connection: &Connection) {
        while let Ok(datagram) = connection.read_datagram().await {
            self.put(drone, datagram);
        }
    }

    /// One stream after the other, so that a frame does not overtake another: each is short, and awaited for a short time.
    async fn read_streams(&self, drone: NodeId, connection: &Connection) {
        while let Ok(mut stream) = connection.accept_uni().await {
            match timeout(LONG_LASTS, stream.read_to_end(self.datagram_max)).await {
                Ok(Ok(frame)) => self.put(drone, frame.into()),
                Ok(Err(ReadToEndError::TooLong)) => {
                    self.too_long.fetch_add(1, Ordering::Relaxed);
                }
                Ok(Err(ReadToEndError::Read(_))) | Err(_) => {}
            }
        }
    }

    fn put(&self, drone: NodeId, frame: Bytes) {
        if frame.len() > self.datagram_max {
            self.too_long.fetch_add(1, Ordering::Relaxed);
        } else {
            self.inbox.put(drone, frame);
        }
    }

    /// Hands on the streams that an operator opens, until its connection ends.
    async fn serve_operator(&self, connection: Connection) {
        let Ok(_permit) = self.operators.try_acquire() else {
            self.refusals.count(Refusal::TooMany);
            return close(&connection, BUSY);
        };
        while let Ok((writer, reader)) = connection.accept_bi().await {
            // A stream for which there is no room ends, which its operator sees.
            let _ = self.streams.try_send(Stream { writer, reader });
        }
    }
}

/// Sends what is too long for datagrams, each on a stream of its own, until the connection ends.
async fn write_streams(connection: &Connection, mut waiting: mpsc::Receiver<Bytes>) {
    while let Some(frame) = waiting.recv().await {
        let written = timeout(LONG_LASTS, async {
            let mut stream = connection.open_uni().await?;
            stream.write_all(&frame).await?;
            // It fails only where it was said before that nothing more is written.
            let _ = stream.finish();
            Ok::<_, quinn::WriteError>(())
        });
        // What takes too long is lost, as it would be on the air; a stream that was begun is reset.
        let _ = written.await;
    }
    connection.closed().await;
}
