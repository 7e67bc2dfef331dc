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
use super::tls::{OPERATOR, Refusal, Refusals, Trust, client, expected_name, proved};
use super::{farewell, transport_config};
use muster_machines::identity::NodeId;

/// Why an operator can't speak with a drone.
#[derive(Debug, Error)]
pub enum OperatorError {
    /// This machine has no socket for it, or none that reaches such an address.
    #[error("can't open a socket")]
    Socket(#[source] io::Error),
    /// Nobody answers at the address, or not as a drone does.
    #[error("no drone answers at {0}")]
    Silent(SocketAddr),
    /// Whoever answers at the address is not to be spoken to: a stranger, or a drone that was expelled.
    #[error("who answers at {address} is not believed: {refusal}")]
    NotBelieved {
        /// Where.
        address: SocketAddr,
        /// Why.
        refusal: Refusal,
    },
    /// The drone has ended the connection: it has another fleet's public key, or speaks with too many operators already.
    #[error("the drone has ended the connection: {0}")]
    Ended(#[from] quinn::ConnectionError),
}

/// An operator's connection with a drone, by the fleet's own key. It ends with this value.
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
    /// Connects with the drone at an address, whichever of the fleet's it is. Must be called within a runtime that drives
    /// input and time.
    ///
    /// # Errors
    /// When there is no drone that proves to be of the fleet.
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
        let connecting = connecting.map_err(|_| OperatorError::Silent(address))?;
        let connection = timeout(HANDSHAKE_MAX, connecting).await;
        let connection = connection.ok().and_then(Result::ok);
        let proved = connection.and_then(|it| Some((proved(&*identities, &it)?.0, it)));
        match (proved, refusals.all().into_keys().next()) {
            (Some((Peer::Drone(drone), connection)), _) => Ok(Self {
                endpoint,
                connection,
                drone,
            }),
            (_, Some(refusal)) => Err(OperatorError::NotBelieved { address, refusal }),
            (_, None) => Err(OperatorError::Silent(address)),
        }
    }

    /// Which drone it is, as its key has proved.
    #[must_use]
    pub const fn drone(&self) -> NodeId {
        self.drone
    }

    /// Opens a stream.
    ///
    /// # Errors
    /// When the drone has ended the connection.
    pub async fn open(&self) -> Result<Stream, OperatorError> {
        let (writer, reader) = self.connection.open_bi().await?;
        Ok(Stream { writer, reader })
    }

    /// Ends the connection, and lets the drone know.
    pub async fn end(self) {
        farewell(&self.endpoint).await;
    }
}

impl Drop for Operator {
    fn drop(&mut self) {
        let (code, why) = OVER;
        self.endpoint.close(code, why);
    }
}
