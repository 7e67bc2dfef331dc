//! The fault plan of a scenario.

use std::sync::Arc;
use std::time::Duration;

use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;
use muster_machines::node::Address;
use muster_machines::time::Timestamp;
use muster_runtime::plan::raw::{ActorName, FaultKindName};

/// A fault that happens once or several times.
#[derive(Debug, Clone, PartialEq)]
pub struct Fault {
    /// When it happens for the first time.
    pub when: When,
    /// What happens.
    pub kind: FaultKind,
    /// Time until it ends; `None` if it is momentary or lasts for good.
    pub duration: Option<Duration>,
    /// How often it happens.
    pub times: u32,
    /// Time from one occurrence to the next.
    pub every: Duration,
}

impl Fault {
    /// A fault that happens once, at a time of the run, and does not end.
    #[must_use]
    pub const fn at(at: Timestamp, kind: FaultKind) -> Self {
        Self {
            when: When::At(at),
            kind,
            duration: None,
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
    /// This long after the first such event.
    After(Trigger, Duration),
}

/// An event that triggers a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trigger {
    /// A vehicle is armed.
    TakingOff,
    /// A drone has reached this waypoint.
    Waypoint(u16),
    /// An elected drone leads.
    Elected,
    /// After an election, each segment has one master again.
    Settled,
    /// A drone goes to land or descends.
    Landing,
}

/// The drone that a fault affects.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Target {
    /// This drone or relay.
    Drone(NodeId),
    /// The current leader; of several, the one with the best ballot.
    Master,
}

/// What goes wrong.
#[derive(Debug, Clone, PartialEq)]
pub enum FaultKind {
    /// A fault of a drone.
    Drone(Target, DroneFault),
    /// A change of the links between two groups.
    Links(Links, LinkFault),
    /// Nothing is received within a disc, at any height.
    Jam {
        /// Centre; its height does not matter.
        centre: Ned,
        /// Radius in metres.
        radius_m: f64,
    },
    /// Frames are changed, repeated or delayed.
    Tamper(Tampered),
}

/// A fault of a drone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DroneFault {
    /// One of its actors panics.
    CrashActor(Address),
    /// Its companion computer dies; the flight controller's failsafe brings the aircraft down.
    Kill,
    /// Its aircraft falls out of the sky.
    CrashAircraft,
    /// Its process ends and is started again; the vehicle carries on with its last command.
    Restart,
    /// One of its actors, or its whole process with `None`, stops; its messages wait.
    Hang(Option<Address>),
    /// Its battery drops to this share of a full one.
    Drain(f64),
    /// Its vehicle has no horizontal position.
    LoseGps,
    /// An attacker sends again what it has sent so far.
    Replay,
    /// An attacker sends frames in its name, and in that of strangers.
    Forge,
    /// Its clock gains this many millionths from now on.
    Skew(i32),
    /// Something goes wrong with its flight controller, or on the way to it.
    Controller(ControllerFault),
}

/// A fault of a flight controller, or of the port or line to it. The last one of a kind counts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ControllerFault {
    /// Its firmware hangs: no answer, motors as they were.
    Freeze,
    /// Its port is closed.
    ClosePort,
    /// This share of the bytes on the line is lost, both ways, 0 to 1.
    LoseBytes(f64),
    /// This share of the bytes on the line is altered, both ways, 0 to 1.
    CorruptBytes(f64),
    /// Bytes on the line arrive this much later, both ways.
    DelayBytes(Duration),
    /// The battery's voltage falls by this many volts.
    SagBattery(f64),
    /// This share of the thrust is lost, 0 to 1: of one motor, from 1 in Betaflight's order, or of all.
    WeakenMotor(Option<u8>, f64),
    /// The aircraft vibrates: its gyro errs by this many °/s more.
    Shake(f64),
    /// Its pilot takes the sticks, and lands.
    TakeOver,
}

/// Frames that are tampered with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tampered {
    /// Their sender; `None` for all.
    pub from: Option<NodeId>,
    /// The affected share, drawn per receiver, 0 to 1.
    pub share: f64,
    /// What happens to them.
    pub how: Distortion,
}

/// What happens to a frame on its way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Distortion {
    /// It is altered.
    Corrupt,
    /// It arrives twice.
    Duplicate,
    /// It arrives this much later.
    Delay(Duration),
    /// It arrives up to this much later, so that others overtake it.
    Reorder(Duration),
}

impl Distortion {
    /// The longest delay of a frame; `None` if frames are not delayed.
    pub(crate) const fn delay_max(self) -> Option<Duration> {
        match self {
            Self::Delay(by) | Self::Reorder(by) => Some(by),
            Self::Corrupt | Self::Duplicate => None,
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

/// A change of links.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LinkFault {
    /// No frame gets through, either way.
    Cut,
    /// No frame gets through from the second group to the first.
    OneWay,
    /// This share of frames is lost in addition, both ways.
    Degraded(f64),
    /// As the radio model has them.
    Healed,
}

impl FaultKind {
    /// The kind in a scenario file.
    pub(super) const fn kind(&self) -> FaultKindName {
        match self {
            Self::Drone(_, fault) => fault.kind(),
            Self::Links(_, LinkFault::Cut) => FaultKindName::Cut,
            Self::Links(_, LinkFault::OneWay) => FaultKindName::OneWay,
            Self::Links(_, LinkFault::Degraded(_)) => FaultKindName::Degrade,
            Self::Links(_, LinkFault::Healed) => FaultKindName::Heal,
            Self::Jam { .. } => FaultKindName::Jam,
            Self::Tamper(tampered) => tampered.how.kind(),
        }
    }

    /// The name of its kind, with the actor that it affects, if any.
    #[must_use]
    pub fn name(&self) -> String {
        let kind = self.kind().name();
        match self {
            Self::Drone(_, DroneFault::CrashActor(actor) | DroneFault::Hang(Some(actor))) => {
                format!("{kind} {}", ActorName::from(*actor).name())
            }
            _ => kind.to_owned(),
        }
    }

    /// Whether it ends after a while, if the file has `for_s`.
    #[must_use]
    pub fn can_end(&self) -> bool {
        self.kind().keys().iter().any(|key| key == "for_s")
    }
}

impl DroneFault {
    const fn kind(&self) -> FaultKindName {
        match self {
            Self::CrashActor(_) => FaultKindName::CrashActor,
            Self::Kill => FaultKindName::Kill,
            Self::CrashAircraft => FaultKindName::CrashAircraft,
            Self::Restart => FaultKindName::Restart,
            Self::Hang(_) => FaultKindName::Hang,
            Self::Drain(_) => FaultKindName::Drain,
            Self::LoseGps => FaultKindName::LoseGps,
            Self::Replay => FaultKindName::Replay,
            Self::Forge => FaultKindName::Forge,
            Self::Skew(_) => FaultKindName::Skew,
            Self::Controller(fault) => fault.kind(),
        }
    }
}

impl ControllerFault {
    /// Whether an aircraft may break by it, whatever its drone does.
    pub(crate) const fn may_break_aircraft(self) -> bool {
        matches!(
            self,
            Self::Freeze | Self::SagBattery(_) | Self::WeakenMotor(..) | Self::Shake(_)
        )
    }

    const fn kind(&self) -> FaultKindName {
        match self {
            Self::Freeze => FaultKindName::FreezeController,
            Self::ClosePort => FaultKindName::ClosePort,
            Self::LoseBytes(_) => FaultKindName::LoseBytes,
            Self::CorruptBytes(_) => FaultKindName::CorruptBytes,
            Self::DelayBytes(_) => FaultKindName::DelayBytes,
            Self::SagBattery(_) => FaultKindName::SagBattery,
            Self::WeakenMotor(..) => FaultKindName::WeakenMotor,
            Self::Shake(_) => FaultKindName::Shake,
            Self::TakeOver => FaultKindName::TakeOver,
        }
    }
}

impl Distortion {
    const fn kind(&self) -> FaultKindName {
        match self {
            Self::Corrupt => FaultKindName::Corrupt,
            Self::Duplicate => FaultKindName::Duplicate,
            Self::Delay(_) => FaultKindName::Delay,
            Self::Reorder(_) => FaultKindName::Reorder,
        }
    }
}
