//! How far a search is, on the disk.

use std::path::Path;

use muster_runtime::diagnostic::{BadInput, read_text};
use serde::{Deserialize, Serialize};

use super::coverage::Coverage;
use super::search::Search;
use crate::campaign::CampaignError;
use crate::report::{Complete, json, make_folder};

/// The file that says how far a search is.
pub const CHAOS_JSON: &str = "chaos.json";

/// What a search has come to.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Tally {
    /// Plans that were flown, from the first seed on.
    pub(super) plans: u64,
    /// Those of them that broke a rule.
    #[serde(default)]
    pub(super) broken: Vec<Broken>,
    /// How many of them flew their mission to its end for whoever was left.
    pub(super) completed: u64,
    /// How many times values were drawn anew, as they did not fit each other.
    pub(super) redrawn: u64,
    pub(super) simulated_s: f64,
    pub(super) drone_s: f64,
    /// How long cores were at it.
    pub(super) core_s: f64,
    pub(super) coverage: Coverage,
}

impl Tally {
    pub(super) fn add(&mut self, other: &Self) {
        self.plans += other.plans;
        self.broken.extend_from_slice(&other.broken);
        self.completed += other.completed;
        self.redrawn += other.redrawn;
        self.simulated_s += other.simulated_s;
        self.drone_s += other.drone_s;
        self.core_s += other.core_s;
        self.coverage.add(&other.coverage);
    }
}

/// A plan that broke a rule.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Broken {
    /// The seed that it was drawn from.
    pub seed: u64,
    /// The rule that it broke first.
    pub rule: u8,
    /// What happened.
    pub what: String,
}

/// What [`CHAOS_JSON`] holds: whose the folder is, and how far.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct State {
    program: String,
    content: String,
    /// The seed of its first plan.
    first: u64,
    tally: Tally,
}

impl State {
    fn new(search: &Search, tally: &Tally) -> Self {
        Self {
            program: crate::campaign::PROGRAM.to_owned(),
            content: search.content.clone(),
            first: search.seeds().at(0),
            tally: tally.clone(),
        }
    }
}

/// How far a search is in the folder `dir`, which is made if it is not there.
///
/// # Errors
/// When the folder is another search's, which is left as it is, or can't be made.
pub(super) fn begin(search: &Search, dir: &Path) -> Result<Tally, CampaignError> {
    make_folder(dir)?;
    let path = dir.join(CHAOS_JSON);
    if !path.exists() {
        return Ok(Tally::default());
    }
    let help = "name another folder with --out, or delete this one to begin anew";
    let state: State = serde_json::from_str(&read_text(&path)?)
        .map_err(|error| BadInput::without_excerpt(&path, error.to_string(), help))?;
    let own = State::new(search, &state.tally);
    let refuse = |difference: String| {
        let message = format!("is the folder of another search ({difference})");
        Err(BadInput::without_excerpt(dir, message, help).into())
    };
    if state.program != own.program {
        return refuse(format!("by {}, not {}", state.program, own.program));
    }
    if state.content != own.content {
        return refuse("the scenario or its mission said something else".to_owned());
    }
    if state.first != own.first {
        return refuse(format!("from seed {} on, not {}", state.first, own.first));
    }
    if state.tally.plans > search.seeds().number() {
        return refuse(format!("of {} plans already", state.tally.plans));
    }
    Ok(state.tally)
}

/// Writes down how far a search is, at once and whole.
pub(super) fn keep(search: &Search, dir: &Path, tally: &Tally) -> Result<(), CampaignError> {
    let state = json(&State::new(search, tally));
    Complete::new(dir, CHAOS_JSON, &state)?.publish()?;
    Ok(())
}
