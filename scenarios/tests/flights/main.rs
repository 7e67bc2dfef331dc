//! Whole flights of shipped scenarios.

mod engines;
mod support;
mod thesis;
