//! Fleets of drones: whoever starts a whole swarm of processes on one machine or many, and asks them what they do.

pub mod status;
pub mod swarm;
