//! The protocol between `muster deploy` and `musterd slot serve` on a host: one JSON object a line, over standard input and
//! output. The contents of files follow their order as they are.

use serde::{Deserialize, Serialize};

use super::facts::HostFacts;
use super::install::Incoming;
use crate::audit::Finding;

/// Version of the protocol. Orders and replies are only added to one version.
pub const PROTOCOL: u32 = 1;

/// An order of the operator.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum SlotOrder {
    /// Nothing; the operator is there.
    Ping,
    /// Report on the host.
    Look,
    /// Lock the host against other operators for as long as this session lasts. Settles the slots.
    Lock {
        /// Who asks, for the others.
        operator: String,
    },
    /// Write a slot. The contents of its files follow.
    Install(Box<Incoming>),
    /// Try a slot.
    Try {
        /// Its name.
        slot: String,
    },
    /// Run the good slot before this one again.
    RollBack,
    /// Call a drone down: it lands, and its process ends.
    Recall {
        /// Its number.
        drone: u32,
    },
    /// Say what is not safe about the host.
    Audit,
    /// Make it safe. It is undone after a minute without [`SlotOrder::ConfirmFix`].
    Fix,
    /// From here on, audits and fixes of this session ask for unattended security updates, too.
    WithUpdates,
    /// The operator can still log in.
    ConfirmFix,
}

/// A reply to an order.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum SlotReply {
    /// The session begins.
    Hello {
        /// The protocol's version.
        protocol: u32,
        /// Version of `musterd`.
        version: String,
        /// Processor, as in the names of a release's folders.
        processor: String,
        /// Whether the session may change the host.
        is_root: bool,
    },
    /// The order was carried out.
    Done,
    /// What the host says of itself.
    Host(Box<HostFacts>),
    /// What is not safe about the host.
    Findings(Vec<Finding>),
    /// A slot was written.
    Installed {
        /// Its name.
        slot: String,
    },
    /// Another operator has the host locked.
    Busy {
        /// Who it is.
        operator: String,
    },
    /// The order was not carried out; why, in words.
    Refused(String),
}
