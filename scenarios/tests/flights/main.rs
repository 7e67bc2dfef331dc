//! Complete flights of shipped scenarios.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod any;
mod avoid;
mod changes;
mod defects;
mod election;
mod engines;
mod failsafe;
mod faults;
mod follow;
mod formations;
mod found;
mod holds;
mod planted;
mod relay;
mod settling;
mod shipped;
mod spinning;
mod support;
mod thesis;
mod tree;
