//! Membership of a fleet, and authentication of its drones.
//!
//! The operator keeps the fleet's secret key. It signs the roster (each drone's public key) and the revocation list. Each
//! drone signs its frames with its own key. It has the fleet's public key pinned and trusts only lists signed by that key.
//!
//! Files in a fleet's folder:
//!
//! | file | content | needed by |
//! | --- | --- | --- |
//! | `fleet.key` | the fleet's secret key | the operator only |
//! | `fleet.pub` | the fleet's public key | each drone |
//! | `roster.toml` | each drone's public key, signed | each drone |
//! | `revoked.toml` | the revocation list: a rising number and revoked drones, signed | each drone |
//! | `drone-ID.key` | a drone's secret key | that drone only |
//! | `drone-ID.grant` | what that drone may do, and the hashes of what was shown for it, signed | that drone |

mod authenticator;
mod evidence;
mod fleet;
mod grant;
mod ground_check;
mod key;
mod lists;
mod operator;
mod release;

pub use authenticator::{Ed25519Authenticator, IdentityMismatch};
pub use evidence::{Evidence, EvidenceKind};
pub use fleet::{Fleet, KeysError};
pub use grant::{CalendarTime, ControllerFacts, Grant, GrantRefusal, GrantedStage};
pub use ground_check::GroundCheck;
pub use key::{DroneKey, FleetKey, hex};
pub use lists::{RevocationList, Roster};
pub use operator::OperatorKey;
pub use release::{MANIFEST_MAX, Manifest, RELEASE_FILE_MAX, ReleaseFile, is_plain};

#[cfg(test)]
mod tests;
