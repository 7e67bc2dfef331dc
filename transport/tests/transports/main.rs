//! The contract of all transports, tested on each, and further tests of the network transports.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod quic;
mod simulated;
mod suite;
mod udp;
