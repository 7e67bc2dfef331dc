//! The daemon `musterd`: one drone as a process, its configuration and status; and the agent that starts drones on a host
//! for `muster swarm`.

pub mod agent;
#[doc(hidden)]
pub mod clock;
pub mod config;
#[doc(hidden)]
pub mod control;
pub mod daemon;
mod identities;
pub mod log;
pub mod operator;
pub mod program;
pub mod status;
