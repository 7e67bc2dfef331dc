//! Worlds for drones: scenario files, the two engines that run them, vehicles, checkers, reports, campaigns and
//! the comparison with the thesis.

pub mod campaign;
pub mod chaos;
mod checkers;
pub mod engine;
pub mod report;
pub mod scenario;
mod segments;
pub mod thesis;
pub mod twin;
mod world;

/// The examples of the page for contributors.
#[cfg(doctest)]
#[doc = include_str!("../../CONTRIBUTING.md")]
struct Contributing;
