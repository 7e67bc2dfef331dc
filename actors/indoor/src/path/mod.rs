//! Paths over a map: which cells a drone can be in, the cheapest path between two of them, and that path as few straight legs.

mod floor;
mod search;
mod straight;
#[cfg(test)]
mod tests;

pub use self::floor::{Floor, Obstacles};
pub use self::search::{Found, Search};

/// Cost of one cell's edge in the open. A diagonal costs [`DIAGONAL`]; √2 to 0.6 %.
pub(crate) const STRAIGHT: u32 = 5;
pub(crate) const DIAGONAL: u32 = 7;
