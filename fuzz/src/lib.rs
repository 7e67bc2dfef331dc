//! Shared code of the fuzz targets: a drone of five machines, and temporary files for readers of files.

mod drone;
mod files;

pub use drone::{Drone, Op, decode_ops, scenarios};
pub use files::{SCENARIOS, scratch, with_file};
