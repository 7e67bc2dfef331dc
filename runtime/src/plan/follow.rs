use std::ops::Range;
use std::time::Duration;

use crate::diagnostic::BadInput;
use muster_machines::geometry::Velocity;
use muster_machines::mission::Following;
use muster_machines::navigation;

use super::file::Source;
use super::raw::{self, ProtocolKind, Raw};
use super::{Follow, Sticks};
use crate::schema::Located;
use crate::text::{rounded_down, rounded_up};

/// Default share of its speed and acceleration that a master uses, so that the others can catch up.
const SPEED_SHARE: f64 = 0.8;
const ACCELERATION_SHARE: f64 = 0.5;

/// Heights that a pilot may fly at, in metres above home.
#[derive(Debug, Clone, Copy)]
pub(super) struct Heights {
    /// Height at which the pilot takes over.
    pub(super) begin_m: f64,
    /// The highest. Leaves room below the altitude limit for the layers of the landing.
    pub(super) highest_m: f64,
}

/// Parameters of the protocol "follow". `None` with another protocol.
pub(super) fn follow(
    source: &Source,
    raw: &Raw,
    vehicle: &navigation::Config,
    heights_m: Heights,
) -> Result<Option<Follow>, BadInput> {
    let unset = raw::Follow::default();
    let fields = match (&raw.follow, raw.protocol.kind.get_ref()) {
        (Some(table), ProtocolKind::Muscop | ProtocolKind::Agent) => {
            let message = "the table `[follow]` needs the protocol \"follow\"";
            return Err(source.error(table.span(), message));
        }
        (None, ProtocolKind::Muscop | ProtocolKind::Agent) => return Ok(None),
        (Some(table), ProtocolKind::Follow) => table.get_ref(),
        (None, ProtocolKind::Follow) => &unset,
    };
    let place = || {
        let span = fields.period_ms.span();
        span.unwrap_or_else(|| raw.protocol.policy.span())
    };
    let period = Duration::from_millis(fields.period_ms.0);
    let hold = Duration::from_millis(fields.hold_ms.0);
    if hold <= period {
        let message = format!(
            "the hold, {} ms, must be longer than the period, {} ms; else drones stop between two orders",
            hold.as_millis(),
            period.as_millis()
        );
        let span = fields.hold_ms.span().unwrap_or_else(place);
        return Err(source.error(span, &message));
    }
    let master = master(source, fields, vehicle)?;
    let pilot = pilot(source, fields, vehicle)?;
    let table_span = || raw.follow.as_ref().map_or_else(place, |it| it.span());
    let land_after = land_after(source, fields, pilot.last(), table_span)?;
    if let Some(after) = land_after {
        check_heights(source, fields, master.acceleration_mps2, heights_m, after)?;
    }
    let following = Following {
        period,
        hold,
        is_piloted: !pilot.is_empty(),
    };
    Ok(Some(Follow {
        following,
        master,
        pilot,
        land_after,
    }))
}

/// The master's parameters, within the limits of the other drones.
fn master(
    source: &Source,
    fields: &raw::Follow,
    vehicle: &navigation::Config,
) -> Result<navigation::Config, BadInput> {
    Ok(navigation::Config {
        speed_mps: at_most(
            source,
            fields.speed_mps.as_ref(),
            vehicle.speed_mps,
            SPEED_SHARE,
        )?,
        acceleration_mps2: at_most(
            source,
            fields.acceleration_mps2.as_ref(),
            vehicle.acceleration_mps2,
            ACCELERATION_SHARE,
        )?,
        ..vehicle.clone()
    })
}

/// When the operator ends the flight, which a flight with a pilot needs and one without does not have.
fn land_after(
    source: &Source,
    fields: &raw::Follow,
    last_input: Option<&Sticks>,
    table_span: impl FnOnce() -> Range<usize>,
) -> Result<Option<Duration>, BadInput> {
    match (&fields.land_after_s, last_input) {
        (None, None) => Ok(None),
        (Some(land), None) => {
            let message =
                "`land_after_s` needs a pilot; without one the flight ends with the mission";
            Err(source.error(land.span(), message))
        }
        (None, Some(_)) => Err(source.error(table_span(), "missing field `land_after_s`")),
        (Some(land), Some(last)) => {
            let after = Duration::from_secs_f64(land.get_ref().0);
            if after < last.after {
                let message = "the flight ends before the pilot's last input";
                return Err(source.error(land.span(), message));
            }
            Ok(Some(after))
        }
    }
}

/// Refuses a pilot's inputs that lead the swarm to the ground or above the limit before it lands.
fn check_heights(
    source: &Source,
    fields: &raw::Follow,
    acceleration_mps2: f64,
    heights: Heights,
    land_after: Duration,
) -> Result<(), BadInput> {
    let mut height_m = heights.begin_m;
    for (index, sticks) in fields.pilot.iter().enumerate() {
        let next = fields.pilot.get(index + 1);
        let until_s = next.map_or(land_after.as_secs_f64(), |next| next.after_s.get_ref().0);
        let climb_mps = sticks.climb_mps.0;
        height_m += climb_mps * (until_s - sticks.after_s.get_ref().0).max(0.0);
        // With the distance to stop.
        let reached_m = height_m + climb_mps * climb_mps.abs() / (2.0 * acceleration_mps2);
        if !(0.0..=heights.highest_m).contains(&reached_m) {
            let reached = if reached_m < 0.0 {
                rounded_down(reached_m, 1)
            } else {
                rounded_up(reached_m, 1)
            };
            let highest = rounded_down(heights.highest_m, 1);
            let message = format!(
                "the pilot reaches {reached} m above home from this input on; accepted are 0 to {highest} m"
            );
            return Err(source.error(sticks.after_s.span(), &message));
        }
    }
    Ok(())
}

fn at_most(
    source: &Source,
    asked: Option<&Located<raw::Rate>>,
    most: f64,
    share: f64,
) -> Result<f64, BadInput> {
    match asked {
        None => Ok(most * share),
        Some(asked) if asked.get_ref().0 <= most => Ok(asked.get_ref().0),
        Some(asked) => {
            let message = format!("the master must not exceed the other drones' limit, {most}");
            Err(source.error(asked.span(), &message))
        }
    }
}

fn pilot(
    source: &Source,
    fields: &raw::Follow,
    vehicle: &navigation::Config,
) -> Result<Vec<Sticks>, BadInput> {
    let mut pilot: Vec<Sticks> = Vec::new();
    for sticks in &fields.pilot {
        let refuse = |message: &str| Err(source.error(sticks.after_s.span(), message));
        let after = Duration::from_secs_f64(sticks.after_s.get_ref().0);
        if pilot.last().is_some_and(|before| after < before.after) {
            return refuse("the entry before this one has a later time");
        }
        let (north, east, climb) = (sticks.north_mps.0, sticks.east_mps.0, sticks.climb_mps.0);
        let velocity = Velocity::new(north, east, -climb);
        if velocity.0.xy().norm() > vehicle.speed_mps {
            let most = vehicle.speed_mps;
            return refuse(&format!("the vehicle's highest speed is {most} m/s"));
        }
        if climb > vehicle.climb_mps || -climb > vehicle.descent_mps {
            return refuse(&format!(
                "the vehicle climbs at most at {} m/s and descends at most at {} m/s",
                vehicle.climb_mps, vehicle.descent_mps
            ));
        }
        pilot.push(Sticks { after, velocity });
    }
    Ok(pilot)
}
