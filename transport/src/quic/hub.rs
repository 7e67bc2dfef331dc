//! Accepts and opens connections, and serves them until they end.

use std::collections::VecDeque;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use std::time::Duration;

use bytes::Bytes;
use muster_machines::identity::NodeId;
use quinn::{Connection, Endpoint, Incoming, ReadToEndError};
use tokio::sync::{mpsc, oneshot};
use tokio::task::JoinSet;
use tokio::time::timeout;

use super::identity::{Identities, Peer};
use super::inbox::Inbox;
use super::links::{BUSY, Link, Links, NOT_TRUSTED, Opened, close};
use super::operators::{Full, Operators};
use super::rate_limit::{RateLimit, RateLimiter};
use super::tls::{OPERATOR, Refusal, Refusals, authenticated_peer, expected_name};
use crate::sockets::Clock;

/// Time limit of a handshake.
pub(super) const HANDSHAKE_MAX: Duration = Duration::from_secs(2);

/// Most incoming handshakes in progress; a further one aborts the oldest. To block a peer, an attacker must start this many
/// handshakes within the duration of one.
const HANDSHAKES_MAX: usize = 32;

/// Limit of handshakes per address. Only drones on one machine share an address.
const HANDSHAKES_PER_ADDRESS: RateLimit = RateLimit {
    burst: 64,
    refill: Duration::from_millis(50),
};

/// Limit of handshakes from all unconnected addresses together.
const HANDSHAKES_OF_STRANGERS: RateLimit = RateLimit {
    burst: 512,
    refill: Duration::from_millis(5),
};

/// Most frames that queue for a stream because they exceed a datagram.
const LONG_FRAMES_MAX: usize = 16;

/// Time limit of a frame on a stream; a later frame is useless.
const LONG_FRAME_TIMEOUT: Duration = Duration::from_secs(1);

/// State shared by the transport and its tasks.
pub(super) struct Hub {
    pub(super) id: NodeId,
    pub(super) protocol: Vec<u8>,
    pub(super) identities: Arc<dyn Identities>,
    pub(super) clock: Clock,
    pub(super) endpoint: Endpoint,
    pub(super) client: quinn::ClientConfig,
    pub(super) links: Links,
    pub(super) inbox: Inbox,
    pub(super) refusals: Arc<Refusals>,
    /// Beacons refused as malformed, untrusted, replayed or over the rate limit.
    pub(super) beacons_refused: AtomicU64,
    pub(super) operators: Operators,
}

impl Hub {
    /// Accepts connections until the endpoint is closed.
    pub(super) async fn accept(self: Arc<Self>) {
        let mut limiter = RateLimiter::new(HANDSHAKES_PER_ADDRESS, HANDSHAKES_OF_STRANGERS);
        let mut handshakes = VecDeque::new();
        // The connections end with this task.
        let mut served = JoinSet::new();
        while let Some(incoming) = self.endpoint.accept().await {
            while served.try_join_next().is_some() {}
            if !incoming.remote_address_validated() {
                // Stateless, and the answer validates the address.
                let _ = incoming.retry();
                continue;
            }
            let address = incoming.remote_address().ip();
            if !limiter.take((self.clock)(), address, self.links.has_address(address)) {
                self.refusals.count(Refusal::TooMany);
                incoming.ignore();
                continue;
            }
            handshakes.retain(|abort: &oneshot::Sender<()>| !abort.is_closed());
            if handshakes.len() >= HANDSHAKES_MAX {
                // Dropping the sender aborts the handshake.
                handshakes.pop_front();
            }
            let (abort, aborted) = oneshot::channel();
            handshakes.push_back(abort);
            served.spawn(Arc::clone(&self).accept_one(incoming, aborted));
        }
    }

    /// Completes a handshake and serves the connection until it ends.
    async fn accept_one(self: Arc<Self>, incoming: Incoming, mut aborted: oneshot::Receiver<()>) {
        let handshake = timeout(HANDSHAKE_MAX, incoming.into_future());
        let connection = tokio::select! {
            connection = handshake => connection,
            _ = &mut aborted => return self.refusals.count(Refusal::TooMany),
        };
        drop(aborted);
        match connection {
            Err(_) => self.refusals.count(Refusal::Unfinished),
            Ok(Err(error)) => self.refuse(&error),
            Ok(Ok(connection)) => match authenticated_peer(&*self.identities, &connection) {
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

    fn refuse(&self, error: &quinn::ConnectionError) {
        if let Some(refusal) = Refusal::of(error) {
            self.refusals.count(refusal);
        }
    }

    /// Opens a connection and serves it until it ends. Returns the peer; `None` if there was no connection.
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
        let peer = authenticated_peer(&*self.identities, &connection);
        let other = peer.filter(|(peer, _)| *peer != Peer::Drone(self.id));
        let Some((Peer::Drone(drone), _)) = other else {
            close(&connection, NOT_TRUSTED);
            return None;
        };
        let served = connection.clone();
        self.serve(drone, self.id, connection).await;
        // The server checks the client's key last, so a refusal arrives only as the reason for closing.
        if let Some(error) = served.close_reason()
            && Refusal::of(&error) == Some(Refusal::Denied)
        {
            self.refusals.count(Refusal::Denied);
        }
        Some(drone)
    }

    /// Receives and sends frames over a connection until it ends.
    async fn serve(&self, drone: NodeId, opened_by: NodeId, connection: Connection) {
        let (long_frames, queued) = mpsc::channel(LONG_FRAMES_MAX);
        let link = Link {
            connection: connection.clone(),
            opened: Opened {
                by: opened_by,
                at: (self.clock)(),
            },
            long_frames,
        };
        if !self.links.admit(drone, link) {
            return;
        }
        tokio::select! {
            () = self.read_datagrams(drone, &connection) => {}
            () = self.read_streams(drone, &connection) => {}
            () = write_streams(&connection, queued) => {}
        }
        self.links.remove(drone, &connection);
    }

    async fn read_datagrams(&self, drone: NodeId, connection: &Connection) {
        while let Ok(datagram) = connection.read_datagram().await {
            self.inbox.push(drone, datagram);
        }
    }

    /// Reads one stream after the other, which keeps the order of frames.
    async fn read_streams(&self, drone: NodeId, connection: &Connection) {
        while let Ok(mut stream) = connection.accept_uni().await {
            match timeout(
                LONG_FRAME_TIMEOUT,
                stream.read_to_end(self.inbox.frame_max()),
            )
            .await
            {
                Ok(Ok(frame)) => self.inbox.push(drone, frame.into()),
                Ok(Err(ReadToEndError::TooLong)) => self.inbox.count_too_long(),
                Ok(Err(ReadToEndError::Read(_))) | Err(_) => {}
            }
        }
    }

    /// Serves an operator until its connection ends, if there is a place.
    async fn serve_operator(&self, connection: Connection) {
        if let Err(Full) = self.operators.serve(&connection).await {
            self.refusals.count(Refusal::TooMany);
            close(&connection, BUSY);
        }
    }
}

/// Sends each long frame on its own stream, until the connection ends.
async fn write_streams(connection: &Connection, mut queued: mpsc::Receiver<Bytes>) {
    while let Some(frame) = queued.recv().await {
        let written = timeout(LONG_FRAME_TIMEOUT, async {
            let mut stream = connection.open_uni().await?;
            stream.write_all(&frame).await?;
            // It fails only on a finished stream.
            let _ = stream.finish();
            Ok::<_, quinn::WriteError>(())
        });
        // A frame that exceeds the limit is lost; its stream is reset.
        let _ = written.await;
    }
    connection.closed().await;
}
