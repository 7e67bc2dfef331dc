//! Drones as real processes, over real sockets of this machine. Every process ends with its test, however that ends, and
//! none shares an address with another test's.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod fleet;
mod flights;
mod refusals;
mod service;
mod swarm;
