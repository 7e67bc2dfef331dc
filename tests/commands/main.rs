//! Commands of `muster`, as processes.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod campaign;
mod card;
mod chaos;
mod closed_pipe;
mod fc;
mod figures;
mod keys;
mod list;
mod map;
mod sim;
mod simulated_controller;
mod support;
mod thesis;
