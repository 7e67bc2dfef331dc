use std::time::Duration;

use muster_machines::formation::{Change, Layout};
use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;
use muster_machines::navigation::{Failsafe, Fence};
use muster_runtime::diagnostic::BadInput;
use toml::Spanned;

use super::file::Source;
use super::raw::Raw;
use crate::report::rounded_down;

/// How long a drone holds that does not know where it is: as long as a swarm some 300 m deep takes to pass it.
const POSITION_HOLD_S: f64 = 30.0;
/// PX4's defaults of `BAT_LOW_THR` and `BAT_CRIT_THR`.
const BATTERY_LOW: f64 = 0.15;
const BATTERY_CRITICAL: f64 = 0.07;

/// From when on a drone can't go on; the fence is `fence`.
pub(super) fn failsafe(
    source: &Source,
    raw: &Raw,
    fence: Option<Fence>,
) -> Result<Failsafe, BadInput> {
    let fields = &raw.failsafe;
    let (low, critical) = (
        fields.battery_low.as_ref(),
        fields.battery_critical.as_ref(),
    );
    let battery_low = low.map_or(BATTERY_LOW, |it| it.get_ref().0);
    let battery_critical = critical.map_or(BATTERY_CRITICAL, |it| it.get_ref().0);
    if battery_critical >= battery_low
        && let Some(span) = critical.or(low).map(Spanned::span)
    {
        let message = format!(
            "a battery is critical, at {battery_critical}, only when it is emptier than low, at {battery_low}"
        );
        return Err(source.error(span, &message));
    }
    let hold_s = fields.position_hold_s.map_or(POSITION_HOLD_S, |it| it.0);
    Ok(Failsafe {
        position_hold: Duration::from_secs_f64(hold_s),
        battery_low,
        battery_critical,
        fence,
    })
}

/// Where drones may fly, if the file says so.
pub(super) fn fence(raw: &Raw, altitude_max_m: f64) -> Option<Fence> {
    let fields = raw.geofence.as_ref()?.get_ref();
    Some(Fence {
        radius_m: fields.radius_m.0,
        altitude_max_m: fields.altitude_max_m.map_or(altitude_max_m, |it| it.0),
    })
}

/// Refuses a mission with a slot that is not so far within the fence that drones can fly there at `speed_mps`.
pub(super) fn check_fence(
    source: &Source,
    raw: &Raw,
    fence: Option<Fence>,
    (layout, changes, waypoints): (&Layout, &[Change], &[Ned]),
    speed_mps: f64,
) -> Result<(), BadInput> {
    let (Some(fence), Some(table)) = (fence, &raw.geofence) else {
        return Ok(());
    };
    let margin_m = Fence::margin_m(speed_mps);
    let altitudes_m = waypoints.iter().map(|it| it.altitude_m());
    let highest_m = altitudes_m.fold(f64::NEG_INFINITY, f64::max);
    for (number, waypoint) in (0_u16..).zip(waypoints) {
        let flown = changes.iter().filter(|it| it.waypoint() < number).last();
        let made = changes.iter().filter(|it| it.waypoint() == number);
        let layouts = std::iter::once(flown.map_or(layout, Change::layout));
        for layout in layouts.chain(made.map(Change::layout)) {
            let altitude_m = highest_m + layout.highest_layer_m(waypoints);
            let slots = (0..layout.formation().drones()).map(NodeId).map(|id| {
                let slot = layout.slot(id, *waypoint);
                (id, slot.at_altitude(altitude_m))
            });
            let room = |(id, slot): (NodeId, Ned)| (fence.room_m(slot), id);
            let least = slots.map(room).min_by(|a, b| a.0.total_cmp(&b.0));
            if let Some((room_m, id)) = least.filter(|(room_m, _)| *room_m <= margin_m) {
                let message = format!(
                    "at waypoint {number} the slot of drone {id}, its layers included, is {} m within the fence; at \
                     {speed_mps} m/s that takes more than {margin_m} m",
                    rounded_down(room_m, 1)
                );
                return Err(source.error(table.span(), &message));
            }
        }
    }
    Ok(())
}
