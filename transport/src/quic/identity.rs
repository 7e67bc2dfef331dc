use muster_machines::identity::NodeId;
use muster_machines::radio::Authenticator;

/// A public key of Ed25519, as RFC 8032 writes it.
pub type PublicKey = [u8; 32];

/// Who is at the other end of a connection, as the key says that it has proved to have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Peer {
    /// A drone of the fleet.
    Drone(NodeId),
    /// Whoever has the fleet's own secret key.
    Operator,
}

/// Why nobody with a key is spoken to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Distrust {
    /// Nobody of the fleet has this key.
    Stranger,
    /// It is the key of a drone that was expelled.
    RevocationList,
}

/// Who this end is, and whom it believes.
///
/// The key that signs frames signs handshakes and beacons, too. None passes for another: a frame begins with its version,
/// which is a small number, what TLS signs with 64 spaces (RFC 8446, section 4.4.3), and a beacon with its name.
pub trait Identities: Authenticator + Send + Sync {
    /// This end's own public key.
    fn public_key(&self) -> PublicKey;

    /// Who has this key.
    ///
    /// # Errors
    /// When whoever has it is not to be spoken to.
    fn peer(&self, key: &PublicKey) -> Result<Peer, Distrust>;
}
