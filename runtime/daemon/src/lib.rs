//! The daemon that flies one drone as a process: its file, the process with its services, what it tells, and the agent that
//! starts drones on a host for whoever flies a whole swarm.

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
pub mod status;
