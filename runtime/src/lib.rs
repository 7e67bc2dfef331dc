//! Input files of a drone and of a swarm: plans, missions, keys and journals; and the simulated vehicle.

pub mod agents;
pub mod diagnostic;
pub mod failure;
pub mod file;
pub mod identity;
pub mod journal;
pub mod map_file;
pub mod mission_file;
pub mod plan;
pub mod schema;
pub mod text;
pub mod vehicle;
