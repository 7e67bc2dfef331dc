//! Drones as real processes: what a drone's file says, the daemon that flies it, and whoever starts a whole swarm of
//! them.

pub mod agent;
mod clock;
pub mod config;
pub mod daemon;
mod identities;
pub mod log;
pub mod operator;
pub mod status;
pub mod swarm;
mod tether;
