//! What a swarm flies, and how: formation, mission, protocol, vehicles and limits, as a scenario file says them. The world
//! around it, its radio, faults and seeds, is the simulation's.

pub mod apart;
mod failsafe;
mod fence;
pub mod fields;
pub mod file;
mod follow;
mod formation;
mod limits;
mod load;
#[doc(hidden)]
pub mod raw;
pub mod room;

use std::sync::Arc;
use std::time::Duration;

use muster_machines::formation::{Change, Layout, Separation};
use muster_machines::geometry::{Ned, Velocity};
use muster_machines::identity::{NodeId, SwarmId};
use muster_machines::mission::{Alone, Barrier, Following, Holds, Liveness, Succession};
use muster_machines::node::Blueprint;
use muster_machines::radio::{self, Budget, IdealAuthenticator, Incarnations};
use muster_machines::routing::{flood, tree};
use muster_machines::supervision::RestartLimits;
use muster_machines::{mission, navigation, routing};

use serde_json::Value;

use crate::schema;
use crate::text::plural;
use crate::vehicle::{Landing, SimulatedLink, SimulatedVehicle, Vehicle};

pub use self::fence::fence_in_words;
pub use self::load::{load_from, mission_file, put_together, to_usize};

/// What a scenario file may say, its world's fields, too, as a JSON Schema.
#[must_use]
pub fn schema() -> Value {
    schema::of::<raw::Raw>("A scenario of muster's", fields::FIELDS)
}

/// What a swarm flies, and how; its fields fit each other.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Who flies where.
    pub layout: Arc<Layout>,
    /// Where pure relays are, whose ids follow those of the drones.
    pub relays: Arc<[Ned]>,
    /// The changes of formation on the way, in order.
    pub changes: Arc<[Change]>,
    /// The waypoints of the centre of the formation; 0 is over home.
    pub waypoints: Arc<[Ned]>,
    /// How long the swarm waits at them once all have arrived.
    pub holds: Holds,
    /// How the swarm talks.
    pub protocol: Protocol,
    /// How the master is followed, where it does not lead from waypoint to waypoint.
    pub follow: Option<Follow>,
    /// How the vehicles fly.
    pub vehicle: navigation::Config,
    /// How they come down.
    pub landing: Landing,
    /// How long they take at most to come to rest at the end of a leg; how long is drawn for each.
    pub settle: Duration,
    /// How long a full battery lasts with the motors armed; it does not drain by itself without.
    pub endurance: Option<Duration>,
    /// What a drone in the air does that hears of nobody else.
    pub alone: Alone,
    /// What must not be exceeded.
    pub limits: Limits,
    /// What its fence is, if it has one, and how near its flight comes to it, in words.
    pub fence: Vec<String>,
    /// What the mission file asks for and the swarm does not do, in words.
    pub notes: Vec<String>,
}

impl Plan {
    /// The first of the swarms of a world; others are numbered on.
    pub const FIRST_SWARM: SwarmId = SwarmId(1);

    /// Whether a simulated pilot steers its flight, or a simulated operator ends it.
    #[must_use]
    pub fn is_steered(&self) -> bool {
        let is_steered = |follow: &Follow| !follow.pilot.is_empty() || follow.land_after.is_some();
        self.follow.as_ref().is_some_and(is_steered)
    }

    /// Where its drones stand before they take off, and its relays are.
    pub fn stands(&self) -> impl Iterator<Item = Ned> {
        let home = self.waypoints[0].at_altitude(0.0);
        let drones = (0..self.layout.formation().drones()).map(NodeId);
        let stands = drones.map(move |id| self.layout.stand(id, home));
        stands.chain(self.relays.iter().copied())
    }

    /// What it is, in a few words, if all are down by then.
    #[must_use]
    pub fn description(&self, bound: Duration) -> String {
        let length_m = self
            .waypoints
            .windows(2)
            .map(|leg| leg[0].horizontal_distance_m(leg[1]))
            .fold(0.0, |length_m, leg_m| length_m + leg_m);
        let layer_m = limits::highest_layer_m(&self.layout, &self.changes, &self.waypoints);
        let layers = if layer_m > 0.0 {
            let rounded_m = (layer_m * 100.0).round() / 100.0;
            format!("layers up to {rounded_m} m above it")
        } else {
            "no two drones cross, so no altitude layers".to_owned()
        };
        let relays = match self.relays.len() {
            0 => String::new(),
            1 => ", and a relay".to_owned(),
            relays => format!(", and {relays} relays"),
        };
        format!(
            "{} drones, master {}{relays}; a mission of {} over {length_m:.0} m, {layers}; at most {:.0} s",
            self.layout.formation().drones(),
            self.layout.formation().centre(),
            plural(self.waypoints.len(), "waypoint"),
            bound.as_secs_f64(),
        )
    }

    /// How many radios there are: drones first, then relays.
    #[must_use]
    pub fn nodes(&self) -> u32 {
        let relays = u32::try_from(self.relays.len()).expect("read as at most RELAYS_MAX");
        self.layout.formation().drones() + relays
    }

    fn routing(&self, id: NodeId) -> routing::Config {
        let drones = self.layout.formation().drones();
        let protocol = self.protocol;
        match protocol.policy {
            Policy::Flood => routing::Config::Flood(flood::Config {
                id,
                drones,
                period: protocol.period,
                keep_alive: protocol.keep_alive,
                hello_period: protocol.hello_period,
                discovery: protocol.discovery,
                stable_after: protocol.stable_after,
                hello_gap: protocol.hello_gap,
                time_to_live: protocol.time_to_live,
                // Where the others land, a member that is missed on the way up lands too.
                misses_early: protocol.succession == Succession::Elect,
            }),
            Policy::Tree => routing::Config::Tree(tree::Config {
                id,
                drones,
                relays: self.nodes() - drones,
                beacon: protocol.beacon,
                repair: protocol.repair,
                repair_max: protocol.period,
                link_time_to_live: protocol.time_to_live,
                // Ways are lost and found again while drones spread out.
                time_to_live: protocol.time_to_live * 2,
                patience: match protocol.succession {
                    // A frame of somebody else's that has heard more may be on its way.
                    Succession::Elect => protocol.beacon / 4,
                    Succession::Land => protocol.time_to_live * 3,
                },
            }),
        }
    }

    /// The vehicle in closed form of one of its drones or relays, where it stands before it takes off; nothing for a
    /// number that none of them has. How long it settles at the end of a leg is drawn from `seed`.
    #[must_use]
    pub fn simulated_vehicle(&self, id: NodeId, seed: u64) -> Option<SimulatedVehicle> {
        let place = self.stands().nth(usize::try_from(id.0).ok()?)?;
        let vehicle = Vehicle::new(self.landing, place).lasting(self.endurance);
        Some(SimulatedVehicle::new(vehicle, self.settle, seed))
    }

    /// Who leads it when the operator tells it to fly.
    #[must_use]
    pub fn centre(&self) -> NodeId {
        self.layout.formation().centre()
    }

    /// What one of its drones is built with, as a member of that swarm; with the link of a vehicle in closed form and the
    /// authenticator of a simulation.
    pub fn blueprint(&self, swarm: SwarmId, id: NodeId) -> Blueprint {
        let protocol = self.protocol;
        let leads = id == self.layout.formation().centre();
        Blueprint {
            id,
            radio: radio::Config {
                id,
                swarm,
                budget: Budget {
                    interval: protocol.period / BUDGET_PER_PERIOD,
                    burst: BUDGET_BURST,
                },
                members: self.nodes(),
                // All begin at once, and no journal is ever lost.
                incarnations: Incarnations::Counted,
            },
            authenticator: Arc::new(IdealAuthenticator),
            routing: self.routing(id),
            mission: mission::Config {
                id,
                layout: Arc::clone(&self.layout),
                mission: if leads {
                    Arc::clone(&self.waypoints)
                } else {
                    Arc::default()
                },
                holds: if leads {
                    self.holds.clone()
                } else {
                    Holds::default()
                },
                changes: Arc::clone(&self.changes),
                following: self.follow.as_ref().map(|follow| follow.following),
                barrier: protocol.barrier,
                liveness: protocol.liveness,
                succession: protocol.succession,
                alone: self.alone,
                spreading_patience: match protocol.succession {
                    Succession::Elect => protocol.time_to_live * 3,
                    Succession::Land => protocol.time_to_live,
                },
                candidacy_back_off: match (protocol.succession, protocol.liveness) {
                    // As long as news takes to a neighbour.
                    (Succession::Elect, Liveness::Heartbeat) => protocol.repair * 2,
                    (Succession::Land, _) | (_, Liveness::Thesis) => Duration::ZERO,
                },
                set_up_limit: self.limits.set_up,
                take_off_limit: self.limits.take_off,
                landing_limit: self.limits.leg + self.limits.landing,
                leg_limit: self.limits.leg,
                flight_time: self.limits.flight_time,
                waypoints_max: self.limits.waypoints_max,
            },
            navigation: match &self.follow {
                Some(follow) if leads => follow.master.clone(),
                _ => self.vehicle.clone(),
            },
            link: Arc::new(|checkpoint| Box::new(SimulatedLink::new(checkpoint))),
        }
    }
}

/// How many frames of one sender a radio lets in each period: a drone that keeps to the protocol sends one.
const BUDGET_PER_PERIOD: u32 = 40;
/// How many of them may come at once.
const BUDGET_BURST: u32 = 64;

/// How the swarm talks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Protocol {
    /// How orders and acknowledgements spread.
    pub policy: Policy,
    /// For whom a master waits at a waypoint.
    pub barrier: Barrier,
    /// When a silent drone counts as lost.
    pub liveness: Liveness,
    /// What drones do whose master is silent.
    pub succession: Succession,
    /// How often a drone repeats what it knows.
    pub period: Duration,
    /// How often it does so once it is landing.
    pub keep_alive: Duration,
    /// How often a drone says hello during neighbour discovery.
    pub hello_period: Duration,
    /// How long neighbour discovery lasts.
    pub discovery: Duration,
    /// The longest pause between two hellos in a row.
    pub hello_gap: Duration,
    /// How many hellos in a row make a neighbour stable.
    pub stable_after: u32,
    /// How long a drone may be silent before it counts as lost.
    pub time_to_live: Duration,
    /// How often the master's number goes out, policy `tree`.
    pub beacon: Duration,
    /// How long a drone waits before it repeats what was not seen to arrive, policy `tree`.
    pub repair: Duration,
}

/// How a master is followed.
#[derive(Debug, Clone, PartialEq)]
pub struct Follow {
    /// What it tells the others, and how often.
    pub following: Following,
    /// How it flies, so that the others can keep up.
    pub master: navigation::Config,
    /// What its pilot does, if it is flown by hand.
    pub pilot: Vec<Sticks>,
    /// When the operator ends the flight, from when the following began; otherwise it ends with the mission.
    pub land_after: Option<Duration>,
}

/// Where a pilot's sticks are from some time on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sticks {
    /// From when the following began.
    pub after: Duration,
    /// How the vehicle is to move.
    pub velocity: Velocity,
}

/// How orders and acknowledgements spread.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Policy {
    /// By periodic repetition, as the thesis has it.
    Flood,
    /// On change, along a tree, repaired at each hop.
    Tree,
}

/// What must not be exceeded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// How far apart flying drones must be.
    pub separation: Separation,
    /// How long the run may last: by then every drone is on the ground.
    pub duration: Duration,
    /// How long the master waits for members on the ground.
    pub set_up: Duration,
    /// How long a take-off may take.
    pub take_off: Duration,
    /// How long all between take-off and the ground should take.
    pub flight: Duration,
    /// How long any leg may take.
    pub leg: Duration,
    /// How long a drone may fly.
    pub flight_time: Duration,
    /// How long a descent from the highest that is flown takes.
    pub landing: Duration,
    /// The most waypoints that a mission may have.
    pub waypoints_max: usize,
    /// The most messages that wait for one actor.
    pub waiting_max: usize,
    /// How long an actor may hang before its supervisor takes it for failed.
    pub hang: Duration,
    /// How long a process may hang before its service manager ends it and starts it again.
    pub watchdog: Duration,
    /// How long a flight controller waits for a process that hangs or has ended before it brings the aircraft down.
    pub controller: Duration,
    /// When failed actors are restarted and when that is given up.
    pub restarts: RestartLimits,
}

impl Limits {
    /// How long a run may last unless it is told: as long as drones may wait on the ground and fly, two legs more for
    /// whoever is to reach its slot first and the place where it lands then, and the descent; at most a week.
    #[must_use]
    pub fn default_duration(&self) -> Duration {
        let after = self.leg * 2 + self.landing;
        (self.set_up + self.flight_time + after).min(limits::DURATION_MAX)
    }
}
