//! The fields of a scenario file. This is their only declaration: the type gives the accepted values and the default, the
//! doc comment the description. Parser, error texts, JSON Schema and reference follow from it.
//!
//! Where the type does not say everything, `x-accepted` replaces the accepted values, `x-condition` is added to them, and
//! `x-default` describes a default that depends on other fields. A number is checked by its type; how fields fit each other
//! is checked when the plan is put together.

mod fault;
mod limits;
mod names;
mod numbers;
mod reference;
mod vehicle;

use std::collections::BTreeMap;
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::Deserialize;

pub use self::fault::{
    ActorName, All, DroneName, Fault, FaultKindName, Keys, Pair, Role, Sender, TriggerName,
};
pub use self::limits::Limits;
pub use self::names::{
    AloneName, AssignmentName, BarrierName, ExposureName, FormationKind, GroundName, LivenessName,
    MediumName, ModelName, Parameters, ParametersName, PolicyName, ProtocolKind, ReceiverName,
    SuccessionName, VehicleKindName,
};
pub use self::numbers::{
    FrameRate, Gain, Gusts, Heading, Height, IntegralGain, Lean, Length, Microseconds,
    Milliseconds, Offset, PartsPerMillion, Payload, PoseSigma, Rate, Seconds, SecondsFrom0, Seed,
    Shape, Share, Sigma, Throttle, TurnRate, Velocity, Volts, Wear, Whole, Wind,
};
pub(super) use self::reference::reference;
pub use self::vehicle::{Aircraft, FlowSensor, Gains, PoseSensor, Vehicle};
use crate::schema::{Located, Or};

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Raw {
    /// Random seed of jitter, losses and the times at which drones send.
    pub seed: Located<Seed>,
    pub formation: Formation,
    #[serde(default)]
    pub changes: Vec<Change>,
    pub mission: Mission,
    #[serde(default)]
    pub relays: Vec<Located<Relay>>,
    #[serde(default)]
    pub swarms: Vec<Swarm>,
    pub radio: Radio,
    pub protocol: Protocol,
    pub follow: Option<Located<Follow>>,
    pub agent: Option<Located<Agent>>,
    #[serde(default)]
    pub vehicle: Vehicle,
    pub aircraft: Option<Located<Aircraft>>,
    #[serde(default)]
    pub failsafe: Failsafe,
    #[serde(default)]
    pub safety: Safety,
    pub geofence: Option<Located<Geofence>>,
    #[serde(default)]
    pub limits: Limits,
    #[serde(default)]
    pub faults: Vec<Located<Fault>>,
    #[serde(default)]
    pub chaos: Chaos,
}

/// The swarm and its shape.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[formation]`")]
pub struct Formation {
    /// Shape.
    pub kind: FormationKind,
    /// Number of drones, the master included.
    #[schemars(extend(
        "x-condition" = "policy `flood` takes as many as fit into one datagram"
    ))]
    pub drones: Located<Whole<1, 100_000>>,
    /// Distance between slots.
    #[schemars(extend("x-condition" = "at least `limits.separation_horizontal_m`"))]
    pub spacing_m: Located<Length>,
    /// Heading of the formation, clockwise from north. It does not change in flight.
    #[serde(default)]
    pub heading_deg: Or<Heading, 0>,
    /// Distance between drones on the ground, before take-off and after landing.
    #[serde(default)]
    #[schemars(extend(
        "x-condition" = "from `limits.separation_horizontal_m` + 0.5 to `spacing_m`"
    ))]
    pub gap_m: Or<Length, 10>,
    /// How drones stand before take-off.
    #[serde(default)]
    pub ground: GroundName,
    /// Which drone stands where in a line or a grid.
    #[schemars(extend(
        "x-condition" = "only if `ground` is \"line\" or \"grid\"",
        "x-default" = "\"optimal\" for up to 300 drones, \"greedy\" for more"
    ))]
    pub assignment: Option<Located<AssignmentName>>,
    /// Number of clusters. More than five would be nearer to each other than to the master.
    #[serde(default)]
    #[schemars(extend(
        "x-condition" = "below `drones`, only if `kind` is \"split-up\""
    ))]
    pub clusters: Or<Whole<2, 5>, 2>,
    /// Least distance between drones of different clusters.
    #[schemars(extend(
        "x-condition" = "only if `kind` is \"split-up\"",
        "x-default" = "1.05 × `radio.range_m`, so that only the master connects them"
    ))]
    pub cluster_distance_m: Option<Located<Length>>,
    /// Random seed of the places.
    #[schemars(extend(
        "x-condition" = "only if `kind` is \"random\"",
        "x-default" = "`seed`"
    ))]
    pub seed: Option<Located<Seed>>,
}

/// Changes of formation in flight, in the order of their waypoints.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[[changes]]`")]
pub struct Change {
    /// Waypoint of the change; 0 is where the take-off ends.
    #[schemars(extend(
        "x-condition" = "at most the mission's last; 0 if `protocol.kind` is \"follow\""
    ))]
    pub waypoint: Located<Whole<0, 65_534>>,
    /// Shape from then on.
    pub kind: FormationKind,
    /// Distance between the new slots.
    #[schemars(extend(
        "x-condition" = "at least `formation.gap_m`",
        "x-default" = "`formation.spacing_m`"
    ))]
    pub spacing_m: Option<Located<Length>>,
    /// New heading.
    #[schemars(extend("x-default" = "`formation.heading_deg`"))]
    pub heading_deg: Option<Heading>,
    /// Like `formation.clusters`.
    #[serde(default)]
    #[schemars(extend(
        "x-condition" = "below `formation.drones`, only if `kind` is \"split-up\""
    ))]
    pub clusters: Or<Whole<2, 5>, 2>,
    /// Like `formation.cluster_distance_m`.
    #[schemars(extend(
        "x-condition" = "only if `kind` is \"split-up\"",
        "x-default" = "1.05 × `radio.range_m`"
    ))]
    pub cluster_distance_m: Option<Located<Length>>,
    /// Like `formation.seed`.
    #[schemars(extend(
        "x-condition" = "only if `kind` is \"random\"",
        "x-default" = "`seed`"
    ))]
    pub seed: Option<Located<Seed>>,
}

/// The path that the formation flies.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[mission]`")]
pub struct Mission {
    /// Mission file.
    #[schemars(extend(
        "x-accepted" = "the path of a QGroundControl `.plan`, a `.waypoints` or a KML file, relative to the scenario file, or the name of a shipped mission, such as \"river\""
    ))]
    pub file: Located<PathBuf>,
}

/// Pure relays: radios that fly no mission and only forward. Their numbers follow those of the drones. They are never
/// awaited and never lead. Put them clear of the paths: rule 4 covers them. At most 1000, and only with
/// `protocol.policy = "tree"`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[[relays]]`")]
#[schemars(extend("x-condition" = "at most 1000, only with `protocol.policy = \"tree\"`"))]
pub struct Relay {
    /// Distance north of home.
    pub north_m: Offset,
    /// Distance east of home.
    pub east_m: Offset,
    /// Height above home.
    pub altitude_m: Height,
}

/// Other swarms in the same airspace and on the same medium. Each flies its own scenario file; radio, seed, separation and
/// supervision limits come from this file. Their drones and relays are numbered after this one's. The scenario has to keep
/// the swarms apart. Campaigns measure this file's swarm and count elections and missions of all.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[[swarms]]`")]
pub struct Swarm {
    /// Its scenario.
    #[schemars(extend(
        "x-accepted" = "the path of a scenario file without `faults` and `swarms`, relative to this file, or the name of a shipped one"
    ))]
    pub scenario: Located<PathBuf>,
    /// Distance of its home north of this one's.
    pub north_m: Offset,
    /// Distance of its home east of this one's.
    pub east_m: Offset,
    /// Time at which its operator starts the flight, from the start of the run.
    #[serde(default)]
    #[schemars(extend("x-condition" = "below `limits.duration_s`"))]
    pub after_s: Or<SecondsFrom0, 0>,
}

/// The radio model.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[radio]`")]
pub struct Radio {
    /// Range of a radio. With the model `nakagami`: the range without fading.
    pub range_m: Length,
    /// How the probability of reception falls with the distance; drawn per frame and receiver.
    #[serde(default)]
    pub model: ModelName,
    /// Shape of the fading; 1 is Rayleigh's, larger is steadier.
    #[serde(default)]
    #[schemars(extend("x-condition" = "only if `model` is \"nakagami\""))]
    pub nakagami_m: Or<Shape, 3>,
    /// Share of frames that each receiver loses in addition.
    #[serde(default)]
    pub loss: Or<Share, 0>,
    /// Bursts of losses (Gilbert-Elliott): mean time from the end of a burst to the next, exponentially distributed. Both
    /// directions of a link share one state. Links count as up or down by their mean loss, bursts included. Without this field
    /// there are no bursts.
    #[schemars(extend("x-condition" = "only with `burst_ms`"))]
    pub burst_every_ms: Option<Located<Milliseconds>>,
    /// Mean length of a burst.
    #[schemars(extend("x-condition" = "only with `burst_every_ms`"))]
    pub burst_ms: Option<Located<Milliseconds>>,
    /// Share of frames lost in a burst; they are not sensed either. With 0 there are no bursts.
    #[serde(default)]
    #[schemars(extend("x-condition" = "only with `burst_every_ms` and `burst_ms`"))]
    pub burst_loss: Or<Share, 1>,
    /// How radios share the medium.
    #[serde(default)]
    pub medium: MediumName,
    /// Least latency of a frame. The default is an unloaded hop of 64 bytes over 802.11a, measured with ns-3.
    #[serde(default)]
    #[schemars(extend("x-condition" = "only if `medium` is \"ideal\""))]
    pub latency_us: Or<Microseconds, 231>,
    /// Additional latency, at most: per frame and receiver with `ideal`, per frame before the sender's radio with `csma`.
    #[serde(default)]
    pub jitter_us: Or<Microseconds, 1_000>,
    /// Most datagrams that wait in a radio; one more is dropped. The default is 15 ms of airtime.
    #[serde(default)]
    #[schemars(extend("x-condition" = "only if `medium` is \"csma\""))]
    pub queue_max: Or<Whole<1, 1_000_000>, 64>,
}

/// How the swarm communicates.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[protocol]`")]
pub struct Protocol {
    /// How the swarm flies once all drones are in their slots.
    #[serde(default)]
    pub kind: Located<ProtocolKind>,
    /// How orders and acknowledgements spread.
    pub policy: Located<PolicyName>,
    /// Which drones the master waits for at a waypoint.
    #[schemars(extend(
        "x-condition" = "\"neighbours\" only if `kind` is \"muscop\" and there are no `changes`",
        "x-default" = "\"strict\""
    ))]
    pub barrier: Option<Located<BarrierName>>,
    /// When a silent drone counts as lost.
    #[serde(default)]
    pub liveness: LivenessName,
    /// What drones in the air do if the master is silent.
    #[serde(default)]
    pub succession: SuccessionName,
    /// Set of timing parameters; the fields below override single ones.
    #[serde(default)]
    pub parameters: ParametersName,
    /// Period at which a drone repeats what it knows.
    #[schemars(extend("x-default" = "by `parameters`"))]
    pub period_ms: Option<Milliseconds>,
    /// Period once a drone has been going to land for the time to live, under a master that goes to land, too. With policy `tree`,
    /// the longest such period of drones that give way to each other.
    #[schemars(extend("x-default" = "by `parameters`"))]
    pub keep_alive_ms: Option<Milliseconds>,
    /// Period of hellos in neighbour discovery.
    #[serde(default)]
    pub hello_period_ms: Or<Milliseconds, 500>,
    /// Longest pause between two consecutive hellos.
    #[serde(default)]
    #[schemars(extend("x-condition" = "above `hello_period_ms`"))]
    pub hello_gap_ms: Or<Milliseconds, 750>,
    /// Duration of neighbour discovery.
    #[serde(default)]
    pub discovery_ms: Or<Milliseconds, 8_000>,
    /// Consecutive hellos that make a neighbour stable.
    #[serde(default)]
    pub stable_after: Or<Whole<1, 1_000>, 3>,
    /// Silence after which a drone counts as lost.
    #[schemars(extend(
        "x-condition" = "above `period_ms` and `keep_alive_ms`",
        "x-default" = "by `parameters`"
    ))]
    pub time_to_live_ms: Option<Located<Milliseconds>>,
    /// Policy `tree`: period of the master's heartbeat. Below 100, drones that are no parents forward one heartbeat per
    /// 100 ms.
    #[schemars(extend("x-default" = "by `parameters`"))]
    pub heartbeat_ms: Option<Milliseconds>,
    /// Policy `tree`: time after which a drone repeats what was not acknowledged.
    #[schemars(extend("x-default" = "by `parameters`"))]
    pub repair_ms: Option<Milliseconds>,
}

/// How the master is followed; only if `protocol.kind` is `"follow"`.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[follow]`")]
#[schemars(extend("x-condition" = "only with `protocol.kind = \"follow\"`"))]
pub struct Follow {
    /// Period of the master's position reports. The longer, the farther apart slots must be.
    #[serde(default)]
    pub period_ms: Or<Whole<1, 1_000>, 200>,
    /// How long a drone flies on without a report; then it stops.
    #[serde(default)]
    #[schemars(extend("x-condition" = "above `period_ms`"))]
    pub hold_ms: Or<Whole<1, 5_000>, 1_000>,
    /// Speed of the master along the mission.
    #[schemars(extend(
        "x-condition" = "at most `vehicle.speed_mps`",
        "x-default" = "0.8 × `vehicle.speed_mps`, so that the others can catch up"
    ))]
    pub speed_mps: Option<Located<Rate>>,
    /// Acceleration of the master.
    #[schemars(extend(
        "x-condition" = "at most `vehicle.acceleration_mps2`",
        "x-default" = "0.5 × `vehicle.acceleration_mps2`"
    ))]
    pub acceleration_mps2: Option<Located<Rate>>,
    #[serde(default)]
    pub pilot: Vec<Sticks>,
    /// Time at which the pilot lands the swarm, after all were in their slots.
    #[schemars(extend(
        "x-condition" = "only with `follow.pilot`, which needs it; not before its last entry"
    ))]
    pub land_after_s: Option<Located<SecondsFrom0>>,
}

/// The agents that decide where the drones fly; only if `protocol.kind` is `"agent"`, which needs it. They begin once all
/// drones are in their slots at waypoint 0 and end when they land their drones, or at `limits.flight_time_s`. The waypoints
/// of the mission are only shown to them.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[agent]`")]
#[schemars(extend("x-condition" = "only with `protocol.kind = \"agent\"`, which needs it"))]
pub struct Agent {
    /// Name of the agent.
    #[schemars(extend("x-accepted" = "an agent that the program has"))]
    pub name: Located<String>,
    /// Period at which an agent is told its drone's position.
    #[serde(default)]
    pub telemetry_ms: Or<Whole<10, 60_000>, 200>,
    /// Parameters of the agent.
    #[serde(default)]
    #[schemars(
        with = "BTreeMap<String, serde_json::Value>",
        extend("x-accepted" = "a table of what the agent takes")
    )]
    pub parameters: Option<Located<toml::Table>>,
}

/// A pilot flies the master instead of the mission: its velocity from each entry to the next.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[[follow.pilot]]`")]
pub struct Sticks {
    /// Time after all were in their slots.
    #[schemars(extend("x-condition" = "not before the entry above"))]
    pub after_s: Located<SecondsFrom0>,
    /// Velocity to the north.
    #[serde(default)]
    #[schemars(extend("x-condition" = "within `vehicle.speed_mps`"))]
    pub north_mps: Or<Velocity, 0>,
    /// Velocity to the east.
    #[serde(default)]
    #[schemars(extend("x-condition" = "within `vehicle.speed_mps`"))]
    pub east_mps: Or<Velocity, 0>,
    /// Velocity upwards. All entries together keep the swarm above the ground and below `limits.altitude_max_m`.
    #[serde(default)]
    #[schemars(extend(
        "x-condition" = "from −`vehicle.descent_mps` to `vehicle.climb_mps`"
    ))]
    pub climb_mps: Or<Velocity, 0>,
}

/// When a drone gives up its flight.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[failsafe]`")]
pub struct Failsafe {
    /// What a drone in the air does that leads and has heard no other drone for the time to live.
    #[serde(default)]
    pub alone: AloneName,
    /// How long a drone without a position holds before it comes down. It starts to hold after a second. The default is
    /// as long as a swarm 300 m deep takes to pass it.
    #[serde(default)]
    pub position_hold_s: Or<SecondsFrom0, 30>,
    /// Charge below which a battery is low; PX4's `BAT_LOW_THR`.
    #[serde(default)]
    #[schemars(extend("x-condition" = "above `battery_critical`"))]
    pub battery_low: Or<Share, 15, 100>,
    /// Charge below which a battery is critical; PX4's `BAT_CRIT_THR`.
    #[serde(default)]
    #[schemars(extend("x-condition" = "below `battery_low`"))]
    pub battery_critical: Or<Share, 7, 100>,
}

/// Avoidance in flight.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[safety]`")]
pub struct Safety {
    /// Whether drones report their position and path in every frame, and give way to each other.
    #[serde(default)]
    pub avoid: bool,
}

/// Where drones may fly, in addition to the fence of the mission's plan. All slots and paths lie so far within that no
/// drone is stopped; `muster check` prints how far.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[geofence]`")]
pub struct Geofence {
    /// Distance from home over ground. Every slot is 0.2 s at twice `vehicle.speed_mps` within it.
    pub radius_m: Length,
    /// Height above home, altitude layers included.
    #[schemars(extend("x-default" = "`limits.altitude_max_m`"))]
    pub altitude_max_m: Option<Length>,
}

/// What `muster chaos` may choose; other commands ignore it.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[chaos]`")]
pub struct Chaos {
    /// Most faults of a plan. The default allows three that only together break a rule, and one beside.
    #[serde(default)]
    pub faults_max: Or<Whole<1, 100>, 4>,
    /// Fields that vary; each plan takes one of the listed values, the simplest first.
    #[serde(default)]
    #[schemars(
        with = "BTreeMap<String, Vec<serde_json::Value>>",
        extend(
            "x-accepted" = "a table of fields and lists of their values, such as `\"formation.drones\" = [5, 8]`; each value must fit the scenario"
        )
    )]
    pub vary: BTreeMap<String, Located<Vec<toml::Value>>>,
}

#[cfg(test)]
mod tests;
