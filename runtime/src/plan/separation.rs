//! Checks of a plan against the minimum separation of drones, and descriptions of where drones come close.

use muster_machines::formation::{
    ClosestApproach, Exposure, FlightPlan, Layering, PhaseKind, Unreached,
};

use super::file::Source;
use super::raw::{ExposureName, ProtocolKind, Raw, SuccessionName};
use crate::diagnostic::BadInput;
use crate::text::{drones, figure, rounded_down};

/// Why any two drones of some swarms are exposed to `apart`.
pub const APART_OFF_THE_LINES: &str = "drones that lose their master follow another, off the lines of the mission and at the altitude of the others";

/// Whether any two drones are exposed to `apart`: they follow their master or elect another, and share altitude layers.
#[must_use]
pub fn exposes_all_apart(follows_and_elects: bool, layering: Layering) -> bool {
    follows_and_elects && layering == Layering::Shared
}

/// Refuses a plan in which drones in lockstep violate the separation. With `limits.accept`, also refuses one in which a
/// single fault that it does not list can lead to a violation.
pub(super) fn check_separation(
    source: &Source,
    raw: &Raw,
    flight: FlightPlan<'_>,
) -> Result<(), BadInput> {
    let conflicts = flight.in_lockstep().find_map(|exposed| {
        let has_conflicts = !exposed.lockstep.conflicts.is_empty();
        has_conflicts.then_some((exposed.phase.kind, exposed.lockstep.closest?))
    });
    if let Some((kind, closest)) = conflicts {
        let message = format!(
            "in lockstep {} come too close {}: {}; give a larger `formation.spacing_m` or, for the ground, \
             `formation.gap_m`",
            drones(&closest.drones.map(|id| id.0)),
            describe_phase(kind),
            describe_clearance(&closest)
        );
        return Err(source.error(raw.formation.spacing_m.span(), &message));
    }
    let Some(accepted) = &raw.limits.accept else {
        return Ok(());
    };
    let follows = *raw.protocol.kind.get_ref() == ProtocolKind::Follow;
    let elects = matches!(raw.protocol.succession, SuccessionName::Elect);
    if !raw.limits.accepts(Exposure::Apart)
        && exposes_all_apart(follows && elects, flight.layout.layering())
    {
        let message = format!(
            "{APART_OFF_THE_LINES}; add \"{}\" to `limits.accept`",
            Exposure::Apart.name()
        );
        return Err(source.error(accepted.span(), &message));
    }
    // A drone that follows its master gives way to nobody.
    let gives_way = raw.safety.avoid && !follows;
    let is_accepted = |exposure: Exposure| {
        raw.limits.accepts(exposure) || gives_way && exposure.is_resolved_by_right_of_way()
    };
    if Exposure::ALL.into_iter().all(is_accepted) {
        return Ok(());
    }
    let found = flight
        .phases()
        .zip(flight.exposures())
        .find_map(|(phase, of)| {
            let of = of
                .into_iter()
                .filter(|(exposure, _)| !is_accepted(*exposure));
            let mut of = of.filter(|(_, nearness)| !nearness.conflicts.is_empty());
            let (exposure, nearness) = of.next()?;
            Some((phase.kind, exposure, nearness.closest?))
        });
    let Some((kind, exposure, closest)) = found else {
        return Ok(());
    };
    let avoid = if !follows && exposure.is_resolved_by_right_of_way() {
        ", or set `safety.avoid = true`, so that drones give way to each other"
    } else {
        ""
    };
    let [affected, other] = closest.drones;
    let message = format!(
        "a drone that {} may come too close to another: drone {affected} comes within {} of drone {other} {}{}; add \"{}\" \
         to `limits.accept`{avoid}",
        describe_exposure(exposure),
        describe_clearance(&closest),
        describe_phase(kind),
        describe_other(exposure),
        exposure.name(),
    );
    Err(source.error(accepted.span(), &message))
}

/// Whether a plan in which drones are out of the master's reach is refused: they would follow a master of their own in layers
/// that they share with the others, and drones that hear nothing of each other can't give way. `limits.accept` may list
/// `out-of-reach`.
#[must_use]
pub fn refuses_unreached(raw: &Raw, layering: Layering) -> bool {
    let elects = matches!(raw.protocol.succession, SuccessionName::Elect) && raw.agent.is_none();
    elects && layering == Layering::Shared && !raw.limits.accepts(ExposureName::OutOfReach)
}

/// The error of a plan that is refused since these drones are out of the master's reach. `when` says when and for how long, if it
/// is not for good.
#[must_use]
pub fn unreached_error((source, raw): (&Source, &Raw), apart: &[u32], when: &str) -> BadInput {
    let message = format!(
        "{} can't reach the master{when}, not even over other drones. They would follow a master of their own, and there is no \
         room for one altitude layer per drone below the ceiling and within the range: they may come too near the others. Raise \
         `radio.range_m` or lower `formation.spacing_m` so that they can, raise `limits.altitude_max_m`, set \
         `protocol.succession = \"land\"`, or list \"out-of-reach\" in `limits.accept`",
        drones(apart),
    );
    let span = raw.limits.altitude_max_m.span();
    let span = span.unwrap_or_else(|| raw.formation.spacing_m.span());
    source.error(span, &message)
}

/// Drones that are out of the master's reach in a phase, and for how long: " for 12 s while all take off".
#[must_use]
pub fn describe_unreached(unreached: &Unreached) -> (Vec<u32>, String) {
    let ids = unreached.drones.iter().map(|(id, _)| id.0).collect();
    let seconds = figure(unreached.longest().as_secs_f64(), 0);
    let when = format!(" for {seconds} s {}", describe_phase(unreached.kind));
    (ids, when)
}

/// A predicate for "a drone that …".
#[must_use]
pub fn describe_exposure(exposure: Exposure) -> &'static str {
    match exposure {
        Exposure::Late => "is late",
        Exposure::Apart => "flies alone in its altitude layer",
        Exposure::BothApart => "flies alone in its altitude layer while another does",
        Exposure::Descends => "lands on the spot",
        Exposure::Killed => "is landed by its flight controller",
    }
}

/// What follows the phase of a drone's exposure: which phase the other drone is in.
#[must_use]
pub const fn describe_other(exposure: Exposure) -> &'static str {
    match exposure {
        Exposure::BothApart => " or before",
        Exposure::Late | Exposure::Apart | Exposure::Descends | Exposure::Killed => "",
    }
}

/// A phrase for the phase of a flight: "while all take off", "on the leg to waypoint 3".
#[must_use]
pub fn describe_phase(kind: PhaseKind) -> String {
    match kind {
        PhaseKind::TakeOff { wave } => format!("while {} off", describe_wave(wave, "take")),
        PhaseKind::Leg { to } => format!("on the leg to waypoint {to}"),
        PhaseKind::Climb { change } => format!("while all climb for change {change} of formation"),
        PhaseKind::Cross { change, wave } => {
            let crosses = describe_wave(wave, "cross");
            format!("while {crosses} for change {change} of formation")
        }
        PhaseKind::Descend { change } => {
            format!("while all descend in change {change} of formation")
        }
        PhaseKind::Land { wave } => format!("while {} to land", describe_wave(wave, "go")),
    }
}

/// A wave as the subject of a verb: "all take", "those of wave 2 take".
#[must_use]
pub fn describe_wave(wave: u16, does: &str) -> String {
    match wave {
        0 => format!("all {does}"),
        _ => format!("those of wave {} {does}", wave + 1),
    }
}

/// Metres rounded down to a decimetre, with a tolerance of 1 µm for the search's accuracy. No distance is below 0.
#[must_use]
pub fn format_metres(metres: f64) -> String {
    let rounded = rounded_down((metres + 1e-6).max(0.0), 1);
    rounded.trim_end_matches(".0").to_owned()
}

/// The distances of a closest approach: "3.5 m over ground and 2 m in height".
#[must_use]
pub fn describe_clearance(approach: &ClosestApproach) -> String {
    let clearance = approach.clearance;
    format!(
        "{} m over ground and {} m in height",
        format_metres(clearance.horizontal_m),
        format_metres(clearance.vertical_m)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metres_are_rounded_down_and_have_no_sign() {
        for (metres, shown) in [
            (5.0, "5"),
            (4.999_999_5, "5"),
            (4.999, "4.9"),
            (0.04, "0"),
            (0.06, "0"),
            (1.96, "1.9"),
            (-1e-9, "0"),
            (-2e-6, "0"),
        ] {
            assert_eq!(format_metres(metres), shown, "{metres}");
        }
    }
}
