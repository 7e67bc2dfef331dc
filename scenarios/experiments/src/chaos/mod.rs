//! Search for a fault plan that breaks a rule: random plans run on the events engine, and the first one that breaks a rule
//! is shrunk.
//!
//! A plan depends on its seed only: the values of `[chaos.vary]`, and the faults with their times and targets (see
//! `grammar.rs`). Plans are ordered by seed. The reported plan is the first that breaks a rule, for any number of threads.

mod coverage;
mod grammar;
mod run;
mod search;
mod shrink;
mod state;
mod table;

pub use coverage::{Coverage, Row};
pub use run::{Finding, Progress, RUN_LIMIT, SearchResult, run};
pub use search::{Request, Search};
pub use state::{AcceptedPlan, BrokenPlan, CHAOS_JSON};
pub use table::{explanation, table};
