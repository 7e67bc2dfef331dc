//! Operation of whole fleets: flies a swarm of processes on one or many machines, and queries their status.

pub mod campaign;
pub mod controller;
mod drone_file;
pub mod firmware;
mod flow;
pub mod hosts;
pub mod image;
mod pilot;
mod pose;
pub mod promotion;
pub mod release;
mod remote;
pub mod rollout;
pub mod status;
pub mod swarm;

pub use flow::FlowSource;
pub use pose::PoseSource;
