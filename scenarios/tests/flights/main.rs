//! Complete flights of shipped scenarios.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod any;
mod avoid;
mod changes;
mod controllers;
#[cfg(feature = "flaws")]
mod defects;
mod election;
mod engines;
mod failsafe;
mod faults;
mod follow;
mod formations;
mod found;
mod holds;
mod relay;
mod settling;
mod shipped;
#[cfg(feature = "flaws")]
mod spinning;
mod support;
mod thesis;
mod tree;
