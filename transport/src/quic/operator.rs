use std::fmt;
use std::io;
use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr};
use std::sync::Arc;

use quinn::{Connection, Endpoint};
use thiserror::Error;
use tokio::time::timeout;

use super::hub::HANDSHAKE_MAX;
use super::identity::{Identities, Peer};
use super::links::OVER;
use super::stream::Stream;
use super::tls::{OPERATOR, Refusal, Refusals, Trust, authenticated_peer, client, expected_name};
use super::{close_endpoint, transport_config};
use muster_machines::identity::NodeId;

/// Why an operator has no connection with a drone.
#[derive(Debug, Error)]
pub enum OperatorError {
    /// This machine has no socket for this kind of address.
    #[error("can't open a socket")]
    Socket(#[source] io::Error),
    /// No drone answers at the address.
    #[error("no drone answers at {0}")]
    NoAnswer(SocketAddr),
    /// The peer is not trusted: its key is unknown or revoked.
    #[error("the peer at {address} is not trusted: {refusal}")]
    Untrusted {
        /// Address of the peer.
        address: SocketAddr,
        /// The reason.
        refusal: Refusal,
    },
    /// The drone closed the connection: it belongs to another fleet or has too many operators.
    #[error("the drone closed the connection: {0}")]
    Ended(#[from] quinn::ConnectionError),
}

/// An operator's connection with a drone, authenticated by the fleet's secret key. Dropping it closes the connection.
pub struct Operator {
    endpoint: Endpoint,
    connection: Connection,
    drone: NodeId,
}

impl fmt::Debug for Operator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Operator").field(&self.drone).finish()
    }
}

impl Operator {
    /// Connects to the drone at an address. Must be called within a Tokio runtime with I/O and time enabled.
    ///
    /// # Errors
    /// If there is no drone of the fleet.
    pub async fn connect(
        address: SocketAddr,
        identities: Arc<dyn Identities>,
    ) -> Result<Self, OperatorError> {
        let refusals = Arc::<Refusals>::default();
        let trust = Trust::new(Arc::clone(&identities), Arc::clone(&refusals));
        let mut config = client(&trust, OPERATOR);
        config.transport_config(Arc::new(transport_config()));
        let any = match address {
            SocketAddr::V4(_) => SocketAddr::from((Ipv4Addr::UNSPECIFIED, 0)),
            SocketAddr::V6(_) => SocketAddr::from((Ipv6Addr::UNSPECIFIED, 0)),
        };
        let endpoint = Endpoint::client(any).map_err(OperatorError::Socket)?;
        let connecting = endpoint.connect_with(config, address, &expected_name(None));
        let connecting = connecting.map_err(|_| OperatorError::NoAnswer(address))?;
        let connection = timeout(HANDSHAKE_MAX, connecting).await;
        let connection = connection.ok().and_then(Result::ok);
        let peer = connection.and_then(|it| Some((authenticated_peer(&*identities, &it)?.0, it)));
        match (peer, refusals.all().into_keys().next()) {
            (Some((Peer::Drone(drone), connection)), _) => Ok(Self {
                endpoint,
                connection,
                drone,
            }),
            (_, Some(refusal)) => Err(OperatorError::Untrusted { address, refusal }),
            (_, None) => Err(OperatorError::NoAnswer(address)),
        }
    }

    /// The authenticated drone.
    #[must_use]
    pub const fn drone(&self) -> NodeId {
        self.drone
    }

    /// Opens a stream.
    ///
    /// # Errors
    /// If the drone has closed the connection.
    pub async fn open(&self) -> Result<Stream, OperatorError> {
        let (writer, reader) = self.connection.open_bi().await?;
        Ok(Stream { writer, reader })
    }

    /// Closes the connection and notifies the drone.
    pub async fn end(self) {
        close_endpoint(&self.endpoint).await;
    }
}

impl Drop for Operator {
    fn drop(&mut self) {
        let (code, reason) = OVER;
        self.endpoint.close(code, reason);
    }
}
