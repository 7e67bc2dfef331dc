//! What the operator says of a slot, and what a host says of itself.

use std::collections::{BTreeMap, BTreeSet};
use std::net::SocketAddr;

use serde::{Deserialize, Serialize};

use super::disk::Failure;
use super::gate::{DroneHealth, GateLimits};

/// What a slot has, as its file `slot.json` says. Another version of the program may read it, so fields are only added.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct SlotFacts {
    /// Version of the release.
    pub version: String,
    /// SHA-256 of the release's manifest, in hexadecimal.
    pub release: String,
    /// SHA-256 of the configuration, in hexadecimal.
    pub configuration: String,
    /// Versions of frames that it reads.
    pub wire: Vec<u8>,
    /// Versions of journals that it reads.
    pub journal: Vec<u8>,
    /// The drones of the host, each with the address of its status.
    pub drones: BTreeMap<u32, SocketAddr>,
    /// Drones of other hosts that each drone must hear before the slot is good.
    pub peers: BTreeSet<u32>,
    /// Limits of its trial.
    pub gate: GateLimits,
    /// How its drones reach each other, in words: those of another network don't hear them. `None` if an older program wrote
    /// the slot.
    #[serde(default)]
    pub network: Option<String>,
}

impl SlotFacts {
    /// Name of the slot: the version, and the first digits of both hashes.
    #[must_use]
    pub fn id(&self) -> String {
        let short = |hash: &str| hash.chars().take(8).collect::<String>();
        format!(
            "{}-{}-{}",
            self.version,
            short(&self.release),
            short(&self.configuration)
        )
    }
}

/// What a host says of itself.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct HostFacts {
    /// The slot that runs. `None` before the first release.
    pub current: Option<SlotFacts>,
    /// Name of the slot that has proven itself last.
    pub good: Option<String>,
    /// Name of the slot that a rollback leads to.
    pub rollback_slot: Option<String>,
    /// Whether a slot is on trial now.
    pub is_on_trial: bool,
    /// Time since a slot proved itself last, in seconds.
    pub good_for_s: Option<u64>,
    /// Why a release was taken back last. `None` once another has proven itself.
    pub failure: Option<Failure>,
    /// The drones of the running slot.
    pub drones: BTreeMap<u32, DroneFacts>,
    /// Free space for slots, in bytes.
    pub free_bytes: u64,
}

/// A drone, as its host sees it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct DroneFacts {
    /// How its service does.
    pub health: DroneHealth,
    /// Whether it is armed or takes part in a flight.
    pub in_flight: bool,
    /// Version that its process reports.
    pub version: Option<String>,
    /// Dropped frames and datagrams since its process started.
    pub dropped: u64,
    /// How often systemd has started its process again: after a crash, or by the watchdog.
    pub restarts: u32,
}
