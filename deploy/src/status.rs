//! Queries the status of drones' processes and formats it as a table.

mod ask;
mod table;

pub use ask::{AskError, Target, ask_all, targets};
pub use table::{Answer, table};
