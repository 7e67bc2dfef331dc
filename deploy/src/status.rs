//! Asks drones' processes what they are doing, and shows it.

mod ask;
mod table;

pub use ask::{AskError, Target, ask_all, targets};
pub use table::{Answer, table};
