//! Drones as real processes, over real sockets of this machine. Every process ends with its test, however that ends, and
//! none shares an address with another test's.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

/// What is named so flies in real time: it mostly waits, so that `.ci/run` lets it run beside all else.
#[path = "."]
mod real_time {
    mod attack;
    mod fleet;
    mod flights;
    mod hostile;
    mod hosts;
    mod identity;
    mod line;
    mod lossy;
    mod network;
    mod observe;
    mod operator;
    mod refusals;
    mod service;
    mod swarm;
}
