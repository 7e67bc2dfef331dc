//! How near drones come to each other: what is refused of it.

use muster_machines::formation::{Act, Approach, Exposure, Flown};

use super::file::Source;
use super::raw::{ProtocolKind, Raw};
use crate::diagnostic::BadInput;
use crate::text::{drones, rounded_down};

/// Refuses a plan in which drones in lockstep come too near each other and, where `limits.accept` says what may, one in
/// which a single fault can bring them too near that it does not name.
pub(super) fn check_apart(source: &Source, raw: &Raw, flown: Flown<'_>) -> Result<(), BadInput> {
    let too_near = flown.in_lockstep().find_map(|exposed| {
        let is_too_near = !exposed.lockstep.too_near.is_empty();
        is_too_near.then_some((exposed.phase.act, exposed.lockstep.closest?))
    });
    if let Some((act, closest)) = too_near {
        let message = format!(
            "in lockstep {} may come too near each other {}: {}; farther apart takes a larger `formation.spacing_m`, or \
             `formation.gap_m` on the ground",
            drones(&closest.drones.map(|id| id.0)),
            when(act),
            distances(&closest)
        );
        return Err(source.error(raw.formation.spacing_m.span(), &message));
    }
    let Some(accepted) = &raw.limits.accept else {
        return Ok(());
    };
    let they_follow = raw.protocol.kind == ProtocolKind::Follow;
    let is_accepted = |exposure: Exposure| {
        raw.limits.accepts(exposure)
            || raw.safety.avoid && exposure.is_mended_by_giving_way(they_follow)
    };
    let found = flown
        .phases()
        .zip(flown.exposures())
        .find_map(|(phase, of)| {
            let of = of
                .into_iter()
                .filter(|(exposure, _)| !is_accepted(*exposure));
            let mut of = of.filter(|(_, nearness)| !nearness.too_near.is_empty());
            let (exposure, nearness) = of.next()?;
            Some((phase.act, exposure, nearness.closest?))
        });
    let Some((act, exposure, closest)) = found else {
        return Ok(());
    };
    let avoid = if exposure.is_mended_by_giving_way(they_follow) {
        ", or `safety.avoid = true`, by which they give way to each other"
    } else {
        ""
    };
    let [affected, other] = closest.drones;
    let message = format!(
        "a drone that {} may come too near another: drone {affected} comes within {} of drone {other} {}; this takes \
         \"{}\" in `limits.accept`{avoid}",
        in_words(exposure),
        distances(&closest),
        when(act),
        exposure.name(),
    );
    Err(source.error(accepted.span(), &message))
}

/// What a drone does, as after "a drone that".
#[must_use]
pub fn in_words(exposure: Exposure) -> &'static str {
    match exposure {
        Exposure::Late => "is late",
        Exposure::Apart => "flies apart from the others, in its layer",
        Exposure::Descends => "comes down on the spot",
        Exposure::Killed => "is brought down by its flight controller",
    }
}

/// When something happens, as after a comma.
#[must_use]
pub fn when(act: Act) -> String {
    match act {
        Act::TakesOff { wave } => format!("while {} off", wave_in_words(wave, "take")),
        Act::Flies { to } => format!("on the leg to waypoint {to}"),
        Act::Climbs { change } => format!("while all climb for change {change} of formation"),
        Act::Crosses { change, wave } => {
            let crosses = wave_in_words(wave, "cross");
            format!("while {crosses} for change {change} of formation")
        }
        Act::Descends { change } => format!("while all descend in change {change} of formation"),
        Act::Lands { wave } => format!("while {} to land", wave_in_words(wave, "go")),
    }
}

/// Who does it: all, or one of the later waves.
#[must_use]
pub fn wave_in_words(wave: u16, does: &str) -> String {
    match wave {
        0 => format!("all {does}"),
        _ => format!("those of wave {} {does}", wave + 1),
    }
}

/// To a decimetre, never more than it is; a micrometre is what the search for it leaves open.
#[must_use]
pub fn metres(metres: f64) -> String {
    let rounded = rounded_down(metres + 1e-6, 1);
    rounded.trim_end_matches(".0").to_owned()
}

/// How near two come, in words.
#[must_use]
pub fn distances(approach: &Approach) -> String {
    let clearance = approach.clearance;
    format!(
        "{} m over ground and {} m in height",
        metres(clearance.horizontal_m),
        metres(clearance.vertical_m)
    )
}
