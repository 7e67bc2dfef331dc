use muster_machines::identity::NodeId;
use muster_machines::radio::Authenticator;

/// An Ed25519 public key (RFC 8032).
pub type PublicKey = [u8; 32];

/// The authenticated peer of a connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Peer {
    /// A drone of the fleet.
    Drone(NodeId),
    /// An operator, who has the fleet's secret key.
    Operator,
}

/// Why a key is not trusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Distrust {
    /// No drone of the fleet has this key.
    Stranger,
    /// The drone with this key is revoked.
    Revoked,
}

/// The key of this end, and the keys that it trusts.
///
/// One key signs frames, handshakes and beacons. Their signed bytes can't be confused: a frame starts with its version, a
/// small number; TLS signs 64 spaces first (RFC 8446, section 4.4.3); a beacon starts with its name.
pub trait Identities: Authenticator + Send + Sync {
    /// The own public key.
    fn public_key(&self) -> PublicKey;

    /// Whether connections and beacons of a drone are accepted: its key is not revoked.
    fn is_trusted(&self, drone: NodeId) -> bool;

    /// The peer with this key.
    ///
    /// # Errors
    /// If the key is not trusted.
    fn peer(&self, key: &PublicKey) -> Result<Peer, Distrust>;
}
