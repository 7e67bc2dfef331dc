//! Whether a host is safe to leave alone with a drone: who can log in, what can be reached, who can read keys.
//!
//! What is found is judged in pure code (`rules`); a fix is a set of files and commands that can be undone (`fix`).

mod card;
mod facts;
mod fix;
mod rules;

use std::io;
use std::path::Path;

use serde::{Deserialize, Serialize};

pub use self::card::{CardRecord, DEFAULT_USER, RADIO, RECORD, SET_RATE};
use self::facts::Facts;
pub(crate) use self::fix::{confirm, undo};

/// Something that an operator should know.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Finding {
    /// Name of the rule.
    pub rule: String,
    /// What was found, in words.
    pub what: String,
    /// Why it matters, in words.
    pub why: String,
    /// How a fix is undone by hand, in words.
    pub undo: String,
    /// Whether `--fix` sets it.
    pub can_be_fixed: bool,
}

/// Audits this host. `asks_for_updates`: whether security updates are to install themselves.
///
/// # Errors
/// If a file can't be read or a command can't be run.
pub(crate) fn audit(asks_for_updates: bool) -> io::Result<Vec<Finding>> {
    let facts = Facts::gather(Path::new("/"), asks_for_updates)?;
    Ok(rules::judge(&facts))
}

/// Sets what the findings ask for, and goes back after a minute unless [`confirm`] is called. Returns what is still found.
///
/// # Errors
/// If a file can't be written or a command can't be run. What was changed until then is undone after a minute.
pub(crate) fn fix(asks_for_updates: bool) -> io::Result<Vec<Finding>> {
    let facts = Facts::gather(Path::new("/"), asks_for_updates)?;
    let findings = rules::judge(&facts);
    let changes = rules::changes(&facts, &findings);
    // Without changes, too: the confirmation that follows is then of this fix.
    fix::carry_out(&changes)?;
    audit(asks_for_updates)
}
