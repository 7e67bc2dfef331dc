//! A parsed scenario: what is simulated.

mod exposure;
mod fault;
mod faults;
mod load;
mod notes;
mod preview;
mod settling;
mod shipped;
mod variation;
mod verdict;
mod written;

use std::time::Duration;

use muster_machines::geometry::Ned;
use muster_runtime::plan::{Plan, raw};
use muster_transport::sim;

pub use self::preview::describe_holds;
pub use fault::{
    ControllerFault, Distortion, DroneFault, Fault, FaultKind, LinkFault, Links, Tampered, Target,
    Trigger, When,
};
pub use load::{load, load_for, load_from};
pub use muster_runtime::plan::file::Override;
pub use muster_runtime::plan::{describe_fence, mission_file};
pub use settling::Settling;
pub use shipped::{
    Shipped, is_shipped, mission_path, read, scenario_file, scenario_or_mission, shipped,
};
pub use variation::Variation;

use crate::controllers::Aircraft;
pub use written::{side_by_side, written};

/// A scenario; its fields fit each other.
#[derive(Debug, Clone)]
pub struct Scenario {
    /// Path of its file, or the name of a shipped one.
    pub name: String,
    /// Overrides of fields, without the seed.
    pub overrides: Vec<Override>,
    /// Random seed of the run.
    pub seed: u64,
    /// Whether the seed decides the places of a formation, too.
    pub(crate) draws_places: bool,
    /// What the swarm flies.
    pub plan: Plan,
    /// The radio model.
    pub radio: sim::Config,
    /// The aircraft of simulated flight controllers.
    pub aircraft: Aircraft,
    /// The fault plan.
    pub faults: Vec<Fault>,
    /// What `muster chaos` may choose.
    pub chaos: Chaos,
    /// Whether no rule is checked, to measure the cost of flying alone. Such a run proves nothing.
    pub unchecked: bool,
    /// Other swarms in the same airspace and on the same medium.
    pub others: Vec<(Self, Joins)>,
}

/// Where and when another swarm starts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Joins {
    /// Its home, relative to the home of the scenario's own swarm.
    pub home: Ned,
    /// When its operator starts the flight.
    pub after: Duration,
}

impl Joins {
    /// Those of the scenario's own swarm.
    const OWN: Self = Self {
        home: Ned::HOME,
        after: Duration::ZERO,
    };
}

impl Scenario {
    /// The same scenario with another random seed. Where the seed decides places, `load` reads it anew, with all overrides.
    ///
    /// # Errors
    /// Those of `load`.
    pub fn with_seed_from<E>(
        &self,
        seed: u64,
        load: impl FnOnce(&[Override]) -> Result<Self, E>,
    ) -> Result<Self, E> {
        // A file's numbers have 63 bits.
        let fits = i64::try_from(seed).is_ok();
        if seed == self.seed || (fits && !self.draws_places) {
            return Ok(Self {
                seed,
                ..self.clone()
            });
        }
        let mut overrides = self.overrides.clone();
        overrides.push(Override::seed(&seed.to_string()));
        load(&overrides)
    }

    /// All swarms of the world, its own first.
    pub(crate) fn swarms(&self) -> impl Iterator<Item = (&Self, Joins)> {
        let others = self.others.iter().map(|(swarm, joins)| (swarm, *joins));
        std::iter::once((self, Joins::OWN)).chain(others)
    }

    /// Whether the world has other swarms.
    #[must_use]
    pub const fn has_other_swarms(&self) -> bool {
        !self.others.is_empty()
    }

    /// Time by which all drones are on the ground, from the start of the run: its own limit if the file has one, otherwise the
    /// latest of all swarms.
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

    /// Number of steps of all drones: waypoints, changes of formation and landing.
    pub(crate) fn steps(&self) -> u64 {
        let stops = if self.plan.follow.is_some() {
            1
        } else {
            self.plan.waypoints.len()
        };
        let drones = u64::from(self.plan.layout.formation().drones());
        drones * (stops + self.plan.changes.len() + 1) as u64
    }

    /// Times until each segment of the swarm has one master.
    #[must_use]
    pub fn settling(&self) -> Settling {
        let drone = self
            .plan
            .blueprint(Plan::FIRST_SWARM, self.plan.layout.formation().centre());
        Settling::new(&drone.routing, &drone.mission, &self.radio)
    }

    /// One line about it.
    #[must_use]
    pub fn description(&self) -> String {
        self.plan.description(self.bound())
    }
}

/// What `muster chaos` may choose.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Chaos {
    /// Most faults of a plan.
    pub faults_max: u32,
    /// Fields that vary; each plan takes one value of each.
    pub vary: Vec<Variation>,
}

impl From<&raw::Swarm> for Joins {
    fn from(swarm: &raw::Swarm) -> Self {
        Self {
            home: Ned::new(swarm.north_m.0, swarm.east_m.0, 0.0),
            after: Duration::from_secs_f64(swarm.after_s.0),
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
