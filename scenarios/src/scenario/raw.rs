//! A scenario file's fields as they are written; numbers are checked for themselves here, how they fit each other
//! when they are put together.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Duration;

use muster_machines::cell::Address;
use muster_machines::formation::Exposure;
use muster_machines::geometry::Ned;
use muster_machines::mission::{Alone, Barrier, Liveness, Succession};
use serde::Deserialize;
use toml::Spanned;

use super::{Joins, Occasion, Policy};

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Raw {
    pub(super) seed: Spanned<Whole<0, { i64::MAX as u64 }>>,
    pub(super) formation: Formation,
    #[serde(default)]
    pub(super) changes: Vec<Change>,
    pub(super) mission: Mission,
    #[serde(default)]
    pub(super) relays: Vec<Spanned<Relay>>,
    #[serde(default)]
    pub(super) swarms: Vec<Swarm>,
    pub(super) radio: Radio,
    pub(super) protocol: Protocol,
    pub(super) follow: Option<Spanned<Follow>>,
    #[serde(default)]
    pub(super) vehicle: Vehicle,
    #[serde(default)]
    pub(super) failsafe: Failsafe,
    #[serde(default)]
    pub(super) safety: Safety,
    pub(super) geofence: Option<Spanned<Geofence>>,
    #[serde(default)]
    pub(super) limits: Limits,
    #[serde(default)]
    pub(super) faults: Vec<Spanned<Fault>>,
    #[serde(default)]
    pub(super) chaos: Chaos,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table, `[formation]`")]
pub(super) struct Formation {
    pub(super) kind: FormationKind,
    pub(super) drones: Spanned<Whole<1, 100_000>>,
    pub(super) spacing_m: Spanned<Length>,
    #[serde(default)]
    pub(super) heading_deg: Heading,
    pub(super) gap_m: Option<Spanned<Length>>,
    #[serde(default)]
    pub(super) ground: GroundName,
    pub(super) assignment: Option<Spanned<AssignmentName>>,
    pub(super) clusters: Option<Spanned<Whole<2, 5>>>,
    pub(super) cluster_distance_m: Option<Spanned<Length>>,
    pub(super) seed: Option<Spanned<Whole<0, { i64::MAX as u64 }>>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table, `[[changes]]`")]
pub(super) struct Change {
    pub(super) waypoint: Spanned<Whole<0, 65_534>>,
    pub(super) kind: FormationKind,
    pub(super) spacing_m: Option<Spanned<Length>>,
    pub(super) heading_deg: Option<Heading>,
    pub(super) clusters: Option<Spanned<Whole<2, 5>>>,
    pub(super) cluster_distance_m: Option<Spanned<Length>>,
    pub(super) seed: Option<Spanned<Whole<0, { i64::MAX as u64 }>>>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum FormationKind {
    Linear,
    Circular,
    Random,
    SplitUp,
    CompactMesh,
    RegularMatrix,
    CompactMatrix,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum GroundName {
    #[default]
    Gathered,
    Line,
    Grid,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum AssignmentName {
    Optimal,
    Greedy,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table, `[mission]`")]
pub(super) struct Mission {
    pub(super) file: Spanned<PathBuf>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table, `[[relays]]`")]
pub(super) struct Relay {
    pub(super) north_m: Offset,
    pub(super) east_m: Offset,
    pub(super) altitude_m: Height,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table, `[[swarms]]`")]
pub(super) struct Swarm {
    pub(super) scenario: Spanned<PathBuf>,
    pub(super) north_m: Offset,
    pub(super) east_m: Offset,
    pub(super) after_s: Option<Spanned<Instant>>,
}

impl From<&Swarm> for Joins {
    fn from(swarm: &Swarm) -> Self {
        Self {
            home: Ned::new(swarm.north_m.0, swarm.east_m.0, 0.0),
            after: (swarm.after_s.as_ref())
                .map_or(Duration::ZERO, |it| Duration::from_secs_f64(it.get_ref().0)),
        }
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table, `[radio]`")]
pub(super) struct Radio {
    pub(super) range_m: Length,
    #[serde(default)]
    pub(super) model: ModelName,
    pub(super) nakagami_m: Option<Spanned<Shape>>,
    #[serde(default)]
    pub(super) loss: Share,
    pub(super) burst_every_ms: Option<Spanned<Milliseconds>>,
    pub(super) burst_ms: Option<Spanned<Milliseconds>>,
    pub(super) burst_loss: Option<Spanned<Share>>,
    #[serde(default)]
    pub(super) medium: MediumName,
    pub(super) latency_us: Option<Spanned<Whole<0, 60_000_000>>>,
    pub(super) jitter_us: Option<Whole<0, 60_000_000>>,
    pub(super) queue_max: Option<Spanned<Whole<1, 1_000_000>>>,
}

#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum ModelName {
    #[default]
    Range,
    #[serde(rename = "80211a")]
    Ieee80211a,
    Nakagami,
}

#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum MediumName {
    #[default]
    Ideal,
    Csma,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table, `[protocol]`")]
pub(super) struct Protocol {
    #[serde(default)]
    pub(super) kind: ProtocolKind,
    pub(super) policy: Spanned<PolicyName>,
    pub(super) barrier: Option<Spanned<BarrierName>>,
    #[serde(default)]
    pub(super) liveness: LivenessName,
    #[serde(default)]
    pub(super) succession: SuccessionName,
    #[serde(default)]
    pub(super) parameters: ParametersName,
    pub(super) period_ms: Option<Milliseconds>,
    pub(super) keep_alive_ms: Option<Milliseconds>,
    pub(super) hello_period_ms: Option<Milliseconds>,
    pub(super) hello_gap_ms: Option<Spanned<Milliseconds>>,
    pub(super) discovery_ms: Option<Milliseconds>,
    pub(super) stable_after: Option<Whole<1, 1_000>>,
    pub(super) time_to_live_ms: Option<Spanned<Milliseconds>>,
    pub(super) beacon_ms: Option<Milliseconds>,
    pub(super) repair_ms: Option<Milliseconds>,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum ProtocolKind {
    #[default]
    Muscop,
    Follow,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table, `[follow]`")]
pub(super) struct Follow {
    pub(super) period_ms: Option<Spanned<Whole<1, 1_000>>>,
    pub(super) hold_ms: Option<Spanned<Whole<1, 5_000>>>,
    pub(super) speed_mps: Option<Spanned<Rate>>,
    pub(super) acceleration_mps2: Option<Spanned<Rate>>,
    #[serde(default)]
    pub(super) pilot: Vec<Sticks>,
    pub(super) land_after_s: Option<Spanned<Instant>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table, `[[follow.pilot]]`")]
pub(super) struct Sticks {
    pub(super) after_s: Spanned<Instant>,
    #[serde(default)]
    pub(super) north_mps: Deflection,
    #[serde(default)]
    pub(super) east_mps: Deflection,
    #[serde(default)]
    pub(super) climb_mps: Deflection,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum PolicyName {
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

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum BarrierName {
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

#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum SuccessionName {
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

#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum LivenessName {
    #[default]
    Pulse,
    Thesis,
}

impl From<LivenessName> for Liveness {
    fn from(name: LivenessName) -> Self {
        match name {
            LivenessName::Pulse => Self::Pulse,
            LivenessName::Thesis => Self::Thesis,
        }
    }
}

#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum ParametersName {
    #[default]
    Quiet,
    Fast,
    Lan,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table, `[vehicle]`")]
pub(super) struct Vehicle {
    pub(super) speed_mps: Option<Rate>,
    pub(super) acceleration_mps2: Option<Rate>,
    pub(super) climb_mps: Option<Rate>,
    pub(super) descent_mps: Option<Rate>,
    pub(super) landing_mps: Option<Rate>,
    pub(super) landing_altitude_m: Option<Height>,
    pub(super) settle_ms: Option<Whole<0, 60_000>>,
    pub(super) endurance_s: Option<Seconds>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table, `[failsafe]`")]
pub(super) struct Failsafe {
    #[serde(default)]
    pub(super) alone: AloneName,
    pub(super) position_hold_s: Option<Instant>,
    pub(super) battery_low: Option<Spanned<Share>>,
    pub(super) battery_critical: Option<Spanned<Share>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table, `[safety]`")]
pub(super) struct Safety {
    #[serde(default)]
    pub(super) avoid: bool,
}

#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum AloneName {
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

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table, `[geofence]`")]
pub(super) struct Geofence {
    pub(super) radius_m: Length,
    pub(super) altitude_max_m: Option<Length>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table, `[limits]`")]
pub(super) struct Limits {
    pub(super) separation_horizontal_m: Option<Length>,
    pub(super) separation_vertical_m: Option<Length>,
    pub(super) altitude_max_m: Option<Spanned<Length>>,
    pub(super) duration_s: Option<Seconds>,
    pub(super) set_up_s: Option<Seconds>,
    pub(super) take_off_s: Option<Seconds>,
    pub(super) leg_s: Option<Seconds>,
    pub(super) flight_time_s: Option<Seconds>,
    pub(super) waiting_max: Option<Whole<8, 1_000_000>>,
    pub(super) restarts_max: Option<Whole<0, 1_000_000>>,
    pub(super) hang_ms: Option<Milliseconds>,
    pub(super) watchdog_ms: Option<Milliseconds>,
    pub(super) controller_s: Option<Seconds>,
    pub(super) restart_window_s: Option<Seconds>,
    pub(super) accept: Option<Spanned<Vec<ExposureName>>>,
}

/// What a single fault may expose drones to.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum ExposureName {
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

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table, `[[faults]]`")]
pub(super) struct Fault {
    pub(super) at_s: Option<Instant>,
    pub(super) at_waypoint: Option<Spanned<Whole<0, 65_534>>>,
    pub(super) when: Option<OccasionName>,
    pub(super) after_s: Option<Spanned<Instant>>,
    pub(super) for_s: Option<Spanned<Seconds>>,
    pub(super) times: Option<Spanned<Whole<1, 100_000>>>,
    pub(super) every_s: Option<Spanned<Seconds>>,
    pub(super) crash: Option<Spanned<Victim>>,
    pub(super) actor: Option<Spanned<ActorName>>,
    pub(super) hang: Option<Spanned<Victim>>,
    pub(super) restart: Option<Spanned<Victim>>,
    pub(super) kill: Option<Spanned<Victim>>,
    pub(super) crash_aircraft: Option<Spanned<Victim>>,
    pub(super) lose_gps: Option<Spanned<Victim>>,
    pub(super) drain: Option<Spanned<Victim>>,
    pub(super) to: Option<Spanned<Share>>,
    pub(super) cut: Option<Spanned<Pair>>,
    pub(super) one_way: Option<Spanned<Pair>>,
    pub(super) degrade: Option<Spanned<Pair>>,
    pub(super) loss: Option<Spanned<Share>>,
    pub(super) heal: Option<Spanned<Pair>>,
    pub(super) jam: Option<Disc>,
    pub(super) corrupt: Option<Spanned<Sender>>,
    pub(super) duplicate: Option<Spanned<Sender>>,
    pub(super) delay: Option<Spanned<Sender>>,
    pub(super) reorder: Option<Spanned<Sender>>,
    pub(super) share: Option<Spanned<Share>>,
    pub(super) by_ms: Option<Spanned<Milliseconds>>,
    pub(super) replay: Option<Spanned<Victim>>,
    pub(super) forge: Option<Spanned<Victim>>,
    pub(super) skew: Option<Spanned<Victim>>,
    pub(super) ppm: Option<Spanned<Rating>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table, `[chaos]`")]
pub(super) struct Chaos {
    pub(super) faults_max: Option<Whole<1, 100>>,
    #[serde(default)]
    pub(super) vary: BTreeMap<String, Spanned<Vec<toml::Value>>>,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum OccasionName {
    TakingOff,
    Elected,
    Settled,
    Landing,
}

impl From<OccasionName> for Occasion {
    fn from(name: OccasionName) -> Self {
        match name {
            OccasionName::TakingOff => Self::TakingOff,
            OccasionName::Elected => Self::Elected,
            OccasionName::Settled => Self::Settled,
            OccasionName::Landing => Self::Landing,
        }
    }
}

/// Two drones, or two groups of them.
#[derive(Debug, Deserialize)]
#[serde(
    untagged,
    expecting = "two drones or groups of drones, as in `[2, 3]` or `[[0, 1, 2], [3, 4]]`"
)]
pub(super) enum Pair {
    Drones([Whole<0, 99_999>; 2]),
    Groups([Vec<Whole<0, 99_999>>; 2]),
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Disc {
    pub(super) north_m: Offset,
    pub(super) east_m: Offset,
    pub(super) radius_m: Length,
}

/// Whose frames: those of a drone, or all.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(untagged, expecting = "\"all\" or the number of a drone")]
pub(super) enum Sender {
    All(All),
    Drone(Whole<0, 99_999>),
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum All {
    All,
}

/// How much a clock gains.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(try_from = "i64")]
pub(super) struct Rating(pub(super) i32);

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
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(untagged, expecting = "\"master\" or the number of a drone")]
pub(super) enum Victim {
    Office(Office),
    Drone(Whole<0, 99_999>),
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Office {
    Master,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum ActorName {
    Radio,
    Routing,
    Mission,
    Navigation,
    Msp,
}

impl ActorName {
    pub(super) const fn address(self) -> Address {
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
    ($(#[$doc:meta])* $name:ident, $is:expr, $accepted:literal) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, Default, Deserialize)]
        #[serde(try_from = "f64")]
        pub(super) struct $name(pub(super) f64);

        impl TryFrom<f64> for $name {
            type Error = String;

            fn try_from(value: f64) -> Result<Self, String> {
                let is_accepted: fn(f64) -> bool = $is;
                if is_accepted(value) {
                    Ok(Self(value))
                } else {
                    let digits = value.to_string();
                    let shown = if digits.len() > DIGITS_MAX {
                        format!("{value:e}")
                    } else {
                        digits
                    };
                    Err(format!("{shown} is not {}", $accepted))
                }
            }
        }
    };
}

number!(
    Length,
    |v| (0.01..=100_000.0).contains(&v),
    "a length from 0.01 to 100000"
);
number!(
    Offset,
    |v| (-100_000.0..=100_000.0).contains(&v),
    "an offset from -100000 to 100000"
);
number!(
    Height,
    |v| (0.0..=100_000.0).contains(&v),
    "a height from 0 to 100000"
);
number!(
    Rate,
    |v| (0.01..=100.0).contains(&v),
    "a rate from 0.01 to 100"
);
number!(
    Seconds,
    |v| (0.001..=604_800.0).contains(&v),
    "a time from 0.001 to 604800 (a week)"
);
number!(
    Instant,
    |v| (0.0..=604_800.0).contains(&v),
    "a time from 0 to 604800 (a week)"
);
number!(
    Shape,
    |v| (0.5..=100.0).contains(&v),
    "a shape from 0.5 to 100"
);
number!(
    Deflection,
    |v| (-100.0..=100.0).contains(&v),
    "a speed from -100 to 100"
);
number!(Share, |v| (0.0..=1.0).contains(&v), "a share from 0 to 1");
number!(
    Heading,
    |v| (-360.0..=360.0).contains(&v),
    "an angle from -360 to 360"
);

/// Milliseconds: at least one, at most an hour.
pub(super) type Milliseconds = Whole<1, 3_600_000>;

/// A whole number within bounds.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(try_from = "i64")]
pub(super) struct Whole<const MIN: u64, const MAX: u64>(pub(super) u64);

impl<const MIN: u64, const MAX: u64> TryFrom<i64> for Whole<MIN, MAX> {
    type Error = String;

    fn try_from(value: i64) -> Result<Self, String> {
        match u64::try_from(value) {
            Ok(whole) if (MIN..=MAX).contains(&whole) => Ok(Self(whole)),
            _ => Err(format!("{value} is not a whole number from {MIN} to {MAX}")),
        }
    }
}
