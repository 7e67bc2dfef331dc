//! Claims about the simulated controller, told through the bytes of its port.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod arming;
mod companion;
mod determinism;
mod estimate;
mod failsafe;
mod fitness;
mod flight;
mod flown;
mod link;
mod overriding;
mod port;
mod recorded;
