//! Separation of drones in each phase: the table of `muster check`.

use std::collections::BTreeSet;

use comfy_table::Table;
use muster_machines::formation::{
    ClosestApproach, Exposure, FlightPlan, Phase, PhaseKind, PhaseSeparation, Proximity,
};
use muster_machines::identity::NodeId;
use muster_machines::mission::Succession;

use super::Scenario;
use crate::report::TABLE_STYLE;
use muster_runtime::plan::separation::{
    APART_OFF_THE_LINES, describe_clearance, describe_exposure, describe_other, describe_phase,
    exposes_all_apart, format_metres,
};
use muster_runtime::text::{NO_VALUE, drones, plural};

/// Largest swarm whose exposures to single faults are computed.
pub(super) const EXPOSED_DRONES_MAX: u32 = 2_000;

/// The name of a row for one wave, from 0.
fn name_with_wave(name: &str, wave: u16) -> String {
    match wave {
        0 => name.to_owned(),
        _ => format!("{name}, wave {}", wave + 1),
    }
}

/// The name of a row.
fn phase_name(kind: PhaseKind) -> String {
    match kind {
        PhaseKind::TakeOff { wave } => name_with_wave("taking off", wave),
        PhaseKind::Leg { to } => format!("leg {to}"),
        PhaseKind::Climb { change } => format!("change {change}: climbing"),
        PhaseKind::Cross { change, wave } => {
            name_with_wave(&format!("change {change}: crossing"), wave)
        }
        PhaseKind::Descend { change } => format!("change {change}: descending"),
        PhaseKind::Land { wave } => name_with_wave("going to land", wave),
    }
}

/// A phase in the table.
struct Row {
    kind: PhaseKind,
    /// Distance in lockstep, layers, drones out of reach, exposures.
    cells: [String; 4],
}

/// One exposure over all phases.
#[derive(Default)]
struct Total {
    affected: usize,
    phases: usize,
    nearest: Option<(PhaseKind, ClosestApproach)>,
}

impl Total {
    fn add(&mut self, kind: PhaseKind, nearness: &Proximity) {
        if nearness.conflicts.is_empty() {
            return;
        }
        self.phases += 1;
        self.affected = self.affected.max(affected(nearness));
        let room = |approach: &ClosestApproach| approach.clearance.ratio;
        let nearest = self
            .nearest
            .as_ref()
            .map_or(f64::INFINITY, |(_, it)| room(it));
        if let Some(closest) = nearness.closest.filter(|it| room(it) < nearest) {
            self.nearest = Some((kind, closest));
        }
    }
}

/// Number of drones that a fault may bring too near others.
fn affected(nearness: &Proximity) -> usize {
    let affected: BTreeSet<NodeId> = nearness.conflicts.iter().map(|[id, _]| *id).collect();
    affected.len()
}

impl Scenario {
    pub(super) fn flown(&self) -> FlightPlan<'_> {
        FlightPlan {
            layout: &self.plan.layout,
            changes: &self.plan.changes,
            waypoints: &self.plan.waypoints,
        }
    }

    /// The exposures listed in `limits.accept` that may bring these two drones too close to each other. Whether they did is not
    /// looked at.
    #[must_use]
    pub fn accepted_exposures(&self, drones: [NodeId; 2]) -> BTreeSet<Exposure> {
        let accepted = &self.plan.accepted;
        if accepted.is_empty() {
            return BTreeSet::new();
        }
        let [one, other] = drones;
        let found = self.flown().exposures().flatten();
        let found = found.filter(|(exposure, nearness)| {
            let conflicts = &nearness.conflicts;
            accepted.contains(exposure)
                && (conflicts.contains(&[one, other]) || conflicts.contains(&[other, one]))
        });
        let mut found: BTreeSet<_> = found.map(|(exposure, _)| exposure).collect();
        if self.exposes_all_apart() && accepted.contains(&Exposure::Apart) {
            found.insert(Exposure::Apart);
        }
        found
    }

    /// Whether any two drones are exposed to `apart`.
    fn exposes_all_apart(&self) -> bool {
        let elects = self.plan.protocol.succession == Succession::Elect;
        exposes_all_apart(
            elects && self.plan.follow.is_some(),
            self.plan.layout.layering(),
        )
    }

    /// Describes the separation of drones: a summary, the exposures, then a table by phase. `out_of_reach` returns the number
    /// of drones out of the master's reach in a phase, if known.
    pub(super) fn describe_separation(
        &self,
        mut out_of_reach: impl FnMut(&Phase) -> Option<usize>,
    ) -> Vec<String> {
        let is_small = self.plan.layout.formation().drones() <= EXPOSED_DRONES_MAX;
        let mut exposures = is_small.then(|| self.flown().exposures());
        let (mut rows, mut closest) = (Vec::<Row>::new(), None::<ClosestApproach>);
        let mut totals = Exposure::ALL.map(|exposure| (exposure, Total::default()));
        let mut together = 0;
        for exposed in self.flown().in_lockstep() {
            let kind = exposed.phase.kind;
            let room = |it: &ClosestApproach| it.clearance.ratio;
            let nearest = closest.as_ref().map_or(f64::INFINITY, room);
            closest = exposed
                .lockstep
                .closest
                .filter(|it| room(it) < nearest)
                .or(closest);
            together += exposed.time_separated.len();
            let of = exposures
                .as_mut()
                .and_then(Iterator::next)
                .unwrap_or_default();
            for ((_, total), (_, nearness)) in totals.iter_mut().zip(&of) {
                total.add(kind, nearness);
            }
            let reach = out_of_reach(&exposed.phase);
            rows.push(Row {
                kind,
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
        let mut lines = vec![self.describe_lockstep(closest, together)];
        if is_small {
            lines.extend(
                totals
                    .iter()
                    .filter_map(|(exposure, total)| self.describe_total(*exposure, total)),
            );
        }
        if self.exposes_all_apart() {
            lines.push(format!(
                "exposed to `apart` for all drones: {APART_OFF_THE_LINES}"
            ));
        }
        lines.extend(table(&rows));
        lines
    }

    fn describe_lockstep(&self, closest: Option<ClosestApproach>, together: usize) -> String {
        let separation = self.plan.limits.separation;
        let Some(closest) = closest else {
            return "separation in lockstep: there is one drone".to_owned();
        };
        let together = match together {
            0 => String::new(),
            _ => format!(
                "; {} separated only in time, as they take off or land",
                plural(together, "pair")
            ),
        };
        format!(
            "separation in lockstep: {} at the closest, {} (limits: {} m over ground or {} m in height){together}",
            describe_clearance(&closest),
            drones(&closest.drones.map(|id| id.0)),
            separation.horizontal_m,
            separation.vertical_m,
        )
    }

    fn describe_total(&self, exposure: Exposure, total: &Total) -> Option<String> {
        let (kind, nearest) = total.nearest?;
        let [affected, other] = nearest.drones;
        Some(format!(
            "exposed to `{}` (a drone {}): {} of {} in {}; drone {affected} comes within {} of drone {other} {}{}{}",
            exposure.name(),
            describe_exposure(exposure),
            total.affected,
            plural(self.plan.layout.formation().drones() as usize, "drone"),
            plural(total.phases, "phase"),
            describe_clearance(&nearest),
            describe_phase(kind),
            describe_other(exposure),
            self.describe_right_of_way(exposure),
        ))
    }

    /// What the right of way does about an exposure. Drones that follow a master give way to nobody.
    fn describe_right_of_way(&self, exposure: Exposure) -> &'static str {
        let follows = self.plan.follow.is_some();
        match exposure {
            _ if self.plan.vehicle.avoid.is_none() => "",
            Exposure::Late | Exposure::Apart | Exposure::BothApart if !follows => {
                "; resolved by `safety.avoid` only while the two hear each other"
            }
            Exposure::Late => "; resolved by `safety.avoid` only while none follows its master",
            _ => "",
        }
    }

    /// The highest layer or sector of a phase.
    fn layers_of(&self, phase: &Phase) -> String {
        let layout = self.flown().layout_after(phase.changes);
        let layers_m: &[f64] = match phase.kind {
            PhaseKind::TakeOff { .. } => layout.take_off_layers_m(),
            PhaseKind::Land { .. } => layout.landing_layers_m(),
            PhaseKind::Climb { change }
            | PhaseKind::Cross { change, .. }
            | PhaseKind::Descend { change } => self.plan.changes[usize::from(change)].sectors_m(),
            PhaseKind::Leg { .. } => &[],
        };
        let highest_m = layers_m.iter().copied().fold(0.0, f64::max);
        if highest_m > 0.0 {
            format!("to +{} m", (highest_m * 1_000.0).round() / 1_000.0)
        } else {
            NO_VALUE.to_owned()
        }
    }
}

fn count(number: usize) -> String {
    match number {
        0 => NO_VALUE.to_owned(),
        some => some.to_string(),
    }
}

fn in_lockstep(exposed: &PhaseSeparation) -> String {
    let closest = exposed.lockstep.closest.map(|closest| {
        let [one, other] = closest.drones;
        let clearance = closest.clearance;
        format!(
            "{} m / {} m ({one}, {other})",
            format_metres(clearance.horizontal_m),
            format_metres(clearance.vertical_m)
        )
    });
    closest.unwrap_or_else(|| NO_VALUE.to_owned())
}

fn exposed_to(of: &[(Exposure, Proximity)]) -> String {
    let named = of
        .iter()
        .filter(|(_, nearness)| !nearness.conflicts.is_empty());
    let named: Vec<String> = named
        .map(|(exposure, nearness)| format!("{} {}", exposure.name(), affected(nearness)))
        .collect();
    if named.is_empty() {
        NO_VALUE.to_owned()
    } else {
        named.join(", ")
    }
}

/// Most rows of the table, the last one included.
const LISTED_PHASES_MAX: usize = 30;

/// One row per phase; consecutive legs with equal values share a row.
fn table(rows: &[Row]) -> Vec<String> {
    let mut table = bare_table([
        "phase",
        "closest over ground / in height",
        "layers",
        "number out of reach",
        "number exposed",
    ]);
    let is_leg = |row: &Row| matches!(row.kind, PhaseKind::Leg { .. });
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
        let first = phase_name(alike[0].kind);
        let name = match alike[alike.len() - 1].kind {
            PhaseKind::Leg { to } if alike.len() > 1 => {
                let first = first.trim_start_matches("leg ");
                format!("legs {first}–{to}")
            }
            _ => first,
        };
        let cells = alike[0].cells.iter().cloned();
        table.add_row(std::iter::once(name).chain(cells));
    }
    lines(&table)
}

/// A table without frames.
pub(super) fn bare_table(header: impl IntoIterator<Item = &'static str>) -> Table {
    let mut table = Table::new();
    table.force_no_tty().load_style(TABLE_STYLE);
    table.set_header(header);
    for column in table.column_iter_mut() {
        column.set_padding((0, 2));
    }
    table
}

/// The lines of a table, without blanks at their ends.
pub(super) fn lines(table: &Table) -> Vec<String> {
    table
        .lines()
        .map(|line| line.trim_end().to_owned())
        .collect()
}
