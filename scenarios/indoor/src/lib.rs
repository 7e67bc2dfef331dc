//! A world for drones that patrol indoors: flats with walls and people, point robots with odometry and sonars that err.
//!
//! The drone is the machine of `muster-indoor`. The same flat and seed give the same patrol, on both engines.

pub mod campaign;
pub mod compare;
pub mod engine;
mod failing;
pub mod flat;
pub mod page;
pub mod patrols;
mod people;
mod robot;
mod rule;
pub mod world;
