//! What drones need to give way to each other.

use std::time::Duration;

use muster_machines::formation::Separation;
use muster_machines::motion::Landing;
use muster_machines::{navigation, traffic};

use super::Protocol;
use super::limits::controller;
use super::raw::{ProtocolKind, Raw};

/// The parameters of the drones' deconfliction, without landing places.
pub(super) fn avoid(
    raw: &Raw,
    separation: Separation,
    landing: Landing,
    (vehicle, protocol): (&navigation::Config, &Protocol),
) -> traffic::Config {
    let touch_down_s = landing.final_altitude_m / landing.final_mps;
    traffic::Config {
        separation,
        time_to_live: protocol.time_to_live,
        controller_timeout: controller(raw),
        descent_mps: landing.descent_mps,
        speed_mps: vehicle.speed_mps,
        climb_mps: vehicle.climb_mps,
        touch_down_margin: Duration::from_secs_f64(touch_down_s),
        has_followers: *raw.protocol.kind.get_ref() == ProtocolKind::Follow,
        landing_places: None,
    }
}
