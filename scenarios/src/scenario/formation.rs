use std::num::NonZeroU32;
use std::ops::Range;

use muster_machines::formation::{
    Assignment, Formation, Ground, Kind, Layout, OPTIMAL_MAX, Separation,
};
use muster_runtime::diagnostic::BadInput;
use toml::Spanned;

use super::file::Source;
use super::raw::{AssignmentName, FormationKind, GroundName, Raw};

/// How far apart drones stand on the ground.
const GAP_M: f64 = 10.0;
/// How many clusters a swarm splits up into.
const CLUSTERS: u32 = 2;
/// How far apart clusters are, in radio ranges: a little more than they hear.
const CLUSTER_DISTANCE_RANGES: f64 = 1.05;

/// Who flies, stands and lands where.
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
            "slots {spacing_m} m apart are nearer than drones may come, {} m",
            separation.horizontal_m
        );
        return Err(source.error(spacing.span(), &message));
    }
    let gap_m = raw
        .formation
        .gap_m
        .as_ref()
        .map_or(GAP_M, |gap| gap.get_ref().0);
    let gap_span = raw.formation.gap_m.as_ref().unwrap_or(spacing).span();
    // Half a metre more than needed, for the turn in which drones draw together costs a little.
    if gap_m > spacing_m || gap_m < separation.horizontal_m + 0.5 {
        let message = format!(
            "drones {gap_m} m apart on the ground; that takes from {} m to the spacing, {spacing_m} m",
            separation.horizontal_m + 0.5
        );
        return Err(source.error(gap_span, &message));
    }
    let kind = kind(source, raw)?;
    let ground = ground(source, raw, drones.get())?;
    let heading_rad = raw.formation.heading_deg.0.to_radians();
    let formation = Formation::new(kind, drones, spacing_m, heading_rad);
    Ok(Layout::new(formation, gap_m, separation).standing(ground))
}

fn kind(source: &Source, raw: &Raw) -> Result<Kind, BadInput> {
    let formation = &raw.formation;
    let refuse = |field: &str, span: Range<usize>, kind: &str| {
        let message = format!("only a formation of the kind \"{kind}\" has `{field}`");
        Err(source.error(span, &message))
    };
    if formation.kind != FormationKind::SplitUp {
        if let Some(clusters) = &formation.clusters {
            return refuse("clusters", clusters.span(), "split-up");
        }
        if let Some(distance) = &formation.cluster_distance_m {
            return refuse("cluster_distance_m", distance.span(), "split-up");
        }
    }
    if formation.kind != FormationKind::Random
        && let Some(seed) = &formation.seed
    {
        return refuse("seed", seed.span(), "random");
    }
    Ok(match formation.kind {
        FormationKind::Linear => Kind::Linear,
        FormationKind::Circular => Kind::Circular,
        FormationKind::Random => Kind::Random {
            seed: formation.seed.as_ref().unwrap_or(&raw.seed).get_ref().0,
        },
        FormationKind::SplitUp => split_up(source, raw)?,
        FormationKind::CompactMesh => Kind::CompactMesh,
        FormationKind::RegularMatrix => Kind::RegularMatrix,
        FormationKind::CompactMatrix => Kind::CompactMatrix,
    })
}

fn split_up(source: &Source, raw: &Raw) -> Result<Kind, BadInput> {
    let clusters = raw.formation.clusters.as_ref();
    let count = clusters.map_or(CLUSTERS, |it| to_u32(it.get_ref().0));
    let drones = &raw.formation.drones;
    if u64::from(count) >= drones.get_ref().0 {
        let span = clusters.map_or_else(|| drones.span(), Spanned::span);
        let message = format!(
            "{count} clusters around a master take {} drones at least, and there are {}",
            count + 1,
            drones.get_ref().0
        );
        return Err(source.error(span, &message));
    }
    let distance = raw.formation.cluster_distance_m.as_ref();
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
            let message = "gathered drones stand at the places of their own slots; there is nothing to assign";
            return Err(source.error(span, message));
        }
        Some((AssignmentName::Optimal, span)) if drones > OPTIMAL_MAX => {
            let message =
                format!("{drones} drones are too many to assign optimally, {OPTIMAL_MAX} the most");
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
