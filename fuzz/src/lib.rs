//! What the fuzz targets share: a drone made of its five machines, and files for whatever reads files.

mod drone;
mod files;

pub use drone::{Drone, Op, ops, scenarios};
pub use files::{SCENARIOS, scratch, with_file};
