//! The stored progress of a search.

use std::collections::BTreeSet;
use std::path::Path;

use muster_machines::formation::{Exposure, Layering};
use muster_machines::identity::NodeId;
use muster_runtime::diagnostic::{BadInput, read_text};
use muster_runtime::text::plural;
use muster_scenarios::engine::Outcome;
use muster_scenarios::report::Violation;
use muster_scenarios::scenario::Scenario;
use serde::{Deserialize, Serialize};

use super::coverage::Coverage;
use super::search::Search;
use crate::campaign::{CAMPAIGN_JSON, CampaignError};
use crate::output::{CompleteFile, create_folder, json};

/// File with the progress of a search.
pub const CHAOS_JSON: &str = "chaos.json";

/// Results so far.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Tally {
    /// Plans run from the first seed.
    pub(super) plans: u64,
    /// Plans of them that broke a rule.
    #[serde(default)]
    pub(super) broken: Vec<BrokenPlan>,
    /// Plans of them in which drones came too close in an accepted exposure.
    #[serde(default)]
    pub(super) accepted: Vec<AcceptedPlan>,
    /// Plans of them in which the remaining drones completed the mission.
    pub(super) completed: u64,
    /// Number of redraws because values were incompatible.
    pub(super) redrawn: u64,
    pub(super) simulated_s: f64,
    pub(super) drone_s: f64,
    /// Processor time, in core-seconds.
    pub(super) core_s: f64,
    pub(super) coverage: Coverage,
}

impl Tally {
    pub(super) fn add(&mut self, other: &Self) {
        self.plans += other.plans;
        self.broken.extend_from_slice(&other.broken);
        self.accepted.extend_from_slice(&other.accepted);
        self.completed += other.completed;
        self.redrawn += other.redrawn;
        self.simulated_s += other.simulated_s;
        self.drone_s += other.drone_s;
        self.core_s += other.core_s;
        self.coverage.add(&other.coverage);
    }

    /// Adds a plan in which two drones came too close in accepted exposures.
    pub(super) fn accept(&mut self, seed: u64, exposures: &BTreeSet<Exposure>, what: String) {
        let exposures = exposures.iter().map(|it| it.name().to_owned()).collect();
        self.accepted.push(AcceptedPlan {
            seed,
            exposures,
            what,
        });
    }
}

/// The exposures listed in `limits.accept` of two drones that came too close, if that is the violation. Those in which one comes
/// down count only if one does, `both-apart` only if both have left lockstep, and `apart` only if one has and, with a layer for each, the
/// other has not. Drones that follow their master count as both.
pub(super) fn accepted_exposures(
    scenario: &Scenario,
    outcome: &Outcome,
    violation: &Violation,
) -> BTreeSet<Exposure> {
    let [one, other] = violation.drones[..] else {
        return BTreeSet::new();
    };
    if violation.rule != 4 {
        return BTreeSet::new();
    }
    let drones = [one, other].map(NodeId);
    let mut exposures = scenario.accepted_exposures(drones);
    let comes_down = drones.iter().any(|it| outcome.came_down(*it));
    let follows = scenario.plan.follow.is_some();
    let left = drones.map(|it| follows || outcome.left_lockstep(it));
    // Drones that share layers change formation in lockstep even so.
    let may_be_in_lockstep = follows || scenario.plan.layout.layering() == Layering::Shared;
    exposures.retain(|it| match it {
        Exposure::Late => true,
        Exposure::Apart => left.contains(&true) && (left.contains(&false) || may_be_in_lockstep),
        Exposure::BothApart => left == [true; 2],
        Exposure::Descends | Exposure::Killed => comes_down,
    });
    exposures
}

/// A plan that broke a rule.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BrokenPlan {
    /// Seed of the plan.
    pub seed: u64,
    /// First broken rule.
    pub rule: u8,
    /// Description of the violation.
    pub what: String,
}

/// A plan in which two drones came too close in an exposure that `limits.accept` lists.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AcceptedPlan {
    /// Seed of the plan.
    pub seed: u64,
    /// Names of the exposures.
    pub exposures: Vec<String>,
    /// Description of what would violate rule 4 without it.
    pub what: String,
}

/// Content of [`CHAOS_JSON`]: identity of the search, and its progress.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct State {
    program: String,
    content: String,
    /// Seed of the first plan.
    first: u64,
    tally: Tally,
}

impl State {
    fn new(search: &Search, tally: &Tally) -> Self {
        let (program, content) = search.identity();
        Self {
            program: program.to_owned(),
            content: content.to_owned(),
            first: search.seeds().at(0),
            tally: tally.clone(),
        }
    }
}

impl Search {
    /// Whether a folder holds an earlier part of this search, so that it resumes there.
    #[must_use]
    pub fn is_in(&self, dir: &Path) -> bool {
        dir.join(CHAOS_JSON).exists() && read(self, dir).is_ok()
    }
}

/// Loads the progress of a search from the folder `dir`, which is created if needed.
///
/// # Errors
/// If the folder belongs to another search or to a campaign (it stays unchanged) or can't be created.
pub(super) fn load(search: &Search, dir: &Path) -> Result<Tally, CampaignError> {
    let tally = read(search, dir)?;
    create_folder(dir)?;
    Ok(tally)
}

/// As [`load`], without creating the folder.
fn read(search: &Search, dir: &Path) -> Result<Tally, CampaignError> {
    let path = dir.join(CHAOS_JSON);
    if !path.exists() {
        if dir.join(CAMPAIGN_JSON).exists() {
            let message =
                format!("holds a campaign of `muster campaign` ({CAMPAIGN_JSON}), no search");
            let help = "name another folder with --out";
            return Err(BadInput::without_excerpt(dir, message, help).into());
        }
        return Ok(Tally::default());
    }
    let help = "name another folder with --out, or delete this one to start again";
    let state: State = serde_json::from_str(&read_text(&path)?)
        .map_err(|error| BadInput::without_excerpt(&path, error.to_string(), help))?;
    let own = State::new(search, &state.tally);
    let refuse = |difference: String| {
        let message = format!("belongs to another search ({difference})");
        Err(BadInput::without_excerpt(dir, message, help).into())
    };
    if state.program != own.program {
        return refuse(format!("program: {}, not {}", state.program, own.program));
    }
    if state.content != own.content {
        return refuse("the scenario or its mission changed".to_owned());
    }
    if state.first != own.first {
        return refuse(format!("first seed: {}, not {}", state.first, own.first));
    }
    if state.tally.plans > search.seeds().number() {
        let plans = usize::try_from(state.tally.plans).unwrap_or(usize::MAX);
        return refuse(format!("it has {} already", plural(plans, "plan")));
    }
    Ok(state.tally)
}

/// Stores the progress of a search atomically.
pub(super) fn store(search: &Search, dir: &Path, tally: &Tally) -> Result<(), CampaignError> {
    let state = json(&State::new(search, tally));
    CompleteFile::new(dir, CHAOS_JSON, &state)?.publish()?;
    Ok(())
}
