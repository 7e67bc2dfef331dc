//! Simulation of swarms: scenario files, two engines, vehicles, rule checkers, and the report of a run.

mod checkers;
pub mod controllers;
pub mod engine;
pub mod report;
pub mod scenario;
mod segments;
pub mod twin;
mod world;

/// Runs the examples of the book's page on protocols as documentation tests.
#[cfg(doctest)]
#[doc = include_str!("../../docs/src/extend/protocol.md")]
struct ProtocolPage;
