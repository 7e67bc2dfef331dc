//! What every transport promises, tried on each, and what only one over a real network has to do.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod quic;
mod simulated;
mod suite;
mod udp;
