//! What is kept of a run: figures for a program, pictures and tables for a person.

pub(crate) mod figures;
mod flight;
mod following;
pub(crate) mod html;
#[cfg(test)]
pub(crate) mod sample;
mod summary;
pub(crate) mod table;
mod tracks;
mod write;

use std::collections::BTreeMap;
use std::fmt;

pub use figures::Kind;
pub use html::page;
pub use html::scaling::{Scaling, scaling};
pub use table::{Colour, STYLE as TABLE_STYLE, table};
pub use tracks::tracks;
pub use write::{REPORT_HTML, REPORT_JSON, TRACKS_CSV, WriteError, Written, write};

use muster_machines::geometry::Ned;
use muster_machines::mission::State;
use muster_machines::time::Timestamp;
use serde::{Deserialize, Serialize};

pub(crate) use figures::command;
pub(crate) use summary::{is_completed, summary};
pub(crate) use write::{Complete, Draft, json, make_folder};

/// The figures of a run: what `--json` prints and `report.json` holds.
///
/// All times are simulated seconds from the start of the run, all lengths metres.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// The scenario's file.
    pub scenario: String,
    /// The seed of every random draw.
    pub seed: u64,
    /// Fields that were set in the place of what the file says, each as `key=value`.
    pub overrides: Vec<String>,
    /// What ran the drones of a simulation; nothing where they flew as processes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub engine: Option<Engine>,
    /// The command that repeats the run, to be typed into a POSIX shell.
    pub command: String,
    /// BLAKE3 of everything observable, in hexadecimal; nothing where drones flew as processes, each time differently.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trace: Option<String>,
    /// How long the run lasted, in simulated seconds; in real ones where drones flew as processes.
    pub simulated_s: f64,
    /// How long it took.
    pub wall_s: f64,
    /// By how much the clocks of the machines that flew may have differed at most from what was reckoned with, in seconds:
    /// how far apart in time things on two of them happened is known to twice that. Nothing where there was one clock.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clock_uncertainty_s: Option<f64>,
    /// Each drone, in the order of their ids.
    pub drones: Vec<DroneReport>,
    /// Each pure relay, in the order of their ids.
    pub relays: Vec<RelayReport>,
    /// Means over the drones.
    pub means: Means,
    /// Each waypoint at which the swarm waited for its members.
    pub barriers: Vec<Barrier>,
    /// Each change of formation in flight.
    pub changes: Vec<FormationChange>,
    /// How well the others kept formation on a master that was followed; nothing where none was.
    pub following: Option<FormationError>,
    /// Each time that a part of the swarm had no master, or more than one.
    pub elections: Vec<Election>,
    /// The master's own view of who is out of its range and who bridges to them.
    pub bridges: Vec<Bridge>,
    /// Frames that radios did not let in, by reason.
    pub dropped: BTreeMap<String, u64>,
    /// What the radios did, on a medium that they share; nothing on an ideal one.
    pub medium: Option<MediumCounters>,
    /// The closest that two flying drones came, in a straight line; nothing for fewer than two.
    pub min_separation_m: Option<f64>,
    /// Whether the swarm, or what was left of it, reached the last waypoint and left it to land.
    pub mission_completed: bool,
    /// Rules that were broken.
    pub violations: Vec<Violation>,
    /// Whether no rule was checked: the run measures what flying costs and proves nothing. Not there otherwise.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub unchecked: bool,
    /// Every other swarm of the scenario: the same of it, of the same run. Drones and relays are numbered on.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub others: Vec<Self>,
}

/// A time in which some of the drones that flew the mission had no master that they could reach, or did not all obey
/// the same one; before the first election it begins when the master was killed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Election {
    /// When it began, in simulated seconds.
    pub at_s: f64,
    /// How long it took until the first drone led that was elected meanwhile; nothing if none was.
    pub led_after_s: Option<f64>,
    /// How long it took until each part had one master that all in it obeyed; nothing if that never came to be.
    pub settled_after_s: Option<f64>,
    /// Who led then, one for each part.
    pub masters: Vec<u32>,
}

/// What radios that share a medium did, all of them together, from the start of the run to its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct MediumCounters {
    /// Frames with a datagram that went on the air, those sent again included.
    pub sent: u64,
    /// Acknowledgements that did.
    pub acknowledgements: u64,
    /// Frames that were sent again for want of one.
    pub retries: u64,
    /// Datagrams for one drone that were given up after the last try.
    pub given_up: u64,
    /// Datagrams that found the queue full.
    pub dropped: u64,
    /// Frames that a radio heard and could not make out: others were in the air, or it was sending itself.
    pub collided: u64,
    /// Frames that a radio made out and that were lost on it, by `radio.loss`.
    pub lost: u64,
}

/// What runs the drones of a simulation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Engine {
    /// The supervision tree that flies, in virtual time.
    Actors,
    /// The same machines called from the event heap.
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
    /// Which drone.
    pub id: u32,
    /// Whether it led.
    pub role: Role,
    /// Hops to the master.
    pub hops: Option<u16>,
    /// The neighbour through which its acknowledgements went.
    pub parent: Option<u32>,
    /// Whether it repeated orders for others.
    pub relay: bool,
    /// Whether it did not hear the master itself.
    pub out_of_range: bool,
    /// The thesis's routing list.
    pub routing_list: Vec<u32>,
    /// From the start of its neighbour discovery to the end of its landing; nothing if it has not got there.
    pub flight_time_s: Option<f64>,
    /// Frames that it sent in that time.
    pub messages_sent: u64,
    /// Frames that it let in in that time.
    pub messages_received: u64,
    /// From its own arrival at a waypoint to its own departure, the mean over its waypoints.
    pub waypoint_delay_s: Option<f64>,
    /// The longest of them.
    pub waypoint_delay_max_s: Option<f64>,
    /// How well it kept formation on a master that it followed.
    pub following: Option<FormationError>,
    /// What it was doing at the end.
    pub state: String,
    /// How many waypoints it has reached, the one where the take-off ends included.
    pub waypoints: usize,
    /// Why it came down, if not because its mission was over.
    pub landed_because: Option<String>,
    /// How often an actor of it was restarted.
    pub restarts: u32,
}

/// The figures of a pure relay.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RelayReport {
    /// Which one; relays are numbered after the drones.
    pub id: u32,
    /// Where it is, in metres north of home.
    pub north_m: f64,
    /// In metres east of home.
    pub east_m: f64,
    /// In metres above home.
    pub altitude_m: f64,
    /// Hops to the master, by the last way that it had.
    pub hops: Option<u16>,
    /// The neighbour through which it passed acknowledgements on.
    pub parent: Option<u32>,
    /// Frames that it sent.
    pub messages_sent: u64,
    /// Frames that it let in.
    pub messages_received: u64,
    /// How often an actor of it was restarted.
    pub restarts: u32,
}

/// Whether a drone leads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// It leads.
    Master,
    /// It is led.
    Slave,
}

/// Means over the drones of a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Means {
    /// Of the flight times that there are.
    pub flight_time_s: Option<f64>,
    /// Of the frames let in.
    pub messages_received: f64,
}

/// A waypoint at which the swarm waited for its members.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Barrier {
    /// Which one; 0 is where the take-off ended.
    pub waypoint: u16,
    /// When the last live member had arrived.
    pub arrived_s: f64,
    /// When the last live member had begun to move on.
    pub moving_s: f64,
    /// Frames that were sent by anyone from the first member's arrival to the last one's departure, keep-alives apart.
    pub transmissions: u64,
    /// Frames that were sent meanwhile only because their time had come, and so were no part of it.
    pub keep_alives: u64,
    /// How often the medium sent a frame for one drone, of whichever swarm, again meanwhile, for want of an
    /// acknowledgement.
    pub retries: u64,
}

/// A change of formation in flight.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FormationChange {
    /// At which waypoint.
    pub waypoint: u16,
    /// The formation that it led to.
    pub to: &'static str,
    /// When the first drone began it.
    pub begun_s: f64,
    /// When the last drone was in its new slot; nothing if none got there.
    pub done_s: Option<f64>,
    /// How many drones got to their new slots.
    pub drones: u32,
    /// The highest altitude sector that was flown, in metres above the waypoint.
    pub sector_max_m: f64,
}

/// How far drones were from their slots around a master that they followed: straight distances in metres, ten a second
/// from when each began to follow until it was called to assemble.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FormationError {
    /// For how long that was, all drones together, in simulated seconds.
    pub followed_s: f64,
    /// The mean.
    pub mean_m: f64,
    /// 95 of 100 were at most this.
    pub p95_m: f64,
    /// The largest.
    pub max_m: f64,
}

/// A neighbour of the master that passes on the acknowledgements of drones out of the master's range.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Bridge {
    /// The neighbour.
    pub bridge: u32,
    /// The drones beyond, lowest first.
    pub out_of_range: Vec<u32>,
}

/// A rule that was broken.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Violation {
    /// The number of the rule among the invariants.
    pub rule: u8,
    /// When.
    pub at_s: f64,
    /// Who was in it.
    pub drones: Vec<u32>,
    /// What happened.
    pub what: String,
}

/// What is drawn of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Flight {
    /// The waypoints of the mission.
    pub waypoints: Vec<Ned>,
    /// How far a radio reaches, in metres; with fading, how far it would without.
    pub range_m: f64,
    /// Each drone, in the order of their ids.
    pub drones: Vec<FlightOfDrone>,
    /// Of every other swarm.
    pub others: Vec<Self>,
}

/// What is drawn of one drone.
#[derive(Debug, Clone, PartialEq)]
pub struct FlightOfDrone {
    /// Where it was, at rising instants a second apart or less.
    pub track: Vec<(Timestamp, Ned)>,
    /// What it began to do, and when; the first is its state at the start of the run.
    pub states: Vec<(Timestamp, State)>,
}
