//! A drone in a building that it has a map of: maps, and where the drone is in them. Everything is pure: no clock, no file,
//! no random source of the host.

pub mod filter;
pub mod frames;
pub mod log;
pub mod map;
pub mod reading;
pub mod refusal;
pub mod sensor;
