use std::sync::Arc;
use std::time::Duration;

use crate::diagnostic::BadInput;
use muster_machines::navigation::{Failsafe, Fence};
use toml::Spanned;

use super::file::Source;
use super::raw::Raw;

/// How long a drone holds that does not know where it is: as long as a swarm some 300 m deep takes to pass it.
const POSITION_HOLD_S: f64 = 30.0;
/// PX4's defaults of `BAT_LOW_THR` and `BAT_CRIT_THR`.
const BATTERY_LOW: f64 = 0.15;
const BATTERY_CRITICAL: f64 = 0.07;

/// From when on a drone can't go on; the fence is `fence`.
pub(super) fn failsafe(
    source: &Source,
    raw: &Raw,
    fence: Option<Arc<Fence>>,
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
