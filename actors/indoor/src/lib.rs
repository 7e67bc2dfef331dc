//! A drone in a building that it has a map of: maps, where the drone is in them, how it keeps clear of what is near, and ways.
//! Everything is pure: no clock, no file, no random source of the host.

pub mod avoidance;
pub mod coverage;
mod digest;
pub mod filter;
pub mod log;
pub mod map;
pub mod path;
pub mod patrol;
pub mod random;
pub mod refusal;
pub mod sensor;

pub use muster_machines::indoor::{frames, reading};
