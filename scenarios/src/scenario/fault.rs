//! What goes wrong in a scenario: a fault plan.

use std::sync::Arc;
use std::time::Duration;

use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;
use muster_machines::node::Address;
use muster_machines::time::Timestamp;

/// Something that goes wrong, once or several times.
#[derive(Debug, Clone, PartialEq)]
pub struct Fault {
    /// When, for the first time.
    pub when: When,
    /// What.
    pub kind: FaultKind,
    /// After how long it is over, where it lasts; for good otherwise.
    pub lasts: Option<Duration>,
    /// How often it happens.
    pub times: u32,
    /// From one time to the next.
    pub every: Duration,
}

impl Fault {
    /// A fault that happens once, at a time of the run, and for good.
    #[must_use]
    pub const fn at(at: Timestamp, kind: FaultKind) -> Self {
        Self {
            when: When::At(at),
            kind,
            lasts: None,
            times: 1,
            every: Duration::ZERO,
        }
    }
}

/// When a fault happens.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum When {
    /// At this time of the run.
    At(Timestamp),
    /// So long after something has happened for the first time.
    After(Trigger, Duration),
}

/// What a fault may wait for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trigger {
    /// A vehicle is armed.
    TakingOff,
    /// A drone has reached this waypoint.
    Waypoint(u16),
    /// A drone leads that was elected.
    Elected,
    /// After an election each part of the swarm has one master again.
    Settled,
    /// A drone begins to come down: it makes for its landing place, or descends.
    Landing,
}

/// Whom a fault befalls.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Target {
    /// This one.
    Drone(NodeId),
    /// Whoever leads by then; of several the one with the best ballot.
    Master,
}

/// What can go wrong.
#[derive(Debug, Clone, PartialEq)]
pub enum FaultKind {
    /// Something befalls a drone.
    Drone(Target, DroneFault),
    /// Links between drones are not what they were.
    Links(Links, Link),
    /// Nothing is received within a disc, however high.
    Jam {
        /// Its centre; the height does not matter.
        centre: Ned,
        /// In metres.
        radius_m: f64,
    },
    /// Frames are not what they were on their way.
    Tamper(Tampered),
}

/// What can befall a drone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DroneFault {
    /// One of its actors panics.
    CrashActor(Address),
    /// Its companion computer dies: its aircraft comes down by its controller's failsafe.
    Kill,
    /// Its aircraft falls out of the sky.
    CrashAircraft,
    /// Its process ends, and is started again; the vehicle goes on with what it was told last.
    Restart,
    /// One of its actors, or its whole process, does nothing any more, while what comes for it waits.
    Hang(Option<Address>),
    /// All but this share of a full battery is gone at once.
    Drain(f64),
    /// Its vehicle does not know where it is over ground.
    LoseGps,
    /// What it has sent so far is sent again, by whoever listened.
    Replay,
    /// Somebody speaks in its name, and in that of strangers.
    Forge,
    /// Its clock gains this many millionths from now on.
    Skew(i32),
}

/// Whose frames are tampered with, how many of them, and how.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tampered {
    /// Whose; everybody's otherwise.
    pub from: Option<NodeId>,
    /// The share of them, receiver by receiver, 0 to 1.
    pub share: f64,
    /// How.
    pub how: Distortion,
}

/// What is done to a frame on its way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Distortion {
    /// It is altered.
    Corrupt,
    /// It arrives twice.
    Duplicate,
    /// It arrives so much later.
    Delay(Duration),
    /// It arrives later by up to this much, so that others overtake it.
    Reorder(Duration),
}

impl FaultKind {
    /// Whether it can be over after a while.
    #[must_use]
    pub const fn can_last(&self) -> bool {
        match self {
            Self::Drone(_, fault) => matches!(
                fault,
                DroneFault::Restart
                    | DroneFault::Hang(_)
                    | DroneFault::LoseGps
                    | DroneFault::Skew(_)
            ),
            Self::Links(_, link) => !matches!(link, Link::Healed),
            Self::Jam { .. } | Self::Tamper(_) => true,
        }
    }
}

/// The links from each drone of one group to each of another.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Links {
    /// One group.
    pub from: Arc<[NodeId]>,
    /// The other.
    pub to: Arc<[NodeId]>,
}

/// How links are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Link {
    /// Nothing gets through, either way.
    Cut,
    /// Nothing gets through from the second group to the first.
    OneWay,
    /// This share of the frames is lost besides, either way.
    Degraded(f64),
    /// As the radio has them.
    Healed,
}
