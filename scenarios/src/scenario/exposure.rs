//! How near drones come to each other, phase by phase: what is refused of it, and what `muster check` tells.

use std::collections::BTreeSet;

use comfy_table::Table;
use muster_machines::formation::{
    Act, Approach, Exposed, Exposure, Flown, Layering, Nearness, Phase,
};
use muster_machines::identity::NodeId;
use muster_machines::mission::Succession;
use muster_runtime::diagnostic::BadInput;
use toml::Spanned;

use super::Scenario;
use crate::report::table::STYLE;
use muster_runtime::plan::apart::{distances, in_words, metres, when};
use muster_runtime::plan::file::Source;
use muster_runtime::plan::raw::Raw;
use muster_runtime::text::{NOTHING, drones, plural};

/// For swarms of at most so many it is found what single faults expose drones to.
pub(super) const EXPOSED_DRONES_MAX: u32 = 2_000;

/// Refuses a plan in which drones out of the master's reach follow another one, without a layer for each: those that follow
/// give way to nobody.
pub(super) fn check_followers(
    source: &Source,
    raw: &Raw,
    scenario: &Scenario,
) -> Result<(), BadInput> {
    let elects = scenario.plan.protocol.succession == Succession::Elect;
    let may_meet = scenario.plan.follow.is_some()
        && elects
        && scenario.plan.layout.layering() == Layering::Shared
        && !raw.limits.accepts(Exposure::Apart);
    let Some(apart) = may_meet.then(|| scenario.unreached()).flatten() else {
        return Ok(());
    };
    let message = format!(
        "{} {} out of the master's reach, over others too, and follow a master of their own; without room for a layer for \
         each drone they may come too near the others, who give way to nobody either; this takes a higher \
         `limits.altitude_max_m`, a larger `radio.range_m`, `protocol.succession = \"land\"`, or \"apart\" in \
         `limits.accept`",
        drones(&apart),
        if apart.len() == 1 { "is" } else { "are" },
    );
    let place = raw.limits.altitude_max_m.as_ref();
    let span = place.map_or_else(|| raw.formation.spacing_m.span(), Spanned::span);
    Err(source.error(span, &message))
}

/// The name of a row for one wave of several, the first being 0.
fn in_wave(name: &str, wave: u16) -> String {
    match wave {
        0 => name.to_owned(),
        _ => format!("{name}, wave {}", wave + 1),
    }
}

/// What a row of the table is called.
fn name(act: Act) -> String {
    match act {
        Act::TakesOff { wave } => in_wave("taking off", wave),
        Act::Flies { to } => format!("leg {to}"),
        Act::Climbs { change } => format!("change {change}: climbing"),
        Act::Crosses { change, wave } => in_wave(&format!("change {change}: crossing"), wave),
        Act::Descends { change } => format!("change {change}: descending"),
        Act::Lands { wave } => in_wave("going to land", wave),
    }
}

/// A phase as it is told.
struct Row {
    act: Act,
    /// Distance in lockstep, layers, who is out of reach, exposures.
    cells: [String; 4],
}

/// What one exposure comes to over all phases.
#[derive(Default)]
struct Total {
    affected: usize,
    phases: usize,
    nearest: Option<(Act, Approach)>,
}

impl Total {
    fn add(&mut self, act: Act, nearness: &Nearness) {
        if nearness.too_near.is_empty() {
            return;
        }
        self.phases += 1;
        self.affected = self.affected.max(affected(nearness));
        let room = |approach: &Approach| approach.clearance.room;
        let nearest = self
            .nearest
            .as_ref()
            .map_or(f64::INFINITY, |(_, it)| room(it));
        if let Some(closest) = nearness.closest.filter(|it| room(it) < nearest) {
            self.nearest = Some((act, closest));
        }
    }
}

/// To how many drones something may happen that brings them too near others.
fn affected(nearness: &Nearness) -> usize {
    let affected: BTreeSet<NodeId> = nearness.too_near.iter().map(|[id, _]| *id).collect();
    affected.len()
}

impl Scenario {
    pub(super) fn flown(&self) -> Flown<'_> {
        Flown {
            layout: &self.plan.layout,
            changes: &self.plan.changes,
            waypoints: &self.plan.waypoints,
        }
    }

    /// How near drones come to each other: first whether they keep apart, then phase by phase. `out_of_reach` tells how
    /// many are out of the master's reach in a phase, if that is known.
    pub(super) fn apart_in_words(
        &self,
        mut out_of_reach: impl FnMut(&Phase) -> Option<usize>,
    ) -> Vec<String> {
        let is_small = self.plan.layout.formation().drones() <= EXPOSED_DRONES_MAX;
        let mut exposures = is_small.then(|| self.flown().exposures());
        let (mut rows, mut closest) = (Vec::<Row>::new(), None::<Approach>);
        let mut totals = Exposure::ALL.map(|exposure| (exposure, Total::default()));
        let mut together = 0;
        for exposed in self.flown().in_lockstep() {
            let act = exposed.phase.act;
            let room = |it: &Approach| it.clearance.room;
            let nearest = closest.as_ref().map_or(f64::INFINITY, room);
            closest = exposed
                .lockstep
                .closest
                .filter(|it| room(it) < nearest)
                .or(closest);
            together += exposed.together.len();
            let of = exposures
                .as_mut()
                .and_then(Iterator::next)
                .unwrap_or_default();
            for ((_, total), (_, nearness)) in totals.iter_mut().zip(&of) {
                total.add(act, nearness);
            }
            let reach = out_of_reach(&exposed.phase);
            rows.push(Row {
                act,
                cells: [
                    in_lockstep(&exposed),
                    self.layers_of(&exposed.phase),
                    reach.map_or_else(|| "not known".to_owned(), count),
                    if is_small {
                        exposed_to(&of)
                    } else {
                        "not known".to_owned()
                    },
                ],
            });
        }
        let mut lines = vec![self.verdict(closest, together)];
        if is_small {
            lines.extend(
                totals
                    .iter()
                    .filter_map(|(exposure, total)| self.total_in_words(*exposure, total)),
            );
        }
        lines.extend(table(&rows));
        lines
    }

    fn verdict(&self, closest: Option<Approach>, together: usize) -> String {
        let separation = self.plan.limits.separation;
        let Some(closest) = closest else {
            return "kept apart in lockstep: there is one drone".to_owned();
        };
        let together = match together {
            0 => String::new(),
            _ => format!(
                "; {} so only as they take off or land at the same time",
                plural(together, "pair")
            ),
        };
        format!(
            "kept apart in lockstep: {} at the closest, {} (limits: {} m over ground or {} m in height){together}",
            distances(&closest),
            drones(&closest.drones.map(|id| id.0)),
            separation.horizontal_m,
            separation.vertical_m,
        )
    }

    fn total_in_words(&self, exposure: Exposure, total: &Total) -> Option<String> {
        let (act, nearest) = total.nearest?;
        let is_mended = self.plan.vehicle.avoid.is_some()
            && exposure.is_mended_by_giving_way(self.plan.follow.is_some());
        let [affected, other] = nearest.drones;
        Some(format!(
            "exposed to `{}`, one that {}: {} of {} in {}; drone {affected} comes within {} of drone {other} {}{}",
            exposure.name(),
            in_words(exposure),
            total.affected,
            plural(self.plan.layout.formation().drones() as usize, "drone"),
            plural(total.phases, "phase"),
            distances(&nearest),
            when(act),
            if is_mended {
                "; by `safety.avoid` they give way"
            } else {
                ""
            },
        ))
    }

    /// The highest layer or sector that is flown in a phase.
    fn layers_of(&self, phase: &Phase) -> String {
        let layout = self.flown().layout_after(phase.changes);
        let layers_m: &[f64] = match phase.act {
            Act::TakesOff { .. } => layout.take_off_layers_m(),
            Act::Lands { .. } => layout.landing_layers_m(),
            Act::Climbs { change } | Act::Crosses { change, .. } | Act::Descends { change } => {
                self.plan.changes[usize::from(change)].sectors_m()
            }
            Act::Flies { .. } => &[],
        };
        let highest_m = layers_m.iter().copied().fold(0.0, f64::max);
        if highest_m > 0.0 {
            format!("to +{} m", (highest_m * 1_000.0).round() / 1_000.0)
        } else {
            NOTHING.to_owned()
        }
    }
}

fn count(number: usize) -> String {
    match number {
        0 => NOTHING.to_owned(),
        some => some.to_string(),
    }
}

fn in_lockstep(exposed: &Exposed) -> String {
    let closest = exposed.lockstep.closest.map(|closest| {
        let [one, other] = closest.drones;
        let clearance = closest.clearance;
        format!(
            "{} m / {} m ({one}, {other})",
            metres(clearance.horizontal_m),
            metres(clearance.vertical_m)
        )
    });
    closest.unwrap_or_else(|| NOTHING.to_owned())
}

fn exposed_to(of: &[(Exposure, Nearness)]) -> String {
    let named = of
        .iter()
        .filter(|(_, nearness)| !nearness.too_near.is_empty());
    let named: Vec<String> = named
        .map(|(exposure, nearness)| format!("{} {}", exposure.name(), affected(nearness)))
        .collect();
    if named.is_empty() {
        NOTHING.to_owned()
    } else {
        named.join(", ")
    }
}

/// So many lines of phases are told, the last one included.
const LISTED_PHASES_MAX: usize = 30;

/// A line a phase; legs in a row that are alike share one.
fn table(rows: &[Row]) -> Vec<String> {
    let mut table = Table::new();
    table.force_no_tty().load_style(STYLE);
    table.set_header([
        "phase",
        "closest over ground / in height",
        "layers",
        "out of reach",
        "exposed drones",
    ]);
    for column in table.column_iter_mut() {
        column.set_padding((0, 2));
    }
    let is_leg = |row: &Row| matches!(row.act, Act::Flies { .. });
    let alike = rows.chunk_by(|a, b| is_leg(a) && is_leg(b) && a.cells == b.cells);
    let alike: Vec<&[Row]> = alike.collect();
    let left_out = alike.len().saturating_sub(LISTED_PHASES_MAX);
    for (index, alike) in alike.iter().enumerate() {
        let is_left_out =
            |at: usize| (LISTED_PHASES_MAX - 1..LISTED_PHASES_MAX - 1 + left_out).contains(&at);
        if is_left_out(index) {
            if !is_left_out(index + 1) {
                table.add_row([format!("… {left_out} more")]);
            }
            continue;
        }
        let first = name(alike[0].act);
        let name = match alike[alike.len() - 1].act {
            Act::Flies { to } if alike.len() > 1 => {
                let first = first.trim_start_matches("leg ");
                format!("legs {first}–{to}")
            }
            _ => first,
        };
        let cells = alike[0].cells.iter().cloned();
        table.add_row(std::iter::once(name).chain(cells));
    }
    table
        .lines()
        .map(|line| line.trim_end().to_owned())
        .collect()
}
