//! A scenario file's fields as they are written, those of its world, too; numbers are checked for themselves here, how they
//! fit each other when they are put together.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::PathBuf;

use muster_machines::formation::Exposure;
use muster_machines::mission::{Alone, Barrier, Liveness, Succession};
use muster_machines::node::Address;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use toml::Spanned;

use super::Policy;

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Raw {
    #[schemars(with = "Whole<0, { i64::MAX as u64 }>")]
    pub seed: Spanned<Whole<0, { i64::MAX as u64 }>>,
    pub formation: Formation,
    #[serde(default)]
    pub changes: Vec<Change>,
    pub mission: Mission,
    #[serde(default)]
    #[schemars(with = "Vec<Relay>")]
    pub relays: Vec<Spanned<Relay>>,
    #[serde(default)]
    pub swarms: Vec<Swarm>,
    pub radio: Radio,
    pub protocol: Protocol,
    #[schemars(with = "Option<Follow>")]
    pub follow: Option<Spanned<Follow>>,
    #[serde(default)]
    pub vehicle: Vehicle,
    #[serde(default)]
    pub failsafe: Failsafe,
    #[serde(default)]
    pub safety: Safety,
    #[schemars(with = "Option<Geofence>")]
    pub geofence: Option<Spanned<Geofence>>,
    #[serde(default)]
    pub limits: Limits,
    #[serde(default)]
    #[schemars(with = "Vec<Fault>")]
    pub faults: Vec<Spanned<Fault>>,
    #[serde(default)]
    pub chaos: Chaos,
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[formation]`")]
pub struct Formation {
    pub kind: FormationKind,
    #[schemars(with = "Whole<1, 100_000>")]
    pub drones: Spanned<Whole<1, 100_000>>,
    #[schemars(with = "Length")]
    pub spacing_m: Spanned<Length>,
    #[serde(default)]
    pub heading_deg: Heading,
    #[schemars(with = "Option<Length>")]
    pub gap_m: Option<Spanned<Length>>,
    #[serde(default)]
    pub ground: GroundName,
    #[schemars(with = "Option<AssignmentName>")]
    pub assignment: Option<Spanned<AssignmentName>>,
    #[schemars(with = "Option<Whole<2, 5>>")]
    pub clusters: Option<Spanned<Whole<2, 5>>>,
    #[schemars(with = "Option<Length>")]
    pub cluster_distance_m: Option<Spanned<Length>>,
    #[schemars(with = "Option<Whole<0, { i64::MAX as u64 }>>")]
    pub seed: Option<Spanned<Whole<0, { i64::MAX as u64 }>>>,
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[[changes]]`")]
pub struct Change {
    #[schemars(with = "Whole<0, 65_534>")]
    pub waypoint: Spanned<Whole<0, 65_534>>,
    pub kind: FormationKind,
    #[schemars(with = "Option<Length>")]
    pub spacing_m: Option<Spanned<Length>>,
    pub heading_deg: Option<Heading>,
    #[schemars(with = "Option<Whole<2, 5>>")]
    pub clusters: Option<Spanned<Whole<2, 5>>>,
    #[schemars(with = "Option<Length>")]
    pub cluster_distance_m: Option<Spanned<Length>>,
    #[schemars(with = "Option<Whole<0, { i64::MAX as u64 }>>")]
    pub seed: Option<Spanned<Whole<0, { i64::MAX as u64 }>>>,
}

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

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum GroundName {
    #[default]
    Gathered,
    Line,
    Grid,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum AssignmentName {
    Optimal,
    Greedy,
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[mission]`")]
pub struct Mission {
    #[schemars(with = "PathBuf")]
    pub file: Spanned<PathBuf>,
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[[relays]]`")]
pub struct Relay {
    pub north_m: Offset,
    pub east_m: Offset,
    pub altitude_m: Height,
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[[swarms]]`")]
pub struct Swarm {
    #[schemars(with = "PathBuf")]
    pub scenario: Spanned<PathBuf>,
    pub north_m: Offset,
    pub east_m: Offset,
    #[schemars(with = "Option<Instant>")]
    pub after_s: Option<Spanned<Instant>>,
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[radio]`")]
pub struct Radio {
    pub range_m: Length,
    #[serde(default)]
    pub model: ModelName,
    #[schemars(with = "Option<Shape>")]
    pub nakagami_m: Option<Spanned<Shape>>,
    #[serde(default)]
    pub loss: Share,
    #[schemars(with = "Option<Milliseconds>")]
    pub burst_every_ms: Option<Spanned<Milliseconds>>,
    #[schemars(with = "Option<Milliseconds>")]
    pub burst_ms: Option<Spanned<Milliseconds>>,
    #[schemars(with = "Option<Share>")]
    pub burst_loss: Option<Spanned<Share>>,
    #[serde(default)]
    pub medium: MediumName,
    #[schemars(with = "Option<Whole<0, 60_000_000>>")]
    pub latency_us: Option<Spanned<Whole<0, 60_000_000>>>,
    pub jitter_us: Option<Whole<0, 60_000_000>>,
    #[schemars(with = "Option<Whole<1, 1_000_000>>")]
    pub queue_max: Option<Spanned<Whole<1, 1_000_000>>>,
}

#[derive(Debug, Clone, Copy, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ModelName {
    #[default]
    Range,
    #[serde(rename = "80211a")]
    Ieee80211a,
    Nakagami,
}

#[derive(Debug, Clone, Copy, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum MediumName {
    #[default]
    Ideal,
    Csma,
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[protocol]`")]
pub struct Protocol {
    #[serde(default)]
    pub kind: ProtocolKind,
    #[schemars(with = "PolicyName")]
    pub policy: Spanned<PolicyName>,
    #[schemars(with = "Option<BarrierName>")]
    pub barrier: Option<Spanned<BarrierName>>,
    #[serde(default)]
    pub liveness: LivenessName,
    #[serde(default)]
    pub succession: SuccessionName,
    #[serde(default)]
    pub parameters: ParametersName,
    pub period_ms: Option<Milliseconds>,
    pub keep_alive_ms: Option<Milliseconds>,
    pub hello_period_ms: Option<Milliseconds>,
    #[schemars(with = "Option<Milliseconds>")]
    pub hello_gap_ms: Option<Spanned<Milliseconds>>,
    pub discovery_ms: Option<Milliseconds>,
    pub stable_after: Option<Whole<1, 1_000>>,
    #[schemars(with = "Option<Milliseconds>")]
    pub time_to_live_ms: Option<Spanned<Milliseconds>>,
    pub heartbeat_ms: Option<Milliseconds>,
    pub repair_ms: Option<Milliseconds>,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ProtocolKind {
    #[default]
    Muscop,
    Follow,
}

#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[follow]`")]
pub struct Follow {
    #[schemars(with = "Option<Whole<1, 1_000>>")]
    pub period_ms: Option<Spanned<Whole<1, 1_000>>>,
    #[schemars(with = "Option<Whole<1, 5_000>>")]
    pub hold_ms: Option<Spanned<Whole<1, 5_000>>>,
    #[schemars(with = "Option<Rate>")]
    pub speed_mps: Option<Spanned<Rate>>,
    #[schemars(with = "Option<Rate>")]
    pub acceleration_mps2: Option<Spanned<Rate>>,
    #[serde(default)]
    pub pilot: Vec<Sticks>,
    #[schemars(with = "Option<Instant>")]
    pub land_after_s: Option<Spanned<Instant>>,
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[[follow.pilot]]`")]
pub struct Sticks {
    #[schemars(with = "Instant")]
    pub after_s: Spanned<Instant>,
    #[serde(default)]
    pub north_mps: Deflection,
    #[serde(default)]
    pub east_mps: Deflection,
    #[serde(default)]
    pub climb_mps: Deflection,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PolicyName {
    Flood,
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

#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum BarrierName {
    Strict,
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

#[derive(Debug, Clone, Copy, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SuccessionName {
    #[default]
    Elect,
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

#[derive(Debug, Clone, Copy, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum LivenessName {
    #[default]
    Heartbeat,
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

#[derive(Debug, Clone, Copy, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ParametersName {
    #[default]
    Quiet,
    Fast,
    Lan,
}

#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[vehicle]`")]
pub struct Vehicle {
    pub speed_mps: Option<Rate>,
    pub acceleration_mps2: Option<Rate>,
    pub climb_mps: Option<Rate>,
    pub descent_mps: Option<Rate>,
    pub landing_mps: Option<Rate>,
    pub landing_altitude_m: Option<Height>,
    pub settle_ms: Option<Whole<0, 60_000>>,
    pub endurance_s: Option<Seconds>,
}

#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[failsafe]`")]
pub struct Failsafe {
    #[serde(default)]
    pub alone: AloneName,
    pub position_hold_s: Option<Instant>,
    #[schemars(with = "Option<Share>")]
    pub battery_low: Option<Spanned<Share>>,
    #[schemars(with = "Option<Share>")]
    pub battery_critical: Option<Spanned<Share>>,
}

#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[safety]`")]
pub struct Safety {
    #[serde(default)]
    pub avoid: bool,
}

#[derive(Debug, Clone, Copy, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum AloneName {
    #[default]
    CarryOn,
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

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[geofence]`")]
pub struct Geofence {
    pub radius_m: Length,
    pub altitude_max_m: Option<Length>,
}

#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[limits]`")]
pub struct Limits {
    pub separation_horizontal_m: Option<Length>,
    pub separation_vertical_m: Option<Length>,
    #[schemars(with = "Option<Length>")]
    pub altitude_max_m: Option<Spanned<Length>>,
    pub duration_s: Option<Seconds>,
    pub set_up_s: Option<Seconds>,
    pub take_off_s: Option<Seconds>,
    pub leg_s: Option<Seconds>,
    pub flight_time_s: Option<Seconds>,
    pub waiting_max: Option<Whole<8, 1_000_000>>,
    pub restarts_max: Option<Whole<0, 1_000_000>>,
    pub hang_ms: Option<Milliseconds>,
    pub watchdog_ms: Option<Milliseconds>,
    pub controller_s: Option<Seconds>,
    pub restart_window_s: Option<Seconds>,
    #[schemars(with = "Option<Vec<ExposureName>>")]
    pub accept: Option<Spanned<Vec<ExposureName>>>,
}

impl Limits {
    /// Whether it is accepted that a single fault exposes drones to this; where nothing is listed, nothing is.
    pub fn accepts(&self, exposure: Exposure) -> bool {
        let accepted = self.accept.iter().flat_map(Spanned::get_ref);
        accepted
            .into_iter()
            .any(|name| Exposure::from(*name) == exposure)
    }
}

/// What a single fault may expose drones to.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ExposureName {
    Late,
    Apart,
    Descends,
    Killed,
}

impl From<ExposureName> for Exposure {
    fn from(name: ExposureName) -> Self {
        match name {
            ExposureName::Late => Self::Late,
            ExposureName::Apart => Self::Apart,
            ExposureName::Descends => Self::Descends,
            ExposureName::Killed => Self::Killed,
        }
    }
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[[faults]]`")]
pub struct Fault {
    pub at_s: Option<Instant>,
    #[schemars(with = "Option<Whole<0, 65_534>>")]
    pub at_waypoint: Option<Spanned<Whole<0, 65_534>>>,
    pub when: Option<TriggerName>,
    #[schemars(with = "Option<Instant>")]
    pub after_s: Option<Spanned<Instant>>,
    #[schemars(with = "Option<Seconds>")]
    pub for_s: Option<Spanned<Seconds>>,
    #[schemars(with = "Option<Whole<1, 100_000>>")]
    pub times: Option<Spanned<Whole<1, 100_000>>>,
    #[schemars(with = "Option<Seconds>")]
    pub every_s: Option<Spanned<Seconds>>,
    #[schemars(with = "Option<Victim>")]
    pub crash: Option<Spanned<Victim>>,
    #[schemars(with = "Option<ActorName>")]
    pub actor: Option<Spanned<ActorName>>,
    #[schemars(with = "Option<Victim>")]
    pub hang: Option<Spanned<Victim>>,
    #[schemars(with = "Option<Victim>")]
    pub restart: Option<Spanned<Victim>>,
    #[schemars(with = "Option<Victim>")]
    pub kill: Option<Spanned<Victim>>,
    #[schemars(with = "Option<Victim>")]
    pub crash_aircraft: Option<Spanned<Victim>>,
    #[schemars(with = "Option<Victim>")]
    pub lose_gps: Option<Spanned<Victim>>,
    #[schemars(with = "Option<Victim>")]
    pub drain: Option<Spanned<Victim>>,
    #[schemars(with = "Option<Share>")]
    pub to: Option<Spanned<Share>>,
    #[schemars(with = "Option<Pair>")]
    pub cut: Option<Spanned<Pair>>,
    #[schemars(with = "Option<Pair>")]
    pub one_way: Option<Spanned<Pair>>,
    #[schemars(with = "Option<Pair>")]
    pub degrade: Option<Spanned<Pair>>,
    #[schemars(with = "Option<Share>")]
    pub loss: Option<Spanned<Share>>,
    #[schemars(with = "Option<Pair>")]
    pub heal: Option<Spanned<Pair>>,
    pub jam: Option<Disc>,
    #[schemars(with = "Option<Sender>")]
    pub corrupt: Option<Spanned<Sender>>,
    #[schemars(with = "Option<Sender>")]
    pub duplicate: Option<Spanned<Sender>>,
    #[schemars(with = "Option<Sender>")]
    pub delay: Option<Spanned<Sender>>,
    #[schemars(with = "Option<Sender>")]
    pub reorder: Option<Spanned<Sender>>,
    #[schemars(with = "Option<Share>")]
    pub share: Option<Spanned<Share>>,
    #[schemars(with = "Option<Milliseconds>")]
    pub by_ms: Option<Spanned<Milliseconds>>,
    #[schemars(with = "Option<Victim>")]
    pub replay: Option<Spanned<Victim>>,
    #[schemars(with = "Option<Victim>")]
    pub forge: Option<Spanned<Victim>>,
    #[schemars(with = "Option<Victim>")]
    pub skew: Option<Spanned<Victim>>,
    #[schemars(with = "Option<Rating>")]
    pub ppm: Option<Spanned<Rating>>,
}

#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[chaos]`")]
pub struct Chaos {
    pub faults_max: Option<Whole<1, 100>>,
    #[serde(default)]
    #[schemars(with = "BTreeMap<String, Vec<serde_json::Value>>")]
    pub vary: BTreeMap<String, Spanned<Vec<toml::Value>>>,
}

#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TriggerName {
    TakingOff,
    Elected,
    Settled,
    Landing,
}

/// Two drones, or two groups of them.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(
    untagged,
    expecting = "two drones or groups of drones, as in `[2, 3]` or `[[0, 1, 2], [3, 4]]`"
)]
pub enum Pair {
    Drones([Whole<0, 99_999>; 2]),
    Groups([Vec<Whole<0, 99_999>>; 2]),
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Disc {
    pub north_m: Offset,
    pub east_m: Offset,
    pub radius_m: Length,
}

/// Whose frames: those of a drone, or all.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "\"all\" or the number of a drone")]
pub enum Sender {
    All(All),
    Drone(Whole<0, 99_999>),
}

#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum All {
    All,
}

/// How much a clock gains.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(try_from = "i64")]
pub struct Rating(pub i32);

impl JsonSchema for Rating {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Rating".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "integer", "minimum": -500_000, "maximum": 500_000 })
    }
}

impl TryFrom<i64> for Rating {
    type Error = String;

    fn try_from(value: i64) -> Result<Self, String> {
        match i32::try_from(value) {
            Ok(ppm) if (-500_000..=500_000).contains(&ppm) => Ok(Self(ppm)),
            _ => Err(format!(
                "{value} is not a whole number from -500000 to 500000"
            )),
        }
    }
}

/// A drone by its number or by its office.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "\"master\" or the number of a drone")]
pub enum Victim {
    Office(Office),
    Drone(Whole<0, 99_999>),
}

#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Office {
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
    pub const fn address(self) -> Address {
        match self {
            Self::Radio => Address::Radio,
            Self::Routing => Address::Routing,
            Self::Mission => Address::Mission,
            Self::Navigation => Address::Navigation,
            Self::Msp => Address::Msp,
        }
    }
}

/// A number of more digits is shown with an exponent.
const DIGITS_MAX: usize = 20;

/// A number with bounds in its type; refused, with the bounds, where it is read.
macro_rules! number {
    ($name:ident, $what:literal, $min:literal, $max:literal $(, $after:literal)?) => {
        #[derive(Debug, Clone, Copy, Default, Deserialize)]
        #[serde(try_from = "f64")]
        pub struct $name(pub f64);

        impl TryFrom<f64> for $name {
            type Error = String;

            fn try_from(value: f64) -> Result<Self, String> {
                if ($min..=$max).contains(&value) {
                    return Ok(Self(value));
                }
                let digits = value.to_string();
                let shown = if digits.len() > DIGITS_MAX {
                    format!("{value:e}")
                } else {
                    digits
                };
                let (min, max): (f64, f64) = ($min, $max);
                Err(format!(concat!("{} is not ", $what, " from {} to {}" $(, $after)?), shown, min, max))
            }
        }

        impl JsonSchema for $name {
            fn inline_schema() -> bool {
                true
            }

            fn schema_name() -> Cow<'static, str> {
                stringify!($name).into()
            }

            fn json_schema(_: &mut SchemaGenerator) -> Schema {
                json_schema!({ "type": "number", "minimum": $min, "maximum": $max })
            }
        }
    };
}

number!(Length, "a length", 0.01, 100_000.0);
number!(Offset, "an offset", -100_000.0, 100_000.0);
number!(Height, "a height", 0.0, 100_000.0);
number!(Rate, "a rate", 0.01, 100.0);
number!(Seconds, "a time", 0.001, 604_800.0, " (a week)");
number!(Instant, "a time", 0.0, 604_800.0, " (a week)");
number!(Shape, "a shape", 0.5, 100.0);
number!(Deflection, "a speed", -100.0, 100.0);
number!(Share, "a share", 0.0, 1.0);
number!(Heading, "an angle", -360.0, 360.0);

/// Milliseconds: at least one, at most an hour.
pub type Milliseconds = Whole<1, 3_600_000>;

/// A whole number within bounds.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(try_from = "i64")]
pub struct Whole<const MIN: u64, const MAX: u64>(pub u64);

impl<const MIN: u64, const MAX: u64> TryFrom<i64> for Whole<MIN, MAX> {
    type Error = String;

    fn try_from(value: i64) -> Result<Self, String> {
        match u64::try_from(value) {
            Ok(whole) if (MIN..=MAX).contains(&whole) => Ok(Self(whole)),
            _ => Err(format!("{value} is not a whole number from {MIN} to {MAX}")),
        }
    }
}

impl<const MIN: u64, const MAX: u64> JsonSchema for Whole<MIN, MAX> {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        format!("whole number from {MIN} to {MAX}").into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "integer", "minimum": MIN, "maximum": MAX })
    }
}
