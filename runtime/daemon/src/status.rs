//! What a drone's process tells of itself to whoever asks.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// How long after it was last heard a drone counts as a neighbour, in seconds: a few beacons of the slowest parameters.
const NEIGHBOUR_S: f64 = 3.0;

/// What a drone's process tells of itself. Counts are since its start.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Status {
    /// The drone's number.
    pub drone: u32,
    /// Its swarm's.
    pub swarm: u32,
    /// The version of its program.
    pub version: String,
    /// Which life of its journal this is, from 1.
    pub incarnation: u32,
    /// For how long its process has run, in seconds.
    pub up_s: f64,
    /// What keeps it from its work, in words; nothing if it is well.
    pub faults: Vec<String>,
    /// What it is doing.
    pub state: Doing,
    /// What it is in its swarm.
    pub role: Role,
    /// Whom it obeys, if anybody.
    pub ballot: Option<LeaderEpoch>,
    /// How many hops it is from its master; 0 for the master itself.
    pub hops: Option<u16>,
    /// The neighbour through which its acknowledgements go.
    pub parent: Option<u32>,
    /// Whom it has heard, by number.
    pub heard: BTreeMap<u32, Heard>,
    /// How its vehicle is.
    pub vehicle: VehicleStatus,
    /// Its five actors, by name.
    pub actors: BTreeMap<String, ActorStatus>,
    /// What it sent and let in.
    pub frames: Frames,
    /// What its transport did.
    pub datagrams: Datagrams,
    /// Messages, no frames among them, for which an actor had no room or was not there.
    pub messages_refused: u64,
    /// Records that could not be written to the journal.
    pub journal_unwritten: u64,
    /// Lines of the log that nobody read in time.
    pub log_lines_lost: u64,
}

/// What a drone is doing.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Doing {
    /// One of a few names, as in `moving_to_waypoint`.
    pub name: String,
    /// In words, as in "moving to waypoint 2".
    pub words: String,
    /// The waypoint that it is at or makes for.
    pub waypoint: Option<u16>,
}

/// What a drone is in its swarm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// It obeys nobody yet.
    None,
    /// It leads.
    Master,
    /// It obeys another.
    Member,
    /// It only passes on.
    Relay,
}

impl Role {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::None, Self::Master, Self::Member, Self::Relay];

    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Master => "master",
            Self::Member => "member",
            Self::Relay => "relay",
        }
    }
}

/// A ballot: whose leader epoch, by which right.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct LeaderEpoch {
    /// Rises with each election.
    pub term: u32,
    /// The master's place in the order of succession.
    pub rank: u32,
    /// The master's number.
    pub master: u32,
}

/// A drone that was heard.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Heard {
    /// How many of its frames were let in.
    pub frames: u64,
    /// How long ago the last one was, in seconds.
    pub silent_s: f64,
}

/// How a vehicle is, in metres from the mission's home.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct VehicleStatus {
    /// How far north.
    pub north_m: f64,
    /// How far east.
    pub east_m: f64,
    /// How far above.
    pub altitude_m: f64,
    /// For how long it has not known where it is over ground, in seconds; nothing while it knows.
    pub position_lost_s: Option<f64>,
    /// What is left in its battery, as a share of a full one.
    pub charge: f64,
    /// Whether its motors are armed.
    pub armed: bool,
}

/// How an actor is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct ActorStatus {
    /// Whether it runs.
    pub up: bool,
    /// How many messages wait for it.
    pub waiting: u32,
    /// How many may.
    pub waiting_max: u32,
    /// How often it has failed.
    pub failures: u64,
    /// How often it was started again.
    pub restarts: u64,
    /// How often it handled a timeout and had a deadline that was not after it, which is a defect.
    pub overdue: u64,
}

/// Frames, as the radio sees them.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Frames {
    /// Sent, by what they carry.
    pub sent: BTreeMap<String, Sent>,
    /// Let in, by what they carry.
    pub let_in: BTreeMap<String, u64>,
    /// Not let in, by reason.
    pub dropped: BTreeMap<String, u64>,
    /// Let in and of no use to the routing: no packet of a member, or of an older leader epoch.
    pub ignored: u64,
    /// Orders that the mission could not read, or not obey in its state.
    pub orders_refused: u64,
}

/// Frames that were sent, by cause.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Sent {
    /// Because something had changed or was missed.
    pub news: u64,
    /// Only because the time had come.
    pub keep_alives: u64,
}

/// Datagrams, as the transport sees them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Datagrams {
    /// Handed to the system; one for each peer.
    pub sent: u64,
    /// That the system did not take.
    pub unsent: u64,
    /// Taken in.
    pub received: u64,
    /// Dropped unread because they were too long.
    pub too_long: u64,
    /// Dropped by the system because its buffers were full; nothing where it does not tell.
    pub overflowed: Option<u64>,
}

impl Status {
    /// Whom it has heard within the last few seconds.
    pub fn neighbours(&self) -> impl Iterator<Item = u32> {
        let near = self
            .heard
            .iter()
            .filter(|(_, it)| it.silent_s < NEIGHBOUR_S);
        near.map(|(id, _)| *id)
    }

    /// How many frames were not let in, for whatever reason.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        let too_many = self.datagrams.overflowed.unwrap_or_default();
        self.frames.dropped.values().sum::<u64>() + self.datagrams.too_long + too_many
    }

    /// How often its actors were started again.
    #[must_use]
    pub fn restarts(&self) -> u64 {
        self.actors.values().map(|actor| actor.restarts).sum()
    }
}
