//! Who belongs to a fleet, and how drones prove it.
//!
//! A fleet has a key, which stays with its operator. It signs the roster, which says which drone has which key, and the
//! list of who was expelled. Each drone has a key of its own, with which it signs what it says, and the fleet's public
//! key, pinned: it believes a roster and a list that are signed by that key, and nothing else.
//!
//! What a fleet's folder holds:
//!
//! | file | what it is | who needs it |
//! | --- | --- | --- |
//! | `fleet.key` | the fleet's secret key | the operator, and nobody else |
//! | `fleet.pub` | its public key | each drone |
//! | `roster.toml` | each drone's public key, signed | each drone |
//! | `expelled.toml` | who is not believed any more, signed, with a number that rises | each drone |
//! | `drone-ID.key` | a drone's secret key | that drone, and nobody else |

mod authenticator;
mod fleet;
mod key;
mod lists;
mod operator;

pub use authenticator::{Ed25519Authenticator, OlderList, Untrusted};
pub use fleet::{Fleet, KeysError};
pub use key::{DroneKey, FleetKey};
pub use lists::{RevocationList, Roster};
pub use operator::OperatorKey;

#[cfg(test)]
mod tests;
