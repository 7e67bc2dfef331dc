//! Faults: a kind, the keys that it takes, and when it happens.

use std::ops::Range;

use muster_machines::node::Address;
use schemars::{JsonSchema, Schema};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use super::{
    Length, Milliseconds, Offset, PartsPerMillion, Seconds, SecondsFrom0, Share, TurnRate, Volts,
    Whole,
};
use crate::schema::{Located, Or};

/// Faults; any number. Each has a `kind`, the keys of that kind, and one of `at_s`, `at_waypoint` and `when`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[[faults]]`")]
#[schemars(transform = constrain)]
pub struct Fault {
    /// What goes wrong.
    pub kind: Located<FaultKindName>,
    /// Time of the fault, from the start of the run.
    #[schemars(extend("x-condition" = "one of `at_s`, `at_waypoint` and `when`"))]
    pub at_s: Option<SecondsFrom0>,
    /// The fault happens when the first drone reaches this waypoint; 0 is where the take-off ends.
    #[schemars(extend("x-condition" = "at most the mission's last"))]
    pub at_waypoint: Option<Located<Whole<0, 65_534>>>,
    /// The fault happens at the first such event.
    pub when: Option<TriggerName>,
    /// Delay after `at_waypoint` or `when`.
    #[serde(default)]
    #[schemars(extend("x-condition" = "only with `at_waypoint` or `when`"))]
    pub after_s: Or<SecondsFrom0, 0>,
    /// Duration of the fault.
    #[schemars(extend("x-default" = "for good"))]
    pub for_s: Option<Located<Seconds>>,
    /// How often the fault happens.
    #[serde(default)]
    #[schemars(extend("x-condition" = "only with `every_s`"))]
    pub times: Or<Whole<1, 100_000>, 1>,
    /// Time from one occurrence to the next.
    #[schemars(extend("x-condition" = "only with `times`"))]
    pub every_s: Option<Located<Seconds>>,
    /// The affected drone. `"master"` is the current leader; of several, the one with the best ballot.
    pub drone: Option<Located<DroneName>>,
    /// The affected actor.
    pub actor: Option<Located<ActorName>>,
    /// Charge that is left, as a share of a full battery. At 0 the drone is dead and its aircraft comes down.
    pub charge: Option<Located<Share>>,
    /// Millionths that the clock gains.
    pub ppm: Option<Located<PartsPerMillion>>,
    /// The affected links: between two drones, or between each drone of one group and each of another. The last fault of a
    /// link counts.
    pub links: Option<Located<Pair>>,
    /// Share of frames lost in addition, both ways.
    pub loss: Option<Located<Share>>,
    /// Centre of the disc, north of home.
    pub north_m: Option<Located<Offset>>,
    /// Centre of the disc, east of home.
    pub east_m: Option<Located<Offset>>,
    /// Radius of the disc.
    pub radius_m: Option<Located<Length>>,
    /// The sender of the affected frames.
    pub from: Option<Located<Sender>>,
    /// Share of the affected frames, drawn per receiver; of bytes on a line to a flight controller, drawn per byte.
    #[serde(default)]
    pub share: Or<Share, 1>,
    /// Delay of the affected frames or bytes.
    pub by_ms: Option<Located<Milliseconds>>,
    /// Voltage that the battery loses.
    pub volts: Option<Located<Volts>>,
    /// The affected motor, in Betaflight's order: rear right, front right, rear left, front left.
    #[schemars(extend("x-default" = "all"))]
    pub motor: Option<Located<Whole<1, 4>>>,
    /// Rate of turn.
    pub rate_dps: Option<Located<TurnRate>>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FaultKindName {
    /// An actor panics; its supervisor restarts it.
    CrashActor,
    /// An actor, or the whole process without `actor`, stops handling messages, until `for_s` is over or it is restarted
    /// (`limits.hang_ms`, `limits.watchdog_ms`).
    Hang,
    /// The process ends and starts again from its journal after `for_s` (1 s without it). The vehicle carries on with its
    /// last command, at most for `limits.controller_s`.
    Restart,
    /// The companion computer dies. The flight controller brings the aircraft down where it is; the others keep clear of
    /// it.
    Kill,
    /// The aircraft falls out of the sky.
    CrashAircraft,
    /// The vehicle has no horizontal position.
    LoseGps,
    /// The battery drops to `charge` at once.
    Drain,
    /// An attacker sends the drone's last 1,024 frames again, one each 10 ms.
    Replay,
    /// An attacker without its key sends frames in the drone's name (with a better ballot, in a later incarnation), in a
    /// stranger's, of another swarm, and noise.
    Forge,
    /// The drone's clock gains `ppm` millionths.
    Skew,
    /// The flight controller's firmware hangs: no answer, motors as they were. Only with `vehicle.kind = "msp"`.
    FreezeController,
    /// The port to the flight controller is closed, and opened again after `for_s`. Only with `vehicle.kind = "msp"`.
    ClosePort,
    /// A share of the bytes on the line to the flight controller is lost, both ways. Only with `vehicle.kind = "msp"`.
    LoseBytes,
    /// A share of the bytes on the line to the flight controller is altered, both ways. Only with `vehicle.kind = "msp"`.
    CorruptBytes,
    /// Bytes on the line to the flight controller arrive `by_ms` later, both ways. Only with `vehicle.kind = "msp"`.
    DelayBytes,
    /// The battery's voltage falls by `volts`. Only with `vehicle.kind = "msp"`.
    SagBattery,
    /// A motor, or all of them, loses a `share` of its thrust. Only with `vehicle.kind = "msp"`.
    WeakenMotor,
    /// The aircraft vibrates: its gyro errs by `rate_dps` more, as a standard deviation. Only with `vehicle.kind = "msp"`.
    Shake,
    /// The pilot takes the sticks, for good, and lands. Only with `vehicle.receiver = "override"`.
    TakeOver,
    /// No frame gets through, either way.
    Cut,
    /// No frame gets through from the second drone or group to the first.
    OneWay,
    /// The links are as the radio model has them again.
    Heal,
    /// A share of the frames is lost in addition, both ways.
    Degrade,
    /// Nothing is received within a disc, at any height.
    Jam,
    /// Frames are altered on their way.
    Corrupt,
    /// Frames arrive twice.
    Duplicate,
    /// Frames arrive `by_ms` later. For rule 1, links of which frames are later by more than a heartbeat are grey.
    Delay,
    /// Frames arrive up to `by_ms` later, each by another time, so that they overtake each other.
    Reorder,
}

/// The keys that a kind of fault takes beside its time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Keys {
    pub required: &'static [&'static str],
    pub optional: &'static [&'static str],
}

impl Keys {
    const fn new(required: &'static [&'static str], optional: &'static [&'static str]) -> Self {
        Self { required, optional }
    }

    /// All of them, the required ones first.
    pub fn iter(&self) -> impl Iterator<Item = &'static str> {
        self.required.iter().chain(self.optional).copied()
    }
}

impl FaultKindName {
    /// All kinds, in the order of the reference.
    pub const ALL: [Self; 28] = [
        Self::CrashActor,
        Self::Hang,
        Self::Restart,
        Self::Kill,
        Self::CrashAircraft,
        Self::LoseGps,
        Self::Drain,
        Self::Replay,
        Self::Forge,
        Self::Skew,
        Self::FreezeController,
        Self::ClosePort,
        Self::LoseBytes,
        Self::CorruptBytes,
        Self::DelayBytes,
        Self::SagBattery,
        Self::WeakenMotor,
        Self::Shake,
        Self::TakeOver,
        Self::Cut,
        Self::OneWay,
        Self::Heal,
        Self::Degrade,
        Self::Jam,
        Self::Corrupt,
        Self::Duplicate,
        Self::Delay,
        Self::Reorder,
    ];

    /// The keys that it takes. A kind without `for_s` is momentary or lasts for good.
    #[must_use]
    pub const fn keys(self) -> Keys {
        match self {
            Self::CrashActor => Keys::new(&["drone", "actor"], &[]),
            Self::Hang => Keys::new(&["drone"], &["actor", "for_s"]),
            Self::Restart | Self::LoseGps | Self::FreezeController | Self::ClosePort => {
                Keys::new(&["drone"], &["for_s"])
            }
            Self::LoseBytes | Self::CorruptBytes => Keys::new(&["drone", "share"], &["for_s"]),
            Self::DelayBytes => Keys::new(&["drone", "by_ms"], &["for_s"]),
            Self::SagBattery => Keys::new(&["drone", "volts"], &["for_s"]),
            Self::WeakenMotor => Keys::new(&["drone", "share"], &["motor", "for_s"]),
            Self::Shake => Keys::new(&["drone", "rate_dps"], &["for_s"]),
            Self::Kill | Self::CrashAircraft | Self::Replay | Self::Forge | Self::TakeOver => {
                Keys::new(&["drone"], &[])
            }
            Self::Drain => Keys::new(&["drone", "charge"], &[]),
            Self::Skew => Keys::new(&["drone", "ppm"], &["for_s"]),
            Self::Cut | Self::OneWay => Keys::new(&["links"], &["for_s"]),
            Self::Heal => Keys::new(&["links"], &[]),
            Self::Degrade => Keys::new(&["links", "loss"], &["for_s"]),
            Self::Jam => Keys::new(&["north_m", "east_m", "radius_m"], &["for_s"]),
            Self::Corrupt | Self::Duplicate => Keys::new(&["from"], &["share", "for_s"]),
            Self::Delay | Self::Reorder => Keys::new(&["from", "by_ms"], &["share", "for_s"]),
        }
    }

    /// Whether it happens to a flight controller, or to the port or line to it.
    #[must_use]
    pub const fn is_of_controller(self) -> bool {
        matches!(
            self,
            Self::FreezeController
                | Self::ClosePort
                | Self::LoseBytes
                | Self::CorruptBytes
                | Self::DelayBytes
                | Self::SagBattery
                | Self::WeakenMotor
                | Self::Shake
                | Self::TakeOver
        )
    }

    /// The name in a file.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::CrashActor => "crash-actor",
            Self::Hang => "hang",
            Self::Restart => "restart",
            Self::Kill => "kill",
            Self::CrashAircraft => "crash-aircraft",
            Self::LoseGps => "lose-gps",
            Self::Drain => "drain",
            Self::Replay => "replay",
            Self::Forge => "forge",
            Self::Skew => "skew",
            Self::FreezeController => "freeze-controller",
            Self::ClosePort => "close-port",
            Self::LoseBytes => "lose-bytes",
            Self::CorruptBytes => "corrupt-bytes",
            Self::DelayBytes => "delay-bytes",
            Self::SagBattery => "sag-battery",
            Self::WeakenMotor => "weaken-motor",
            Self::Shake => "shake",
            Self::TakeOver => "take-over",
            Self::Cut => "cut",
            Self::OneWay => "one-way",
            Self::Heal => "heal",
            Self::Degrade => "degrade",
            Self::Jam => "jam",
            Self::Corrupt => "corrupt",
            Self::Duplicate => "duplicate",
            Self::Delay => "delay",
            Self::Reorder => "reorder",
        }
    }
}

impl Fault {
    /// Every key that only some kinds take, with its place if the fault has it.
    pub fn keys(&self) -> [(&'static str, Option<Range<usize>>); 16] {
        fn span<T>(value: &Option<Located<T>>) -> Option<Range<usize>> {
            value.as_ref().map(|it| it.span())
        }
        [
            ("for_s", span(&self.for_s)),
            ("drone", span(&self.drone)),
            ("actor", span(&self.actor)),
            ("charge", span(&self.charge)),
            ("ppm", span(&self.ppm)),
            ("links", span(&self.links)),
            ("loss", span(&self.loss)),
            ("north_m", span(&self.north_m)),
            ("east_m", span(&self.east_m)),
            ("radius_m", span(&self.radius_m)),
            ("from", span(&self.from)),
            ("share", self.share.span()),
            ("by_ms", span(&self.by_ms)),
            ("volts", span(&self.volts)),
            ("motor", span(&self.motor)),
            ("rate_dps", span(&self.rate_dps)),
        ]
    }
}

/// Adds to the schema what each kind takes, and that a fault has one time.
fn constrain(schema: &mut Schema) {
    let all = FaultKindName::ALL;
    let kinds = all.map(|kind| {
        let keys = kind.keys();
        let others = all
            .iter()
            .flat_map(|other| other.keys().iter().collect::<Vec<_>>());
        let others = others.filter(|key| !keys.iter().any(|own| own == *key));
        let refused: Map<String, Value> = others
            .map(|key| (key.to_owned(), Value::from(false)))
            .collect();
        json!({
            "if": { "properties": { "kind": { "const": kind.name() } } },
            "then": { "required": keys.required, "properties": refused },
        })
    });
    schema.insert("allOf".to_owned(), kinds.to_vec().into());
    let times = ["at_s", "at_waypoint", "when"].map(|key| json!({ "required": [key] }));
    schema.insert("oneOf".to_owned(), times.to_vec().into());
    let together = json!({ "times": ["every_s"], "every_s": ["times"] });
    schema.insert("dependentRequired".to_owned(), together);
}

#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TriggerName {
    /// A vehicle is armed.
    TakingOff,
    /// An elected drone leads.
    Elected,
    /// After an election, each segment has one master again.
    Settled,
    /// A drone goes to land or descends.
    Landing,
}

/// Two drones, or two groups of drones.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(
    untagged,
    expecting = "two drones or groups of drones, as in `[2, 3]` or `[[0, 1, 2], [3, 4]]`"
)]
#[schemars(extend(
    "x-accepted" = "two drones or groups of drones, as in `[2, 3]` or `[[0, 1, 2], [3, 4]]`"
))]
pub enum Pair {
    Drones([Whole<0, 99_999>; 2]),
    Groups([Vec<Whole<0, 99_999>>; 2]),
}

/// The sender of frames: one drone, or all.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "\"all\" or the number of a drone or relay")]
#[schemars(extend("x-accepted" = "\"all\" or the number of a drone or relay"))]
pub enum Sender {
    All(All),
    Drone(Whole<0, 99_999>),
}

#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum All {
    All,
}

/// A drone by its number or its role.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "\"master\" or the number of a drone or relay")]
#[schemars(extend("x-accepted" = "\"master\" or the number of a drone or relay"))]
pub enum DroneName {
    Role(Role),
    Number(Whole<0, 99_999>),
}

#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    Master,
}

#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ActorName {
    Radio,
    Routing,
    Mission,
    Navigation,
    Msp,
}

impl ActorName {
    /// The actor itself.
    #[must_use]
    pub const fn address(self) -> Address {
        match self {
            Self::Radio => Address::Radio,
            Self::Routing => Address::Routing,
            Self::Mission => Address::Mission,
            Self::Navigation => Address::Navigation,
            Self::Msp => Address::Msp,
        }
    }

    /// The name in a file.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Radio => "radio",
            Self::Routing => "routing",
            Self::Mission => "mission",
            Self::Navigation => "navigation",
            Self::Msp => "msp",
        }
    }
}

impl From<Address> for ActorName {
    fn from(actor: Address) -> Self {
        match actor {
            Address::Radio => Self::Radio,
            Address::Routing => Self::Routing,
            Address::Mission => Self::Mission,
            Address::Navigation => Self::Navigation,
            Address::Msp => Self::Msp,
        }
    }
}
