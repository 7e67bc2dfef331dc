use std::sync::Arc;
use std::time::Duration;

use crate::diagnostic::BadInput;
use muster_machines::navigation::{Failsafe, Fence};

use super::file::Source;
use super::raw::Raw;

/// Conditions under which a drone leaves the mission.
pub(super) fn failsafe(
    source: &Source,
    raw: &Raw,
    fence: Option<Arc<Fence>>,
) -> Result<Failsafe, BadInput> {
    let fields = &raw.failsafe;
    let (low, critical) = (&fields.battery_low, &fields.battery_critical);
    let (battery_low, battery_critical) = (low.0, critical.0);
    if battery_critical >= battery_low
        && let Some(span) = critical.span().or(low.span())
    {
        let message = format!(
            "the critical battery charge, {battery_critical}, must be below the low one, {battery_low}"
        );
        return Err(source.error(span, &message));
    }
    Ok(Failsafe {
        position_hold: Duration::from_secs_f64(fields.position_hold_s.0),
        battery_low,
        battery_critical,
        fence,
    })
}
