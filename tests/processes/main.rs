//! Tests with real processes and real sockets. Every process ends with its test, even after a failure. No two tests share an
//! address.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

/// Tests in real time. They mostly wait, so `.ci/run` runs them in parallel with everything else; it selects them by this name.
#[path = "."]
mod real_time {
    mod attack;
    mod autopilot;
    mod controllers;
    mod fleet;
    mod flights;
    mod grants;
    mod hostile;
    mod hosts;
    mod identity;
    mod line;
    mod lossy;
    mod mavlink;
    mod network;
    mod observe;
    mod operator;
    mod rc;
    mod receiver;
    mod refusals;
    mod service;
    mod slow_agent;
    mod slow_disk;
    mod swarm;
}
