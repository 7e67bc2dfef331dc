//! Flight plan of a swarm: formation, mission, protocol, vehicles and limits, read from a scenario file. The simulated world
//! (radio, faults, seeds) is not part of it.

mod agent;
mod avoid;
mod failsafe;
mod fence;
pub mod file;
mod follow;
mod formation;
pub mod layering;
mod limits;
mod load;
mod protocol;
#[doc(hidden)]
pub mod raw;
mod sensors;
pub mod separation;

use std::ops::Deref;
use std::sync::{Arc, LazyLock};
use std::time::Duration;

use muster_machines::formation::{Change, Exposure, Layout, Separation};
use muster_machines::geodetic::Geodetic;
use muster_machines::geometry::{Ned, Velocity};
use muster_machines::identity::{NodeId, SwarmId};
use muster_machines::mission::{Alone, Conduct, Following, Holds, Liveness, Succession};
use muster_machines::motion::Landing;
use muster_machines::msp::controller::{self, PlaceSensor, Receiver, Stage};
use muster_machines::msp::{AutopilotLink, ControllerLink, autopilot};
use muster_machines::node::{Blueprint, LinkBuilder};
use muster_machines::radio::{self, Budget, IdealAuthenticator, Incarnations};
use muster_machines::routing::{flood, tree};
use muster_machines::supervision::RestartLimits;
use muster_machines::{agent as machine_agent, mission, navigation, routing};

use crate::agents::PlannedAgent;
use crate::schema::{FieldList, FileSchema};
use crate::text::plural;
use crate::vehicle::{SimulatedLink, SimulatedVehicle, Vehicle, VehicleKind};

pub use self::fence::describe_fence;
pub use self::load::{build_plan, load_with, mission_file, to_usize};
pub use self::protocol::Protocol;
pub use self::sensors::{FlowSensor, PoseSensor};

/// What a scenario file may hold, the fields of its world included.
#[must_use]
pub fn schema() -> &'static FileSchema {
    static SCHEMA: LazyLock<FileSchema> =
        LazyLock::new(|| FileSchema::of::<raw::Raw>("A scenario of muster"));
    &SCHEMA
}

/// Every field of a scenario file, tables included, and what it accepts.
pub(crate) const FIELDS: FieldList = FieldList::new(include_str!("raw/fields.txt"));

/// The reference of scenario files as a page in Markdown.
#[must_use]
pub fn reference() -> String {
    raw::reference(&schema().fields)
}

/// Flight plan of a swarm. Its parts can be read as fields, but not set.
///
/// Invariant: a plan can be flown. Its parts were checked against each other when it was read.
#[derive(Debug, Clone)]
pub struct Plan(PlanParts);

impl Deref for Plan {
    type Target = PlanParts;

    fn deref(&self) -> &PlanParts {
        &self.0
    }
}

/// The parts of a flight plan.
#[derive(Debug, Clone)]
pub struct PlanParts {
    /// Slots, altitude layers and places on the ground.
    pub layout: Arc<Layout>,
    /// Positions of pure relays. Their ids follow those of the drones.
    pub relays: Arc<[Ned]>,
    /// Changes of formation, in order of the flight.
    pub changes: Arc<[Change]>,
    /// Origin of the swarm's local frame, from the mission file.
    pub home: Geodetic,
    /// Waypoints of the formation's centre; waypoint 0 is above home.
    pub waypoints: Arc<[Ned]>,
    /// How long the swarm holds at each waypoint after all drones have arrived.
    pub holds: Holds,
    /// Parameters of the protocol.
    pub protocol: Protocol,
    /// Parameters of the protocol "follow". `None` for a mission flown from waypoint to waypoint.
    pub follow: Option<Follow>,
    /// The agents that decide where the drones fly. `None` with other protocols.
    pub agent: Option<PlannedAgent>,
    /// Speeds, accelerations and failsafes of the vehicles.
    pub vehicle: navigation::Config,
    /// Parameters of the vehicles' landing mode.
    pub landing: Landing,
    /// The longest time to come to rest at the end of a leg. Each drone draws its own.
    pub settle: Duration,
    /// What the drones fly.
    pub vehicle_kind: VehicleKind,
    /// Who else commands the drones' flight controllers.
    pub receiver: Receiver,
    /// How long a full battery lasts with armed motors. `None`: it does not drain by itself.
    pub endurance: Option<Duration>,
    /// What measures where a vehicle with a flight controller is. `None`: GPS.
    pub pose: Option<PoseSensor>,
    /// What measures its velocity over ground. `None`: nothing.
    pub flow: Option<FlowSensor>,
    /// Gains of the flight by sticks.
    pub gains: controller::Gains,
    /// What a drone in the air does when it receives no other drone.
    pub alone: Alone,
    /// Limits of the flight.
    pub limits: Limits,
    /// Exposures that `limits.accept` lists.
    pub accepted: Vec<Exposure>,
    /// Description of the fence and of the closest approach to it. Empty without a fence.
    pub fence: Vec<String>,
    /// What the swarm does not do of what the mission file asks for.
    pub notes: Vec<String>,
}

impl Plan {
    /// Id of the first swarm in a world; others are numbered consecutively.
    pub const FIRST_SWARM: SwarmId = SwarmId(1);

    /// The agents, to fly with others in their place. `None` with other protocols.
    pub const fn agent_mut(&mut self) -> Option<&mut PlannedAgent> {
        self.0.agent.as_mut()
    }

    /// The same plan, flown by sticks with these gains.
    #[must_use]
    pub const fn with_gains(mut self, gains: controller::Gains) -> Self {
        self.0.gains = gains;
        self
    }

    /// The same plan, with this bound for a run.
    #[must_use]
    pub const fn with_duration(mut self, duration: Duration) -> Self {
        self.0.limits.duration = duration;
        self
    }

    /// Whether the flight needs a simulated pilot or operator.
    #[must_use]
    pub fn is_steered(&self) -> bool {
        let is_steered = |follow: &Follow| !follow.pilot.is_empty() || follow.land_after.is_some();
        self.follow.as_ref().is_some_and(is_steered)
    }

    /// Positions of the drones before take-off, then of the relays.
    pub fn start_positions(&self) -> impl Iterator<Item = Ned> {
        let home = self.waypoints[0].at_altitude(0.0);
        let drones = (0..self.layout.formation().drones()).map(NodeId);
        let start_positions = drones.map(move |id| self.layout.take_off_place(id, home));
        start_positions.chain(self.relays.iter().copied())
    }

    /// One line on the plan; `bound` is the time by which all drones are on the ground.
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

    /// Number of radios: drones and relays.
    #[must_use]
    pub fn nodes(&self) -> u32 {
        let relays = u32::try_from(self.relays.len()).expect("read as at most RELAYS_MAX");
        self.layout.formation().drones() + relays
    }

    fn routing(&self, id: NodeId) -> routing::Config {
        let drones = self.layout.formation().drones();
        let protocol = self.protocol;
        let landing_period = protocol.heartbeat * LANDING_HEARTBEATS;
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
                // With succession `land`, a member that is lost during the climb lands, too.
                monitors_before_routes: protocol.succession == Succession::Elect,
            }),
            Policy::Tree => routing::Config::Tree(tree::Config {
                id,
                drones,
                relays: self.nodes() - drones,
                heartbeat_period: protocol.heartbeat,
                landing_period: match self.vehicle.avoid {
                    // Drones that fly to land hear of each other's paths by these frames.
                    Some(_) => landing_period.min(protocol.keep_alive.max(protocol.heartbeat)),
                    None => landing_period,
                },
                repair: protocol.repair,
                repair_max: protocol.period,
                link_time_to_live: protocol.time_to_live,
                // Twice a link's, for routes break and re-form while drones spread out.
                time_to_live: protocol.time_to_live * 2,
                route_timeout: match protocol.succession {
                    // A neighbour that has heard more may be about to send.
                    Succession::Elect => protocol.heartbeat / 4,
                    Succession::Land => protocol.time_to_live * 3,
                },
            }),
        }
    }

    /// The simulated vehicle of a drone or relay, at its start position. `None` for an unknown id. Its settling times are
    /// drawn from `seed`.
    #[must_use]
    pub fn simulated_vehicle(&self, id: NodeId, seed: u64) -> Option<SimulatedVehicle> {
        let place = self.start_positions().nth(usize::try_from(id.0).ok()?)?;
        let vehicle = Vehicle::new(self.landing, place).with_endurance(self.endurance);
        Some(SimulatedVehicle::new(vehicle, self.settle, seed))
    }

    /// The drone that leads the swarm at the start: the one in the formation's centre.
    #[must_use]
    pub fn centre(&self) -> NodeId {
        self.layout.formation().centre()
    }

    /// Configuration of a drone's machines, with a simulated vehicle's link and a simulation's authenticator.
    pub fn blueprint(&self, swarm: SwarmId, id: NodeId) -> Blueprint {
        let protocol = self.protocol;
        let leads = id == self.centre();
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
                // In a simulation no journal is lost.
                incarnations: Incarnations::Counted,
            },
            authenticator: Arc::new(IdealAuthenticator),
            routing: self.routing(id),
            mission: self.mission(id),
            agent: self.agent_config(id),
            navigation: match &self.follow {
                Some(follow) if leads => follow.master.clone(),
                _ => self.vehicle.clone(),
            },
            // No plan has a map yet.
            indoor: None,
            link: self.link(self.vehicle_kind, Stage::Sim, self.receiver),
        }
    }
}

impl Plan {
    fn mission(&self, id: NodeId) -> mission::Config {
        let protocol = self.protocol;
        let leads = id == self.centre();
        mission::Config {
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
            conduct: self.conduct(),
            barrier: protocol.barrier,
            liveness: protocol.liveness,
            succession: protocol.succession,
            alone: self.alone,
            spreading_grace: protocol.spreading_grace(),
            candidacy_back_off: match (protocol.succession, protocol.liveness) {
                // As long as a frame with one retransmission takes to a neighbour.
                (Succession::Elect, Liveness::Heartbeat) => protocol.repair * 2,
                (Succession::Land, _) | (_, Liveness::Thesis) => Duration::ZERO,
            },
            set_up_limit: self.limits.set_up,
            take_off_limit: self.limits.take_off,
            landing_limit: self.limits.leg + self.limits.landing,
            climb_limit: self.limits.climb,
            leg_limit: self.limits.leg,
            flight_time: self.limits.flight_time,
            waypoints_max: self.limits.waypoints_max,
        }
    }

    /// What the swarm does once all drones are in their slots.
    fn conduct(&self) -> Conduct {
        match (&self.follow, &self.agent) {
            (Some(follow), _) => Conduct::Following(follow.following),
            (None, Some(_)) => Conduct::Task,
            (None, None) => Conduct::Waypoints,
        }
    }

    /// Builds the link to a vehicle. A flight controller's has a stage and a receiver.
    #[must_use]
    pub fn link(&self, kind: VehicleKind, stage: Stage, receiver: Receiver) -> Arc<LinkBuilder> {
        let config = controller::Config {
            stage,
            receiver,
            home: self.home,
            landing: self.landing,
            place: self.pose.map_or(PlaceSensor::Gps, |_| PlaceSensor::Pose),
            flow: self.flow.map(|it| it.module),
            noise: controller::Noise::GPS,
            gains: self.gains,
        };
        match kind {
            VehicleKind::ClosedForm => {
                Arc::new(|checkpoint, _| Box::new(SimulatedLink::new(checkpoint)))
            }
            VehicleKind::Msp => Arc::new(move |checkpoint, now| {
                Box::new(ControllerLink::new(config, checkpoint, now))
            }),
        }
    }

    /// Builds the link to an autopilot.
    #[must_use]
    pub fn autopilot_link(&self, stage: Stage) -> Arc<LinkBuilder> {
        let home = self.home;
        let config = autopilot::Config { stage, home };
        Arc::new(move |checkpoint, now| Box::new(AutopilotLink::new(config, checkpoint, now)))
    }

    /// Configuration of a drone's agent. `None` without agents, and for a pure relay.
    fn agent_config(&self, id: NodeId) -> Option<machine_agent::Config> {
        let drones = self.layout.formation().drones();
        let agent = self.agent.as_ref().filter(|_| id.0 < drones)?;
        Some(machine_agent::Config {
            id,
            drones,
            slot: self.layout.slot(id, self.waypoints[0]),
            waypoints: Arc::clone(&agent.waypoints),
            altitude_max_m: agent.altitude_max_m,
            telemetry: agent.telemetry,
            factory: agent.factory(id, drones),
            restarts: self.limits.restarts,
        })
    }
}

/// Frames of one sender that a radio accepts in each period. A drone that follows the protocol sends one.
const BUDGET_PER_PERIOD: u32 = 40;
/// Frames of one sender that a radio accepts at once.
const BUDGET_BURST: u32 = 64;
/// Policy `tree`: a drone that has been going to land for a while sends every n-th heartbeat, since no route depends on it.
const LANDING_HEARTBEATS: u32 = 4;

/// Parameters of the protocol "follow".
#[derive(Debug, Clone, PartialEq)]
pub struct Follow {
    /// What the master broadcasts of its motion, and how often.
    pub following: Following,
    /// The master's speed and acceleration, which are lower so that the others can keep up.
    pub master: navigation::Config,
    /// Stick inputs of the master's pilot, in order of time. Empty if the master flies the mission.
    pub pilot: Vec<Sticks>,
    /// When the operator ends the flight, counted from the start of following. `None`: it ends with the mission.
    pub land_after: Option<Duration>,
}

/// A pilot's stick input, which holds until the next one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sticks {
    /// Time of the input, counted from the start of following.
    pub after: Duration,
    /// Commanded velocity of the vehicle.
    pub velocity: Velocity,
}

/// How orders and acknowledgements spread.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Policy {
    /// By periodic repetition, as in the thesis.
    Flood,
    /// On change, along a tree, with retransmission on each hop.
    Tree,
}

/// Limits of a flight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Minimum separation of flying drones.
    pub separation: Separation,
    /// The longest run: by then every drone must be on the ground.
    pub duration: Duration,
    /// How long the master waits for members on the ground.
    pub set_up: Duration,
    /// The longest take-off.
    pub take_off: Duration,
    /// Expected time from take-off to the ground.
    pub flight: Duration,
    /// The longest climb out of lockstep, from a slot into the highest altitude layer.
    pub climb: Duration,
    /// The longest time for a leg.
    pub leg: Duration,
    /// The longest flight of a drone.
    pub flight_time: Duration,
    /// Duration of a descent from the highest altitude that is flown.
    pub landing: Duration,
    /// The most waypoints of a mission.
    pub waypoints_max: usize,
    /// The most messages that may wait for each actor.
    pub waiting_max: usize,
    /// How long an actor may hang before its supervisor counts it as failed.
    pub hang: Duration,
    /// Watchdog timeout: how long a process may hang before its service manager restarts it.
    pub watchdog: Duration,
    /// Link timeout: how long a flight controller waits for a silent process before it lands the aircraft.
    pub controller: Duration,
    /// Limits and back-off for restarts of failed actors.
    pub restarts: RestartLimits,
}

impl Limits {
    /// Default of `duration`: the longest wait on the ground and flight, two more legs (for drones that first fly to their
    /// slots, then to their landing places), and the descent; at most a week.
    #[must_use]
    pub fn default_duration(&self) -> Duration {
        let after = self.leg * 2 + self.landing;
        (self.set_up + self.flight_time + after).min(limits::DURATION_MAX)
    }
}
