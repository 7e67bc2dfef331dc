//! A drone in a building that it has a map of: maps, and where the drone is in them. Everything is pure: no clock, no file,
//! no random source of the host.

pub mod avoidance;
pub mod frames;
