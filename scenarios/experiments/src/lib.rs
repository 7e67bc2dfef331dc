//! What is done with simulated flights: their pages, tables and recordings, campaigns, the search for faults, the comparison
//! with the thesis, gains from a hover test, and localisation over recorded flights.
//!
//! Nothing here is executed in each simulated frame.

pub mod campaign;
pub mod chaos;
pub mod localisation;
pub mod output;
pub mod thesis;
pub mod tuning;
