//! Names that fields may take.

use muster_machines::formation::Exposure;
use muster_machines::mission::{Alone, Barrier, Liveness, Succession};
use muster_machines::msp::controller::Receiver;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::plan::Policy;
use crate::vehicle::VehicleKind;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FormationKind {
    Linear,
    Circular,
    Random,
    SplitUp,
    CompactMesh,
    RegularMatrix,
    CompactMatrix,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum GroundName {
    /// As they land: the formation drawn together.
    #[default]
    Gathered,
    /// In a line.
    Line,
    /// In rows.
    Grid,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum AssignmentName {
    /// The least sum of squared distances to the slots; for up to 300 drones.
    Optimal,
    /// The outermost slots choose first.
    Greedy,
}

#[derive(Debug, Clone, Copy, Default, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ModelName {
    /// All frames within the range, none beyond.
    #[default]
    Range,
    /// The loss 5.335e-7·d² + 3.395e-5·d of the thesis's simulator, none beyond the range.
    #[serde(rename = "80211a")]
    Ieee80211a,
    /// Path loss and Nakagami fading, which agree with ns-3; some frames are received beyond the range.
    Nakagami,
}

#[derive(Debug, Clone, Copy, Default, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum MediumName {
    /// Frames do not collide; a unicast is sent once.
    #[default]
    Ideal,
    /// 802.11a at 6 Mb/s with airtime, carrier sense, back-off and collisions; a unicast is acknowledged and sent up to 8
    /// times.
    Csma,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ProtocolKind {
    /// From waypoint to waypoint; each is opened once all drones have reached the one before.
    #[default]
    Muscop,
    /// In formation on the master, which does not wait.
    Follow,
    /// Each drone's agent decides, a program of one's own; `[agent]` names it.
    Agent,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PolicyName {
    /// The thesis's periodic repetition.
    Flood,
    /// On change, along a tree, repaired at each hop.
    Tree,
}

impl From<PolicyName> for Policy {
    fn from(name: PolicyName) -> Self {
        match name {
            PolicyName::Flood => Self::Flood,
            PolicyName::Tree => Self::Tree,
        }
    }
}

#[derive(Debug, Clone, Copy, Default, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum BarrierName {
    /// Every drone.
    #[default]
    Strict,
    /// The drones that the master hears itself, as in the thesis's figures; for comparison.
    Neighbours,
}

impl From<BarrierName> for Barrier {
    fn from(name: BarrierName) -> Self {
        match name {
            BarrierName::Strict => Self::Strict,
            BarrierName::Neighbours => Self::Neighbours,
        }
    }
}

#[derive(Debug, Clone, Copy, Default, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SuccessionName {
    /// A drone that misses the master claims leadership.
    #[default]
    Elect,
    /// Each drone lands on the spot.
    Land,
}

impl From<SuccessionName> for Succession {
    fn from(name: SuccessionName) -> Self {
        match name {
            SuccessionName::Elect => Self::Elect,
            SuccessionName::Land => Self::Land,
        }
    }
}

#[derive(Debug, Clone, Copy, Default, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum LivenessName {
    /// Its number has not risen for the time to live.
    #[default]
    Heartbeat,
    /// The same, but checked at waypoints only.
    Thesis,
}

impl From<LivenessName> for Liveness {
    fn from(name: LivenessName) -> Self {
        match name {
            LivenessName::Heartbeat => Self::Heartbeat,
            LivenessName::Thesis => Self::Thesis,
        }
    }
}

#[derive(Debug, Clone, Copy, Default, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ParametersName {
    /// About one frame per drone and second.
    #[default]
    Quiet,
    /// About ten frames.
    Fast,
    /// About thirty frames of a master or parent and ten of others, for networks that deliver within two milliseconds.
    Lan,
}

#[derive(Debug, Clone, Copy, Default, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum VehicleKindName {
    /// A vehicle in closed form: it flies exactly what it is told.
    #[default]
    ClosedForm,
    /// A flight controller over MSP that takes sticks, with its aircraft; simulated in a simulation.
    Msp,
}

impl From<VehicleKindName> for VehicleKind {
    fn from(name: VehicleKindName) -> Self {
        match name {
            VehicleKindName::ClosedForm => Self::ClosedForm,
            VehicleKindName::Msp => Self::Msp,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ReceiverName {
    /// Nobody: MSP is the only receiver.
    Sole,
    /// A pilot arms and disarms, gives MSP the sticks by a switch, and may take them back; simulated in a simulation.
    Override,
}

impl From<ReceiverName> for Receiver {
    fn from(name: ReceiverName) -> Self {
        match name {
            ReceiverName::Sole => Self::Sole,
            ReceiverName::Override => Self::Override,
        }
    }
}

#[derive(Debug, Clone, Copy, Default, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum AloneName {
    /// It flies on.
    #[default]
    CarryOn,
    /// It goes to land.
    Land,
}

impl From<AloneName> for Alone {
    fn from(name: AloneName) -> Self {
        match name {
            AloneName::CarryOn => Self::CarryOn,
            AloneName::Land => Self::Land,
        }
    }
}

/// What may bring two drones too near each other: a single fault, or the plan itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ExposureName {
    /// A drone is late.
    Late,
    /// A drone is out of lockstep and flies in its own layer.
    Apart,
    /// Two drones are out of lockstep, and each flies in its own layer.
    BothApart,
    /// A drone comes down on the spot.
    Descends,
    /// A drone's computer dies; its flight controller brings it down.
    Killed,
    /// Without any fault, drones are planned out of the master's reach, and share altitudes with the others.
    OutOfReach,
}

impl From<Exposure> for ExposureName {
    fn from(exposure: Exposure) -> Self {
        match exposure {
            Exposure::Late => Self::Late,
            Exposure::Apart => Self::Apart,
            Exposure::BothApart => Self::BothApart,
            Exposure::Descends => Self::Descends,
            Exposure::Killed => Self::Killed,
        }
    }
}

/// A set of timing parameters; the file may override each.
#[derive(Debug, Clone, Copy)]
pub struct Parameters {
    pub period_ms: u64,
    pub keep_alive_ms: u64,
    pub time_to_live_ms: u64,
    pub heartbeat_ms: u64,
    pub repair_ms: u64,
}

impl ParametersName {
    /// All sets with their names.
    pub const ALL: [(&str, Self); 3] = [
        ("quiet", Self::Quiet),
        ("fast", Self::Fast),
        ("lan", Self::Lan),
    ];

    /// Its parameters.
    #[must_use]
    pub const fn set(self) -> Parameters {
        match self {
            // The thesis's numbers (sections 4.2 and 4.4) and its ancestor's. A keep-alive of a second for drones that are
            // landing, which are not awaited: a frame per drone and second.
            Self::Quiet => Parameters {
                period_ms: 200,
                keep_alive_ms: 1_000,
                time_to_live_ms: 5_000,
                heartbeat_ms: 1_000,
                repair_ms: 8,
            },
            // To detect a lost master within a second: two heartbeats of a link without losses and twenty parent probes
            // are 0.5 s. Ten heartbeats a second leave two frames a second for all else.
            Self::Fast => Parameters {
                period_ms: 100,
                keep_alive_ms: 500,
                time_to_live_ms: 2_000,
                heartbeat_ms: 100,
                repair_ms: 8,
            },
            // Between processes of a machine or on a switch: two heartbeats and seven parent probes of 4.5 ms are 0.11 s.
            // A master or parent sends 25 frames a second, any other drone eight; each receiver checks as many signatures.
            Self::Lan => Parameters {
                period_ms: 50,
                keep_alive_ms: 250,
                time_to_live_ms: 1_000,
                heartbeat_ms: 35,
                repair_ms: 3,
            },
        }
    }
}
