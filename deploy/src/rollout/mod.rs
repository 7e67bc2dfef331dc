//! Rollouts: a release and its configuration for all hosts of a fleet, in waves, and back if it goes wrong.
//!
//! Each host decides by itself whether a release is good ([`muster_daemon::slots`]). What is decided here is which host is
//! changed when (`waves`).

mod apply;
mod desired;
mod look;
mod plan;
mod session;
mod table;
mod waves;
mod worker;

pub use self::apply::{Applied, ApplyRequest, HostOutcome, Progress, apply};
pub use self::desired::{Desired, check_roster, desired};
pub use self::look::{Looked, Planned, audit, look, plan, roll_back};
pub use self::plan::{HostPlan, Work};
pub use self::session::SessionError;
pub use self::table::{applied_table, audit_table, plan_table, status_table};
pub use crate::remote::pass_through;
