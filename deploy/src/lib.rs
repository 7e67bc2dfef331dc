//! Operation of whole fleets: flies a swarm of processes on one or many machines, and queries their status.

pub mod controller;
pub mod firmware;
mod pose;
pub mod status;
pub mod swarm;

pub use pose::PoseSource;
