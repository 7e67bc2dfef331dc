//! Limits: what must not be exceeded, and what is accepted.

use schemars::JsonSchema;
use serde::Deserialize;

use super::{ExposureName, Length, Milliseconds, Seconds, Whole};
use crate::schema::{Located, Or};

/// Limits of the flight and of supervision.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[limits]`")]
pub struct Limits {
    /// Least distance between two flying drones over ground, unless they are `separation_vertical_m` apart.
    #[serde(default)]
    pub separation_horizontal_m: Or<Length, 5>,
    /// Least distance between two flying drones in height, unless they are `separation_horizontal_m` apart.
    #[serde(default)]
    pub separation_vertical_m: Or<Length, 5>,
    /// Greatest height above home, altitude layers included. The default is the limit of the EU's open category (2019/947).
    #[serde(default)]
    pub altitude_max_m: Or<Length, 120>,
    /// Time by which every drone is down, from the start of the run. A longer run breaks rule 5.
    #[schemars(extend(
        "x-default" = "`set_up_s` + `flight_time_s` + two legs + the highest descent"
    ))]
    pub duration_s: Option<Seconds>,
    /// How long the master waits on the ground for drones that do not answer.
    #[serde(default)]
    pub set_up_s: Or<Seconds, 30>,
    /// How long a drone may take to its slot; the swarm flies without one that takes longer.
    #[schemars(extend("x-default" = "twice the longest path + 60"))]
    pub take_off_s: Option<Seconds>,
    /// How long a leg may take; a drone that takes longer lands.
    #[schemars(extend("x-default" = "twice the longest leg + 60"))]
    pub leg_s: Option<Seconds>,
    /// How long a drone may fly; then it goes to land as with a low battery.
    #[schemars(extend("x-default" = "`take_off_s` + twice the planned flight"))]
    pub flight_time_s: Option<Seconds>,
    /// Most messages that wait for an actor.
    #[serde(default)]
    pub waiting_max: Or<Whole<8, 1_000_000>, 64>,
    /// Most restarts of one actor within `restart_window_s`, except `msp`; after more the drone lands.
    #[serde(default)]
    pub restarts_max: Or<Whole<0, 1_000_000>, 5>,
    /// Most restarts of the actor `msp` within `restart_window_s`; after more the drone lands. It restarts at once: sticks are
    /// repeated meanwhile.
    #[serde(default)]
    pub msp_restarts_max: Or<Whole<0, 1_000_000>, 100>,
    /// Hang after which a supervisor restarts an actor.
    #[serde(default)]
    pub hang_ms: Or<Milliseconds, 1_000>,
    /// Watchdog timeout: hang after which the service manager restarts a drone's process.
    #[serde(default)]
    pub watchdog_ms: Or<Milliseconds, 3_000>,
    /// How long a flight controller waits for a drone's process before it brings the aircraft down; ArduPilot's
    /// `FS_GCS_TIMEOUT`.
    #[serde(default)]
    pub controller_s: Or<Seconds, 5>,
    /// How long a restart counts.
    #[serde(default)]
    pub restart_window_s: Or<Seconds, 30>,
    /// Accepted exposures: what may bring two drones too near each other. A plan exposed to anything else is refused, except to
    /// `late` if `safety.avoid` is on and drones don't follow their master. `muster chaos` goes on where two drones come too close
    /// in one of these.
    #[schemars(extend("x-default" = "all but `out-of-reach`; exposures are printed, not refused"))]
    pub accept: Option<Located<Vec<ExposureName>>>,
}

impl Limits {
    /// Whether the file lists this exposure in `accept`.
    pub fn accepts(&self, exposure: impl Into<ExposureName>) -> bool {
        let name = exposure.into();
        let names = self.accept.iter().flat_map(|it| it.get_ref());
        names.into_iter().any(|it| *it == name)
    }
}
