//! Simulation of swarms: scenario files, two engines, vehicles, rule checkers, reports, campaigns, fault searches and the
//! comparison with the thesis.

pub mod campaign;
pub mod chaos;
mod checkers;
pub mod controllers;
pub mod engine;
pub mod localisation;
pub mod report;
pub mod scenario;
mod segments;
pub mod thesis;
pub mod tuning;
pub mod twin;
mod world;

/// Runs the examples of the book's page on protocols as documentation tests.
#[cfg(doctest)]
#[doc = include_str!("../../docs/src/extend/protocol.md")]
struct ProtocolPage;
