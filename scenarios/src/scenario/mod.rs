//! What is simulated: a scenario, as parsed.

mod exposure;
mod fault;
mod faults;
mod load;
mod preview;
mod settling;
mod variation;
mod written;

use std::time::Duration;

use muster_machines::geometry::Ned;
use muster_runtime::plan::fields::FIELDS;
use muster_runtime::plan::{Plan, raw};
use muster_transport::sim;

pub use self::preview::holds_in_words;
pub use fault::{
    Distortion, DroneFault, Fault, FaultKind, Link, Links, Tampered, Target, Trigger, When,
};
pub use load::{load, load_from};
pub use muster_runtime::plan::file::Override;
pub use muster_runtime::plan::{fence_in_words, mission_file};
pub use settling::Settling;
pub use variation::Variation;
pub use written::side_by_side;
pub(crate) use written::written;

/// Every field of a scenario file, tables included, as in `radio.range_m`.
pub fn fields() -> impl Iterator<Item = &'static str> {
    FIELDS.iter().map(|(field, _)| *field)
}

/// A scenario whose fields fit each other.
#[derive(Debug, Clone)]
pub struct Scenario {
    /// What it is called: its file.
    pub name: String,
    /// Fields that were set in the place of what the file says, the seed apart.
    pub overrides: Vec<Override>,
    /// Where every random draw starts from.
    pub seed: u64,
    /// What is flown.
    pub plan: Plan,
    /// What the medium is like.
    pub radio: sim::Config,
    /// What goes wrong, and when.
    pub faults: Vec<Fault>,
    /// What a search for a fault plan that breaks a rule may choose.
    pub chaos: Chaos,
    /// Whether no rule is checked, to measure what flying alone costs: such a run proves nothing.
    pub unchecked: bool,
    /// Who else flies in the same air and over the same medium, and how each comes into it.
    pub others: Vec<(Self, Joins)>,
}

/// How a swarm comes into a world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Joins {
    /// Where its home is, from the home of the scenario's own swarm.
    pub home: Ned,
    /// When its master is told to fly.
    pub after: Duration,
}

impl Joins {
    /// As the scenario's own swarm does.
    const OWN: Self = Self {
        home: Ned::HOME,
        after: Duration::ZERO,
    };
}

impl Scenario {
    /// All swarms of its world, its own first.
    pub(crate) fn swarms(&self) -> impl Iterator<Item = (&Self, Joins)> {
        let others = self.others.iter().map(|(swarm, joins)| (swarm, *joins));
        std::iter::once((self, Joins::OWN)).chain(others)
    }

    /// Whether its world has other swarms.
    #[must_use]
    pub const fn has_other_swarms(&self) -> bool {
        !self.others.is_empty()
    }

    /// By when all are on the ground, from the start of the run: as its limits say, or the longest of those of all swarms.
    pub(crate) fn bound(&self) -> Duration {
        let own = self.plan.limits.duration;
        if own != self.plan.limits.default_duration() {
            return own;
        }
        let others = self
            .others
            .iter()
            .map(|(swarm, joins)| joins.after + swarm.bound());
        others.fold(own, Duration::max)
    }

    /// How many waypoints its drones reach, take-off and landing counted as one each.
    pub(crate) fn steps(&self) -> u64 {
        let stops = if self.plan.follow.is_some() {
            1
        } else {
            self.plan.waypoints.len()
        };
        let drones = u64::from(self.plan.layout.formation().drones());
        drones * (stops + self.plan.changes.len() + 1) as u64
    }

    /// How long it may take until each part of the swarm has its one master.
    #[must_use]
    pub fn settling(&self) -> Settling {
        let drone = self
            .plan
            .blueprint(Plan::FIRST_SWARM, self.plan.layout.formation().centre());
        Settling::new(&drone.routing, &drone.mission, &self.radio)
    }

    /// What it is, in a few words.
    #[must_use]
    pub fn description(&self) -> String {
        self.plan.description(self.bound())
    }
}

/// What a search for a fault plan that breaks a rule may choose.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Chaos {
    /// The most faults of a plan.
    pub faults_max: u32,
    /// Fields of which each plan takes one value.
    pub vary: Vec<Variation>,
}

impl From<&raw::Swarm> for Joins {
    fn from(swarm: &raw::Swarm) -> Self {
        Self {
            home: Ned::new(swarm.north_m.0, swarm.east_m.0, 0.0),
            after: (swarm.after_s.as_ref())
                .map_or(Duration::ZERO, |it| Duration::from_secs_f64(it.get_ref().0)),
        }
    }
}

impl From<raw::TriggerName> for Trigger {
    fn from(name: raw::TriggerName) -> Self {
        match name {
            raw::TriggerName::TakingOff => Self::TakingOff,
            raw::TriggerName::Elected => Self::Elected,
            raw::TriggerName::Settled => Self::Settled,
            raw::TriggerName::Landing => Self::Landing,
        }
    }
}
