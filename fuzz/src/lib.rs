//! What the fuzz targets share: a drone made of its five machines, and files for whatever reads files.

#[cfg(feature = "worlds")]
mod drone;
mod files;

#[cfg(feature = "worlds")]
pub use drone::{Drone, Op, ops, scenarios};
pub use files::{SCENARIOS, scratch, with_file};
