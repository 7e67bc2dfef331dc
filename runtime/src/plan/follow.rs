use std::time::Duration;

use crate::diagnostic::BadInput;
use muster_machines::geometry::Velocity;
use muster_machines::mission::Following;
use muster_machines::navigation;
use toml::Spanned;

use super::file::Source;
use super::raw::{self, ProtocolKind, Raw};
use super::{Follow, Sticks};
use crate::text::{rounded_down, rounded_up};

/// How often a master tells where it is: 5 Hz.
const PERIOD_MS: u64 = 200;
/// For how long the others go on without being told: five such periods.
const HOLD_MS: u64 = 1_000;
/// What share of its speed and of its acceleration a master uses, so that the others can catch up.
const SPEED_SHARE: f64 = 0.8;
const ACCELERATION_SHARE: f64 = 0.5;

/// Between which heights a pilot may fly, in metres above home.
#[derive(Debug, Clone, Copy)]
pub(super) struct Heights {
    /// Where it takes over.
    pub(super) begin_m: f64,
    /// The highest, so that those who fly above their slots to land are within the limit, too.
    pub(super) highest_m: f64,
}

/// How the master is followed, if the protocol says that it is.
pub(super) fn follow(
    source: &Source,
    raw: &Raw,
    vehicle: &navigation::Config,
    heights_m: Heights,
) -> Result<Option<Follow>, BadInput> {
    let unset = raw::Follow::default();
    let fields = match (&raw.follow, raw.protocol.kind) {
        (Some(table), ProtocolKind::Muscop) => {
            let message = "only the protocol \"follow\" has a table `[follow]`";
            return Err(source.error(table.span(), message));
        }
        (None, ProtocolKind::Muscop) => return Ok(None),
        (Some(table), ProtocolKind::Follow) => table.get_ref(),
        (None, ProtocolKind::Follow) => &unset,
    };
    let period_ms = fields.period_ms.as_ref();
    let place = || period_ms.map_or_else(|| raw.protocol.policy.span(), Spanned::span);
    let period = Duration::from_millis(period_ms.map_or(PERIOD_MS, |it| it.get_ref().0));
    let hold_ms = fields.hold_ms.as_ref();
    let hold = Duration::from_millis(hold_ms.map_or(HOLD_MS, |it| it.get_ref().0));
    if hold <= period {
        let message = format!(
            "every drone would stop between two orders: the hold, {} ms, is not above the period, {} ms",
            hold.as_millis(),
            period.as_millis()
        );
        let span = hold_ms.map_or_else(place, Spanned::span);
        return Err(source.error(span, &message));
    }
    let master = navigation::Config {
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
    };
    let pilot = pilot(source, fields, vehicle)?;
    let land_after = match (&fields.land_after_s, pilot.last()) {
        (None, None) => None,
        (Some(land), None) => {
            let message = "without a pilot the flight ends with the mission";
            return Err(source.error(land.span(), message));
        }
        (None, Some(_)) => {
            let span = raw.follow.as_ref().map_or_else(place, Spanned::span);
            return Err(source.error(span, "missing field `land_after_s`"));
        }
        (Some(land), Some(last)) => {
            let after = Duration::from_secs_f64(land.get_ref().0);
            check_heights(source, fields, master.acceleration_mps2, heights_m, after)?;
            if after < last.after {
                let message = "the flight would end before the pilot has done all that is listed";
                return Err(source.error(land.span(), message));
            }
            Some(after)
        }
    };
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

/// A pilot's climbs and descents keep the swarm above the ground and below the limit, up to when it lands.
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
        // What it takes to stop.
        let reached_m = height_m + climb_mps * climb_mps.abs() / (2.0 * acceleration_mps2);
        if !(0.0..=heights.highest_m).contains(&reached_m) {
            let reached = if reached_m < 0.0 {
                rounded_down(reached_m, 1)
            } else {
                rounded_up(reached_m, 1)
            };
            let highest = rounded_down(heights.highest_m, 1);
            let message = format!(
                "the pilot would get to {reached} m from here on; that takes from 0 to {highest} m"
            );
            return Err(source.error(sticks.after_s.span(), &message));
        }
    }
    Ok(())
}

fn at_most(
    source: &Source,
    asked: Option<&Spanned<raw::Rate>>,
    most: f64,
    share: f64,
) -> Result<f64, BadInput> {
    match asked {
        None => Ok(most * share),
        Some(asked) if asked.get_ref().0 <= most => Ok(asked.get_ref().0),
        Some(asked) => {
            let message = format!("nobody could keep up: the others' is {most}");
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
            return refuse("the entry before this one is later");
        }
        let (north, east, climb) = (sticks.north_mps.0, sticks.east_mps.0, sticks.climb_mps.0);
        let velocity = Velocity::new(north, east, -climb);
        if velocity.0.xy().norm() > vehicle.speed_mps {
            let most = vehicle.speed_mps;
            return refuse(&format!("the vehicle flies at up to {most} m/s"));
        }
        if climb > vehicle.climb_mps || -climb > vehicle.descent_mps {
            return refuse(&format!(
                "the vehicle climbs at up to {} m/s and descends at up to {} m/s",
                vehicle.climb_mps, vehicle.descent_mps
            ));
        }
        pilot.push(Sticks { after, velocity });
    }
    Ok(pilot)
}
