//! What must always hold: one file a rule, fed with what happens, apart from whatever makes it happen.
//!
//! Rules bear the numbers of the design's list of invariants.

mod admission;
mod arming;
mod barrier;
mod bounds;
mod election;
mod failure;
mod landing;
mod obedience;
mod progress;
mod separation;
mod settled;

pub(crate) use admission::AdmissionChecker;
pub(crate) use arming::ArmingChecker;
pub(crate) use barrier::BarrierChecker;
pub(crate) use bounds::BoundsChecker;
pub(crate) use election::ElectionChecker;
pub(crate) use failure::unplanned_failure;
pub(crate) use landing::check_landed;
pub(crate) use obedience::ObedienceChecker;
pub(crate) use progress::ProgressChecker;
pub(crate) use separation::SeparationChecker;
pub(crate) use settled::{MemberState, SettledChecker};

use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;

/// A rule that was broken.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Violation {
    pub(crate) rule: u8,
    pub(crate) at: Timestamp,
    pub(crate) drones: Vec<NodeId>,
    pub(crate) what: String,
}
