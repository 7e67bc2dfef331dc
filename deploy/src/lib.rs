//! Drones as real processes: what a drone's file says, and the daemon that flies it.

pub mod config;
pub mod daemon;
pub mod log;
