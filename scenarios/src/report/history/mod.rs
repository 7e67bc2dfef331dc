//! What happened in a flight besides the motion of its drones: for the replay and the exports.

mod build;
mod labels;
mod marks;

use muster_machines::geodetic::Geodetic;
use muster_machines::geometry::Ned;
use muster_machines::time::Timestamp;

/// The history of a swarm.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct History {
    /// Drones and relays, by id.
    pub nodes: Vec<NodeHistory>,
    /// Leader epochs, in order of their beginning.
    pub epochs: Vec<Epoch>,
    /// Links between nodes that relay frames, as changes in order of time. `None` if they were not recorded.
    pub links: Option<Vec<LinkChange>>,
    /// Incident is worth a mark on a timeline, in order of time.
    pub marks: Vec<Mark>,
    /// Discs in which nothing was received.
    pub jams: Vec<Jam>,
    /// Origin of the world's local frame.
    pub home: Option<Geodetic>,
    /// Minimum separation of flying drones, horizontal and vertical, in metres. Rule 4 requires one of both.
    pub separation_m: (f64, f64),
}

/// The history of a drone or relay. Each list is in order of time, and an entry holds until the next one.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct NodeHistory {
    /// Its id.
    pub id: u32,
    /// Its routes to the master.
    pub routes: Vec<(Timestamp, Route)>,
    /// The leader epochs that it followed, as indices in [`History::epochs`]; `None` once it has left the swarm.
    pub epochs: Vec<(Timestamp, Option<usize>)>,
    /// Its conditions; it runs before the first one.
    pub conditions: Vec<(Timestamp, Condition)>,
    /// When its vehicle took off and landed.
    pub airborne: Option<(Timestamp, Option<Timestamp>)>,
}

/// A route to the master.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Route {
    /// Hops to the master; `None` without a route.
    pub hops: Option<u16>,
    /// The next hop.
    pub parent: Option<u32>,
    /// Whether the node relays orders.
    pub relay: bool,
}

/// A leader epoch: who leads, under which ballot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Epoch {
    /// Term of the ballot; 1 is the epoch that the operator starts.
    pub term: u32,
    /// Rank of the master in the order of succession.
    pub rank: u32,
    /// The master.
    pub master: u32,
    /// When the first node followed it.
    pub since: Timestamp,
}

/// The condition of a drone's computer and aircraft.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Condition {
    /// Its process runs.
    Runs,
    /// Its process hangs.
    Hangs,
    /// Its process has ended, and is to be started again.
    Stopped,
    /// Its computer is dead; the flight controller lands the aircraft.
    Dead,
    /// Its battery is empty.
    Empty,
    /// Its aircraft fell.
    Fell,
    /// An actor failed for good; it lands.
    Failed,
}

impl Condition {
    /// Its name in the replay and the exports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Runs => "runs",
            Self::Hangs => "hangs",
            Self::Stopped => "stopped",
            Self::Dead => "dead",
            Self::Empty => "battery empty",
            Self::Fell => "fell",
            Self::Failed => "failed",
        }
    }
}

/// A link that came, changed or went.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LinkChange {
    /// When it changed, in time of the simulation.
    pub at: Timestamp,
    /// The nodes; the lower id first.
    pub ends: (u32, u32),
    /// Its quality from then on.
    pub link: LinkState,
}

/// The quality of a link.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LinkState {
    /// It loses almost all frames, or a node does not relay.
    Down,
    /// It loses most frames.
    Weak,
    /// It loses at most 40 % of the frames each way.
    Up,
}

/// A mark on the timeline.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mark {
    /// When it begins.
    pub at: Timestamp,
    /// When it ends; `None` if it is momentary or lasts for good.
    pub until: Option<Timestamp>,
    /// Incident kind of mark.
    pub kind: MarkKind,
    /// The nodes involved, by id.
    pub nodes: Vec<u32>,
    /// One line about it.
    pub text: String,
}

/// The kind of a mark.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum MarkKind {
    /// A fault was injected.
    Fault,
    /// A drone died, fell, or its process stopped.
    Death,
    /// A drone's process started again.
    Return,
    /// An actor failed and was restarted.
    Restart,
    /// A drone's agent failed.
    AgentFailure,
    /// Some drones have no master, or connected ones follow different masters.
    Election,
    /// An elected drone leads.
    Leader,
    /// The network broke into more segments.
    Partition,
    /// Segments met.
    Merge,
    /// The last drone left a waypoint.
    Waypoint,
    /// A drone lands early.
    Landing,
    /// A rule was broken.
    Violation,
}

impl MarkKind {
    /// Its name in the replay and the exports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Fault => "fault",
            Self::Death => "death",
            Self::Return => "return",
            Self::Restart => "restart",
            Self::AgentFailure => "agent failure",
            Self::Election => "election",
            Self::Leader => "leader",
            Self::Partition => "partition",
            Self::Merge => "merge",
            Self::Waypoint => "waypoint",
            Self::Landing => "early landing",
            Self::Violation => "broken rule",
        }
    }
}

/// A disc in which nothing was received, at any height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jam {
    /// When it began.
    pub at: Timestamp,
    /// When it ended; `None` if it lasted.
    pub until: Option<Timestamp>,
    /// Centre.
    pub centre: Ned,
    /// Radius in metres.
    pub radius_m: f64,
}

impl NodeHistory {
    /// The entry of a list that holds at a time.
    pub fn at<T: Copy>(list: &[(Timestamp, T)], at: Timestamp) -> Option<T> {
        let next = list.partition_point(|&(since, _)| since <= at);
        let last = next.checked_sub(1)?;
        list.get(last).map(|&(_, value)| value)
    }

    /// The leader epoch that it follows at a time, as an index in [`History::epochs`].
    #[must_use]
    pub fn epoch_at(&self, at: Timestamp) -> Option<usize> {
        Self::at(&self.epochs, at).flatten()
    }

    /// Its condition at a time.
    #[must_use]
    pub fn condition_at(&self, at: Timestamp) -> Condition {
        Self::at(&self.conditions, at).unwrap_or(Condition::Runs)
    }

    /// Whether its vehicle is armed at a time.
    #[must_use]
    pub fn is_airborne(&self, at: Timestamp) -> bool {
        self.airborne
            .is_some_and(|(from, to)| from <= at && to.is_none_or(|to| at < to))
    }
}
