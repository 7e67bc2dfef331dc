//! Complete flights for what is done with them: the comparison with the thesis, hover tests, and searches.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

#[cfg(feature = "flaws")]
mod planted;
mod support;
mod thesis;
mod tuning;
