//! The search for a fault plan that breaks a rule: plans drawn at random, flown on the events engine, and the first one
//! that breaks a rule made as small as it gets.
//!
//! All of a plan follows from its seed: which of the values of `[chaos.vary]` the swarm has, and what befalls it, when
//! and whom, by the grammar (`grammar.rs`). Plans are taken in the order of their seeds, and the one that is told of is the
//! first of them that breaks a rule, however many are flown at once.

mod coverage;
mod grammar;
mod run;
mod search;
mod shrink;
mod state;
mod table;

pub use coverage::{Coverage, Row};
pub use run::{Finding, Progress, RUN_LIMIT, Searched, run};
pub use search::{Request, Search};
pub use state::{Broken, CHAOS_JSON};
pub use table::table;
