//! The report of a run: its figures and its flight.

mod control;
mod figures;
mod flight;
mod following;
mod history;
mod stalls;
mod style;
mod summary;

use std::collections::BTreeMap;
use std::fmt;

pub use crate::checkers::RC_GAP_MAX;
pub use control::{ControlSeries, Extremes, Stretch};
pub use figures::{command, count, mean, program, quoted};
pub use history::{
    Condition, Epoch, History, Jam, LinkChange, LinkState, Mark, MarkKind, NodeHistory, Route,
};
pub use stalls::FirmwareStalls;
pub use style::{Colour, TABLE_STYLE};
pub use summary::unplanned;

use muster_machines::geometry::Ned;
use muster_machines::mission::State;
use muster_machines::time::Timestamp;
use serde::{Deserialize, Serialize};

pub(crate) use summary::{is_completed, summary};

/// The figures of a run, as printed by `--json` and written to `report.json`.
///
/// Times are simulated seconds from the start of the run. Lengths are in metres.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// Path of the scenario file.
    pub scenario: String,
    /// Random seed.
    pub seed: u64,
    /// Fields that override the file, each as `key=value`.
    pub overrides: Vec<String>,
    /// Simulation engine; `None` if the drones flew as processes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub engine: Option<Engine>,
    /// Command that repeats the run, quoted for a POSIX shell. A comment that says so if a program with agents of its own flew it.
    pub command: String,
    /// BLAKE3 of all observable events, in hexadecimal. `None` if the drones flew as processes: such runs don't repeat.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trace: Option<String>,
    /// Duration in simulated seconds; in real seconds if the drones flew as processes.
    pub simulated_s: f64,
    /// Wall-clock duration, in seconds.
    pub wall_s: f64,
    /// Largest error of the estimated clock offsets between hosts, in seconds. Times on two hosts compare to within twice
    /// this value. `None` if there was one clock.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clock_uncertainty_s: Option<f64>,
    /// File name of the program that was the drones' flight controllers. `None` if they were simulated, or there were none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub firmware: Option<String>,
    /// Times at which that program stood still while it was armed, all drones together. `None` without such a program.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub firmware_stalls: Option<FirmwareStalls>,
    /// Drones, by id.
    pub drones: Vec<DroneReport>,
    /// Pure relays, by id.
    pub relays: Vec<RelayReport>,
    /// Means over the drones.
    pub means: Means,
    /// Barriers: waypoints at which the swarm waited for its members.
    pub barriers: Vec<Barrier>,
    /// Changes of formation in flight.
    pub changes: Vec<FormationChange>,
    /// Formation error of the drones that followed the master; `None` if no drone followed.
    pub following: Option<FormationError>,
    /// Periods in which a network segment had no master, or more than one.
    pub elections: Vec<Election>,
    /// The drones out of their master's range and their bridges, by their last routes.
    pub bridges: Vec<Bridge>,
    /// Failures of agents, in order of time.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub agent_failures: Vec<AgentFailure>,
    /// Values that the drones' agents reported, in order of time: the first 100,000, and the last of each name of a drone.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub observed: Vec<ObservedValue>,
    /// Groups of drones that flew the mission and could never hear each other meanwhile, not even over others. Omitted if
    /// all of the swarm were in contact at some time.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub never_met: Vec<Vec<u32>>,
    /// Faults of the scenario that never happened, by their place in its file, from 1. Omitted if all happened, and if a broken
    /// rule ended the run.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub never_injected: Vec<usize>,
    /// Received frames that radios dropped, by reason.
    pub dropped: BTreeMap<String, u64>,
    /// Counters of the shared medium; `None` on an ideal medium.
    pub medium: Option<MediumCounters>,
    /// Closest approach of two flying drones, straight-line; `None` for fewer than two drones.
    pub min_separation_m: Option<f64>,
    /// Whether the remaining swarm reached the last waypoint and left it to land. `false` if the flight was interrupted, and if a
    /// drone that was not lost stayed on the ground.
    pub mission_completed: bool,
    /// Whether a signal ended the flight before the drones had landed. Omitted if false.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub interrupted: bool,
    /// Violated rules.
    pub violations: Vec<Violation>,
    /// Whether rule checks were off: the run measures cost only. Omitted if false.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub unchecked: bool,
    /// Reports of the scenario's other swarms in the same run. Their ids continue those of this swarm.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub others: Vec<Self>,
}

/// A failure of a drone's agent.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AgentFailure {
    /// Time, in simulated seconds.
    pub at_s: f64,
    /// The drone.
    pub drone: u32,
    /// What went wrong.
    pub what: String,
}

/// Longest cause of an agent's failure in a line, in characters.
const CAUSE_MAX: usize = 100;

impl AgentFailure {
    /// The last line of what went wrong, which names the cause in a traceback, too.
    #[must_use]
    pub fn cause(&self) -> String {
        cause(&self.what)
    }
}

/// As [`AgentFailure::cause`].
fn cause(what: &str) -> String {
    let last = what.lines().rfind(|line| !line.trim().is_empty());
    let last = last.unwrap_or_default();
    last.chars().take(CAUSE_MAX).collect()
}

/// A value that a drone's agent reported.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ObservedValue {
    /// Time, in simulated seconds.
    pub at_s: f64,
    /// The drone.
    pub drone: u32,
    /// Name of the value.
    pub name: String,
    /// The value.
    pub value: f64,
}

/// A period in which some flying drones could not reach a master, or connected drones followed different masters.
///
/// Before the first election it starts when the master is killed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Election {
    /// Start, in simulated seconds.
    pub at_s: f64,
    /// Seconds from the start until the first newly elected drone led; `None` if none was elected.
    pub led_after_s: Option<f64>,
    /// Seconds from the start until each segment had one master that all its drones followed; `None` if never.
    pub settled_after_s: Option<f64>,
    /// The masters at that time, one per segment.
    pub masters: Vec<u32>,
}

/// Totals of all radios on a shared medium over the whole run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct MediumCounters {
    /// Transmitted frames with a datagram, including retries.
    pub sent: u64,
    /// Transmitted acknowledgements.
    pub acknowledgements: u64,
    /// Frames retransmitted because no acknowledgement arrived.
    pub retries: u64,
    /// Unicast datagrams given up after the last retry.
    pub given_up: u64,
    /// Datagrams dropped because the send queue was full.
    pub dropped: u64,
    /// Receptions lost to a collision or because the receiver was transmitting.
    pub collided: u64,
    /// Receptions lost by `radio.loss`.
    pub lost: u64,
}

/// Simulation engine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Engine {
    /// The supervision tree of the real drone, in virtual time.
    Actors,
    /// The same state machines, driven directly from the event heap.
    Events,
}

impl fmt::Display for Engine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Actors => "actors",
            Self::Events => "events",
        })
    }
}

/// The figures of one drone.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DroneReport {
    /// Drone id.
    pub id: u32,
    /// Role at the end.
    pub role: Role,
    /// Hops to the master.
    pub hops: Option<u16>,
    /// Its parent: the next hop to the master.
    pub parent: Option<u32>,
    /// Whether it relayed orders.
    pub relay: bool,
    /// Whether it was out of the master's range.
    pub out_of_range: bool,
    /// Routing list, as the thesis defines it.
    pub routing_list: Vec<u32>,
    /// From the start of neighbour discovery to the end of landing; `None` if it did not get there.
    pub flight_time_s: Option<f64>,
    /// Frames sent during the flight time.
    pub messages_sent: u64,
    /// Frames accepted during the flight time.
    pub messages_received: u64,
    /// Whether both counts lack the frames since its last report, since its process was killed.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub messages_at_least: bool,
    /// Mean time from its arrival at a waypoint to its departure, or to a change of formation there. What it waits after
    /// the change counts as another.
    pub waypoint_delay_s: Option<f64>,
    /// Longest such time.
    pub waypoint_delay_max_s: Option<f64>,
    /// Formation error while it followed the master.
    pub following: Option<FormationError>,
    /// Mission state at the end.
    pub state: String,
    /// Whether it took off and landed. `false` if its aircraft fell.
    pub landed: bool,
    /// Number of waypoints reached, including waypoint 0 at the end of the take-off.
    pub waypoints: usize,
    /// Reason for an early landing; `None` if it landed at the mission's end.
    pub landed_because: Option<String>,
    /// Number of actor restarts.
    pub restarts: u32,
    /// Port of its flight controller; `None` without one, or if the drones flew as processes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub port: Option<PortReport>,
}

/// What the port of a drone's flight controller has counted.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PortReport {
    /// How often the port was opened.
    pub opened: u64,
    /// Frames read.
    pub frames: u64,
    /// Bad frames read.
    pub bad_frames: u64,
    /// Bytes read that belong to no frame.
    pub noise_bytes: u64,
    /// Questions without an answer.
    pub questions_lost: u64,
    /// RC frames written.
    pub rc_sent: u64,
    /// RC frames that the controller acknowledged.
    pub rc_acknowledged: u64,
    /// Longest time between two RC frames that were due, in seconds.
    pub rc_gap_max_s: f64,
}

/// The figures of a pure relay.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RelayReport {
    /// Node id; relays are numbered after the drones.
    pub id: u32,
    /// Metres north of home.
    pub north_m: f64,
    /// Metres east of home.
    pub east_m: f64,
    /// Metres above home.
    pub altitude_m: f64,
    /// Hops to the master on its last route.
    pub hops: Option<u16>,
    /// Its parent: the next hop to the master.
    pub parent: Option<u32>,
    /// Frames sent.
    pub messages_sent: u64,
    /// Frames accepted.
    pub messages_received: u64,
    /// As in [`DroneReport::messages_at_least`].
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub messages_at_least: bool,
    /// Number of actor restarts.
    pub restarts: u32,
}

/// Role of a drone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Leads the swarm.
    Master,
    /// Follows the master's orders.
    Member,
}

/// Means over the drones of a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Means {
    /// Mean flight time of the drones that have one.
    pub flight_time_s: Option<f64>,
    /// Mean number of accepted frames.
    pub messages_received: f64,
}

/// A barrier: a waypoint at which the swarm waited for its members.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Barrier {
    /// Waypoint number; 0 is the end of the take-off.
    pub waypoint: u16,
    /// Arrival of the last live member.
    pub arrived_s: f64,
    /// Departure of the last live member.
    pub moving_s: f64,
    /// For how long the mission held the swarm in between.
    pub hold_s: f64,
    /// Frames sent by all drones from the first arrival to the last departure, without keep-alives.
    pub transmissions: u64,
    /// Periodic keep-alives sent in the same time.
    pub keep_alives: u64,
    /// Unicast retries on the medium in the same time, of all swarms.
    pub retries: u64,
}

/// A change of formation in flight.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FormationChange {
    /// Waypoint at which it took place.
    pub waypoint: u16,
    /// The new formation.
    pub to: &'static str,
    /// Start of the first drone.
    pub begun_s: f64,
    /// Arrival of the last drone in its new slot; `None` if none arrived.
    pub done_s: Option<f64>,
    /// Number of drones that reached their new slots.
    pub drones: u32,
    /// Highest altitude layer used, in metres above the waypoint.
    pub sector_max_m: f64,
}

/// Formation error: straight-line distance of following drones from their slots around the master, in metres.
///
/// Sampled ten times a second, from the start of following to the order to assemble.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FormationError {
    /// Total following time of all drones, in simulated seconds.
    pub followed_s: f64,
    /// Mean error.
    pub mean_m: f64,
    /// 95th percentile.
    pub p95_m: f64,
    /// Largest error.
    pub max_m: f64,
}

/// A neighbour of a master that relays for drones out of the master's range.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Bridge {
    /// Id of the neighbour.
    pub bridge: u32,
    /// Drones reached through it, in ascending order.
    pub out_of_range: Vec<u32>,
}

/// A violated rule.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Violation {
    /// Rule number.
    pub rule: u8,
    /// Time of the violation.
    pub at_s: f64,
    /// Drones involved.
    pub drones: Vec<u32>,
    /// Description.
    pub what: String,
}

/// Tracks and states of a run, for the map and the timeline.
#[derive(Debug, Clone, PartialEq)]
pub struct Flight {
    /// Waypoints of the mission.
    pub waypoints: Vec<Ned>,
    /// Radio range without fading, in metres.
    pub range_m: f64,
    /// Drones, by id.
    pub drones: Vec<FlightOfDrone>,
    /// What happened besides the motion of the drones.
    pub history: History,
    /// The other swarms.
    pub others: Vec<Self>,
}

/// Track and states of one drone.
#[derive(Debug, Clone, PartialEq)]
pub struct FlightOfDrone {
    /// Positions in order of time, at most one second apart.
    pub track: Vec<(Timestamp, Ned)>,
    /// State changes with their times; the first is the state at the start of the run.
    pub states: Vec<(Timestamp, State)>,
    /// When it was killed or fell; `None` if neither, or if it runs again.
    pub died_at: Option<Timestamp>,
    /// How it was flown; `None` without a flight controller.
    pub control: Option<ControlSeries>,
}
