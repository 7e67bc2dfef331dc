//! Fuzz targets, and what they share: a drone of five machines, and temporary files for readers of files.

mod drone;
mod files;
mod targets;

pub use drone::{Drone, Op, decode_ops, scenarios};
pub use files::{SCENARIOS, scratch, with_file};
pub use targets::{TARGETS, Target};
