//! The daemon `musterd`: one drone as a process, its configuration and status; and the launcher that starts drones on a host
//! for `muster swarm`.

pub mod audit;
#[doc(hidden)]
pub mod clock;
pub mod config;
#[doc(hidden)]
pub mod control;
pub mod daemon;
mod identities;
pub mod launcher;
pub mod log;
pub mod operator;
pub mod pose;
pub mod program;
pub mod slots;
pub mod status;
