//! What a file of evidence must show.

use muster_daemon::control::{GRANT_ALLOWS, STAGE_FALLS, STARTS};
use muster_machines::mission::{Event, LandingReason, State};
use muster_machines::node::Observation;
use muster_runtime::identity::{ControllerFacts, EvidenceKind, GrantedStage, hex};
use serde::Deserialize;
use thiserror::Error;

use super::{PromotionRequest, SearchFacts};

/// The fewest plans of a search.
pub const CHAOS_PLANS_MIN: u64 = 1_000;

/// Why a file is no evidence. The file is at fault, or what it tells of.
#[derive(Debug, PartialEq, Eq, Error)]
pub(super) enum Weakness {
    /// It is another file.
    #[error("this is no such file: {0}")]
    Unread(String),
    /// Another version ran it.
    #[error("the search was run by {found}; accepted: {accepted}")]
    OtherProgram {
        /// The version that ran it.
        found: String,
        /// This version.
        accepted: String,
    },
    /// It is of another scenario.
    #[error("the search is of another scenario than `chaos-controllers`, or of changed values")]
    OtherScenario,
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
        "the evidence is of the flight controller with the {what} {found}; the one here has {expected}"
    )]
    OtherController {
        /// What differs: chip, firmware or settings.
        what: &'static str,
        found: String,
        expected: String,
    },
    /// A log of a program that does not log the flight controller.
    #[error(
        "the log does not name the flight controller: its line \"{GRANT_ALLOWS}\" needs `chip`, `firmware` and `settings`"
    )]
    NoController,
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
    program: String,
    content: String,
    tally: Tally,
}

#[derive(Deserialize)]
struct Tally {
    plans: u64,
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
    /// The flight controller, where the stage is granted.
    chip: Option<String>,
    firmware: Option<String>,
    settings: Option<String>,
    seen: Option<String>,
}

/// Checks a file's text.
pub(super) fn check(
    kind: EvidenceKind,
    text: &str,
    request: &PromotionRequest,
) -> Result<(), Weakness> {
    let (drone, controller) = (request.drone.0, &request.controller);
    match kind {
        EvidenceKind::Chaos => search(&parse(text)?, &request.search),
        EvidenceKind::Simulated => flight(&parse(text)?, false),
        EvidenceKind::Betaflight => flight(&parse(text)?, true),
        EvidenceKind::Bench => bench(&parse(text)?, controller),
        EvidenceKind::Tether => tether(text, drone, controller),
    }
}

fn parse<'a, T: Deserialize<'a>>(text: &'a str) -> Result<T, Weakness> {
    serde_json::from_str(text).map_err(|error| Weakness::Unread(error.to_string()))
}

fn search(search: &Search, expected: &SearchFacts) -> Result<(), Weakness> {
    if search.program != expected.program {
        return Err(Weakness::OtherProgram {
            found: search.program.clone(),
            accepted: expected.program.clone(),
        });
    }
    if search.content != expected.content {
        return Err(Weakness::OtherScenario);
    }
    let tally = &search.tally;
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
    let found = check.chip.as_deref().unwrap_or_default();
    compare("chip", found, &controller.chip)?;
    if !check.fit || check.receiver != "override" {
        return Err(Weakness::Unfit);
    }
    Ok(())
}

fn compare(what: &'static str, found: &str, expected: &str) -> Result<(), Weakness> {
    if found == expected {
        return Ok(());
    }
    Err(Weakness::OtherController {
        what,
        found: found.to_owned(),
        expected: expected.to_owned(),
    })
}

/// Whether a line that grants a stage names this flight controller.
fn is_granted_for(line: &LogLine, controller: &ControllerFacts) -> Result<(), Weakness> {
    let (Some(chip), Some(firmware), Some(settings)) = (&line.chip, &line.firmware, &line.settings)
    else {
        return Err(Weakness::NoController);
    };
    compare("chip", chip, &controller.chip)?;
    compare("firmware", firmware, &controller.firmware)?;
    compare("settings", settings, &hex(&controller.settings))
}

/// What the log of a process tells of its newest flight.
#[derive(Default)]
struct Tethered {
    /// Whether the stage is granted now, for this flight controller.
    is_granted: bool,
    /// Whether the drone was told to take off in this stage.
    is_ordered: bool,
    /// Whether it came up to its place after that: a pilot may never have armed.
    has_flown: bool,
    is_over: bool,
    /// Why it landed.
    reason: Option<LandingReason>,
    /// Why a grant in the log says nothing about this flight controller.
    other: Option<Weakness>,
}

impl Tethered {
    fn read(&mut self, line: &LogLine, controller: &ControllerFacts) -> Result<(), Weakness> {
        if line.message == STARTS {
            *self = Self::default();
        }
        if let Some(stage) = line.stage {
            self.other = is_granted_for(line, controller).err();
            self.is_granted = stage == GrantedStage::Tethered && self.other.is_none();
        }
        if line.message.starts_with(STAGE_FALLS) {
            (self.is_granted, self.is_ordered, self.has_flown) = (false, false, false);
        }
        let seen = line.seen.as_deref().map(parse).transpose()?;
        match seen {
            Some(Observation::Mission(Event::State(State::TakingOff))) => {
                self.is_ordered = self.is_granted;
                (self.has_flown, self.is_over, self.reason) = (false, false, None);
            }
            Some(Observation::Mission(Event::Landing(why))) => self.reason = Some(why),
            Some(Observation::Mission(Event::State(State::Finished))) => {
                self.is_over = self.has_flown;
            }
            Some(Observation::Mission(Event::State(state))) if state.is_on_mission() => {
                self.has_flown = self.is_ordered;
            }
            _ => {}
        }
        Ok(())
    }

    fn judge(self) -> Result<(), Weakness> {
        if let Some(other) = self.other {
            return Err(other);
        }
        match self.reason {
            Some(LandingReason::MissionOver | LandingReason::Recalled) | None if self.is_over => {
                Ok(())
            }
            Some(why) if why != LandingReason::MissionOver && self.is_ordered => {
                Err(Weakness::Aborted(why))
            }
            _ => Err(Weakness::NoFlight),
        }
    }
}

/// The newest flight in the log of a drone's process, since the process has started last.
fn tether(text: &str, id: u32, controller: &ControllerFacts) -> Result<(), Weakness> {
    let mut flight = Tethered::default();
    for line in text.lines().filter(|line| !line.trim().is_empty()) {
        let line: LogLine = parse(line)?;
        if let Some(other) = line.drone.filter(|drone| *drone != id) {
            return Err(Weakness::OtherDrone(other));
        }
        flight.read(&line, controller)?;
    }
    flight.judge()
}
