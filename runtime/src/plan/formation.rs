use std::num::NonZeroU32;
use std::ops::Range;

use crate::diagnostic::BadInput;
use muster_machines::formation::{
    Assignment, Change, Formation, Ground, Kind, Layout, OPTIMAL_MAX, Separation,
};

use super::file::Source;
use crate::schema::{Located, Or};

use super::raw::{
    self, AssignmentName, FormationKind, GroundName, Length, ProtocolKind, Raw, Seed, Whole,
};

/// How far apart clusters are, in radio ranges: a little more than they hear.
const CLUSTER_DISTANCE_RANGES: f64 = 1.05;

/// Slots and places on the ground, without altitude layers.
pub(super) fn layout(
    source: &Source,
    raw: &Raw,
    separation: Separation,
) -> Result<Layout, BadInput> {
    let drones = to_u32(raw.formation.drones.get_ref().0);
    let drones = NonZeroU32::new(drones).expect("read as a number from 1 to 100000");
    let spacing = &raw.formation.spacing_m;
    let spacing_m = spacing.get_ref().0;
    if spacing_m < separation.horizontal_m {
        let message = format!(
            "the spacing, {spacing_m} m, is below the minimum separation, {} m",
            separation.horizontal_m
        );
        return Err(source.error(spacing.span(), &message));
    }
    let gap_m = raw.formation.gap_m.0;
    let gap_span = raw.formation.gap_m.span().unwrap_or(spacing.span());
    // Half a metre more than the separation, for drones come closer in the turn to the formation's heading.
    if gap_m > spacing_m || gap_m < separation.horizontal_m + 0.5 {
        let message = format!(
            "the gap on the ground is {gap_m} m; accepted are {} m to the spacing, {spacing_m} m",
            separation.horizontal_m + 0.5
        );
        return Err(source.error(gap_span, &message));
    }
    let kind = kind(source, raw, &Shape::of(&raw.formation))?;
    let ground = ground(source, raw, drones.get())?;
    let heading_rad = raw.formation.heading_deg.0.to_radians();
    let formation = Formation::new(kind, drones, spacing_m, heading_rad);
    Ok(Layout::new(formation, gap_m, separation).with_ground(ground))
}

/// Fields of a formation, at take-off or after a change.
struct Shape<'a> {
    kind: FormationKind,
    clusters: &'a Or<Whole<2, 5>, 2>,
    cluster_distance_m: Option<&'a Located<Length>>,
    seed: Option<&'a Located<Seed>>,
}

impl<'a> Shape<'a> {
    fn of(formation: &'a raw::Formation) -> Self {
        Self {
            kind: formation.kind,
            clusters: &formation.clusters,
            cluster_distance_m: formation.cluster_distance_m.as_ref(),
            seed: formation.seed.as_ref(),
        }
    }

    fn after(change: &'a raw::Change) -> Self {
        Self {
            kind: change.kind,
            clusters: &change.clusters,
            cluster_distance_m: change.cluster_distance_m.as_ref(),
            seed: change.seed.as_ref(),
        }
    }
}

/// The changes of formation, in order of the flight.
pub(super) fn changes(
    source: &Source,
    raw: &Raw,
    layout: &Layout,
    waypoints: usize,
) -> Result<Vec<Change>, BadInput> {
    let mut changes: Vec<Change> = Vec::new();
    for change in &raw.changes {
        let waypoint = change.waypoint.get_ref().0;
        let refuse = |message: &str| Err(source.error(change.waypoint.span(), message));
        let last = if *raw.protocol.kind.get_ref() == ProtocolKind::Follow {
            0
        } else {
            waypoints - 1
        };
        if waypoint > last as u64 {
            return refuse(&match raw.protocol.kind.get_ref() {
                ProtocolKind::Follow => {
                    "with the protocol \"follow\" the formation changes at waypoint 0 only"
                        .to_owned()
                }
                ProtocolKind::Muscop | ProtocolKind::Agent => {
                    format!("the mission's last waypoint is {last}")
                }
            });
        }
        let waypoint = u16::try_from(waypoint).unwrap_or(u16::MAX);
        let before = changes.last();
        if before.is_some_and(|before| waypoint < before.waypoint()) {
            return refuse("the change before this one is at a later waypoint");
        }
        let layout = before.map_or(layout, Change::layout);
        let formation = formation_after(source, raw, layout, change)?;
        changes.push(Change::new(waypoint, layout, formation));
    }
    Ok(changes)
}

fn formation_after(
    source: &Source,
    raw: &Raw,
    before: &Layout,
    change: &raw::Change,
) -> Result<Formation, BadInput> {
    let spacing = change
        .spacing_m
        .as_ref()
        .unwrap_or(&raw.formation.spacing_m);
    let spacing_m = spacing.get_ref().0;
    // Drones land with the gap of the take-off.
    let gap_m = raw.formation.gap_m.0;
    if spacing_m < gap_m {
        let message =
            format!("the spacing, {spacing_m} m, is below the gap on the ground, {gap_m} m");
        return Err(source.error(spacing.span(), &message));
    }
    let kind = kind(source, raw, &Shape::after(change))?;
    let heading = change.heading_deg.unwrap_or(*raw.formation.heading_deg);
    let drones = NonZeroU32::new(before.formation().drones());
    let drones = drones.expect("a layout has drones");
    Ok(Formation::new(
        kind,
        drones,
        spacing_m,
        heading.0.to_radians(),
    ))
}

fn kind(source: &Source, raw: &Raw, formation: &Shape<'_>) -> Result<Kind, BadInput> {
    let refuse = |field: &str, span: Range<usize>, kind: &str| {
        let message = format!("`{field}` needs a formation of the kind \"{kind}\"");
        Err(source.error(span, &message))
    };
    if formation.kind != FormationKind::SplitUp {
        if let Some(span) = formation.clusters.span() {
            return refuse("clusters", span, "split-up");
        }
        if let Some(distance) = formation.cluster_distance_m {
            return refuse("cluster_distance_m", distance.span(), "split-up");
        }
    }
    if formation.kind != FormationKind::Random
        && let Some(seed) = formation.seed
    {
        return refuse("seed", seed.span(), "random");
    }
    Ok(match formation.kind {
        FormationKind::Linear => Kind::Linear,
        FormationKind::Circular => Kind::Circular,
        FormationKind::Random => Kind::Random {
            seed: formation.seed.unwrap_or(&raw.seed).get_ref().0,
        },
        FormationKind::SplitUp => split_up(source, raw, formation)?,
        FormationKind::CompactMesh => Kind::CompactMesh,
        FormationKind::RegularMatrix => Kind::RegularMatrix,
        FormationKind::CompactMatrix => Kind::CompactMatrix,
    })
}

fn split_up(source: &Source, raw: &Raw, formation: &Shape<'_>) -> Result<Kind, BadInput> {
    let count = to_u32(formation.clusters.0);
    let drones = &raw.formation.drones;
    if u64::from(count) >= drones.get_ref().0 {
        let span = formation.clusters.span().unwrap_or(drones.span());
        let message = format!(
            "{count} clusters and a master need at least {} drones, found {}",
            count + 1,
            drones.get_ref().0
        );
        return Err(source.error(span, &message));
    }
    let distance = formation.cluster_distance_m;
    let distance_m = distance.map_or(raw.radio.range_m.0 * CLUSTER_DISTANCE_RANGES, |it| {
        it.get_ref().0
    });
    Ok(Kind::SplitUp {
        clusters: NonZeroU32::new(count).expect("read as a number from 2 to 5"),
        distance_m,
    })
}

fn ground(source: &Source, raw: &Raw, drones: u32) -> Result<Ground, BadInput> {
    let asked = raw.formation.assignment.as_ref();
    let assignment = match asked.map(|it| (it.get_ref(), it.span())) {
        Some((_, span)) if raw.formation.ground == GroundName::Gathered => {
            let message = "`assignment` needs `ground` to be \"line\" or \"grid\": gathered drones stand below their \
                           own slots";
            return Err(source.error(span, message));
        }
        Some((AssignmentName::Optimal, span)) if drones > OPTIMAL_MAX => {
            let message =
                format!("\"optimal\" assigns at most {OPTIMAL_MAX} drones, found {drones}");
            return Err(source.error(span, &message));
        }
        Some((AssignmentName::Optimal, _)) => Assignment::Optimal,
        Some((AssignmentName::Greedy, _)) => Assignment::Greedy,
        None => Assignment::for_drones(drones),
    };
    Ok(match raw.formation.ground {
        GroundName::Gathered => Ground::Gathered,
        GroundName::Line => Ground::Line(assignment),
        GroundName::Grid => Ground::Grid(assignment),
    })
}

fn to_u32(value: u64) -> u32 {
    u32::try_from(value).unwrap_or(u32::MAX)
}
