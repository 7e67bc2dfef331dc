//! What a file of evidence must show.

use muster_machines::mission::{Event, LandingReason, State};
use muster_machines::node::Observation;
use muster_runtime::identity::{ControllerFacts, EvidenceKind, GrantedStage};
use serde::Deserialize;
use thiserror::Error;

/// The fewest plans of a search.
pub const CHAOS_PLANS_MIN: u64 = 1_000;

/// Why a file is no evidence. The file is at fault, or what it tells of.
#[derive(Debug, PartialEq, Eq, Error)]
pub(super) enum Weakness {
    /// It is another file.
    #[error("this is no such file: {0}")]
    Unread(String),
    /// Too few plans.
    #[error("the search has run {0} plans; at least {CHAOS_PLANS_MIN} are needed")]
    FewPlans(u64),
    /// A rule was broken.
    #[error("a rule was broken: {0}")]
    RuleBroken(String),
    /// Nobody checked the rules.
    #[error("the flight was not checked against the rules")]
    Unchecked,
    /// The mission was not completed.
    #[error("the mission was not completed")]
    Incomplete,
    /// The drones had no flight controllers.
    #[error("the drones flew without flight controllers")]
    NoControllers,
    /// Another program was the flight controller.
    #[error("the flight used flight controllers of the kind \"{found}\"; accepted: {accepted}")]
    OtherControllers {
        /// The kind in the report.
        found: String,
        /// The kind that this evidence needs.
        accepted: &'static str,
    },
    /// The settings are not fit, or for no pilot.
    #[error("the flight controller was not fit for a pilot's receiver")]
    Unfit,
    /// Another flight controller.
    #[error(
        "the evidence is of the flight controller with the chip {found}; the one here has {expected}"
    )]
    OtherController { found: String, expected: String },
    /// Another drone.
    #[error("the evidence is of drone {0}")]
    OtherDrone(u32),
    /// The drone has not flown from take-off, over a place in the air, to landing in the stage `tethered`.
    #[error("there is no flight from take-off to landing in the stage \"tethered\"")]
    NoFlight,
    /// The drone landed for a reason of its own.
    #[error("the drone landed before the end: {0:?}")]
    Aborted(LandingReason),
}

#[derive(Deserialize)]
struct Search {
    tally: Tally,
}

#[derive(Deserialize)]
struct Tally {
    plans: u64,
    #[serde(default)]
    broken: Vec<BrokenPlan>,
}

#[derive(Deserialize)]
struct BrokenPlan {
    seed: u64,
    what: String,
}

#[derive(Deserialize)]
struct FlightReport {
    #[serde(default)]
    firmware: Option<String>,
    drones: Vec<FlownDrone>,
    mission_completed: bool,
    violations: Vec<Violation>,
    #[serde(default)]
    unchecked: bool,
}

#[derive(Deserialize)]
struct FlownDrone {
    #[serde(default)]
    port: Option<Port>,
}

#[derive(Deserialize)]
struct Port {
    rc_acknowledged: u64,
}

#[derive(Deserialize)]
struct Violation {
    what: String,
}

#[derive(Deserialize)]
struct BenchCheck {
    chip: Option<String>,
    receiver: String,
    fit: bool,
}

/// A line of a drone's log.
#[derive(Deserialize)]
struct LogLine {
    message: String,
    drone: Option<u32>,
    stage: Option<GrantedStage>,
    seen: Option<String>,
}

/// Checks a file's text.
pub(super) fn check(
    kind: EvidenceKind,
    text: &str,
    drone: u32,
    controller: &ControllerFacts,
) -> Result<(), Weakness> {
    match kind {
        EvidenceKind::Chaos => search(&parse(text)?),
        EvidenceKind::Simulated => flight(&parse(text)?, false),
        EvidenceKind::Betaflight => flight(&parse(text)?, true),
        EvidenceKind::Bench => bench(&parse(text)?, controller),
        EvidenceKind::Tether => tether(text, drone),
    }
}

fn parse<'a, T: Deserialize<'a>>(text: &'a str) -> Result<T, Weakness> {
    serde_json::from_str(text).map_err(|error| Weakness::Unread(error.to_string()))
}

fn search(Search { tally }: &Search) -> Result<(), Weakness> {
    if let Some(BrokenPlan { seed, what }) = tally.broken.first() {
        return Err(Weakness::RuleBroken(format!("seed {seed}: {what}")));
    }
    if tally.plans < CHAOS_PLANS_MIN {
        return Err(Weakness::FewPlans(tally.plans));
    }
    Ok(())
}

fn flight(report: &FlightReport, needs_betaflight: bool) -> Result<(), Weakness> {
    if let Some(violation) = report.violations.first() {
        return Err(Weakness::RuleBroken(violation.what.clone()));
    }
    if report.unchecked {
        return Err(Weakness::Unchecked);
    }
    if !report.mission_completed {
        return Err(Weakness::Incomplete);
    }
    let is_flown = |it: &FlownDrone| {
        it.port
            .as_ref()
            .is_some_and(|port| port.rc_acknowledged > 0)
    };
    if report.drones.is_empty() || !report.drones.iter().all(is_flown) {
        return Err(Weakness::NoControllers);
    }
    let other = |found: &str| Weakness::OtherControllers {
        found: found.to_owned(),
        accepted: if needs_betaflight {
            "Betaflight"
        } else {
            "simulated"
        },
    };
    match &report.firmware {
        Some(name) if !needs_betaflight => Err(other(name)),
        None if needs_betaflight => Err(other("simulated")),
        Some(name) if !name.to_lowercase().contains("betaflight") => Err(other(name)),
        _ => Ok(()),
    }
}

fn bench(check: &BenchCheck, controller: &ControllerFacts) -> Result<(), Weakness> {
    let found = check.chip.clone().unwrap_or_default();
    let expected = controller.chip.clone();
    if found != expected {
        return Err(Weakness::OtherController { found, expected });
    }
    if !check.fit || check.receiver != "override" {
        return Err(Weakness::Unfit);
    }
    Ok(())
}

/// The newest flight in the log of a drone's process.
fn tether(text: &str, id: u32) -> Result<(), Weakness> {
    let (mut is_tethered, mut is_over) = (false, false);
    // Told to take off; up there, too: a pilot may never have armed.
    let (mut is_ordered, mut has_flown) = (false, false);
    let mut reason = None;
    for line in text.lines().filter(|line| !line.trim().is_empty()) {
        let line: LogLine = parse(line)?;
        if let Some(other) = line.drone.filter(|drone| *drone != id) {
            return Err(Weakness::OtherDrone(other));
        }
        if let Some(stage) = line.stage {
            is_tethered = stage == GrantedStage::Tethered;
        }
        if line.message.starts_with("the stage falls to bench") {
            is_tethered = false;
        }
        let seen = line.seen.as_deref().map(parse).transpose()?;
        match seen {
            Some(Observation::Mission(Event::State(State::TakingOff))) => {
                (is_ordered, has_flown, is_over, reason) = (is_tethered, false, false, None);
            }
            Some(Observation::Mission(Event::Landing(why))) => reason = Some(why),
            Some(Observation::Mission(Event::State(State::Finished))) => is_over = has_flown,
            Some(Observation::Mission(Event::State(state))) if state.is_on_mission() => {
                has_flown = is_ordered;
            }
            _ => {}
        }
    }
    match reason {
        Some(LandingReason::MissionOver | LandingReason::Recalled) | None if is_over => Ok(()),
        Some(why) if why != LandingReason::MissionOver && is_ordered => Err(Weakness::Aborted(why)),
        _ => Err(Weakness::NoFlight),
    }
}
