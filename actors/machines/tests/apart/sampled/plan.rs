//! Random flight plans.

use std::num::NonZeroU32;

use muster_machines::formation::{
    Assignment, Change, FlightPlan, Formation, Ground, Kind, Layering, Layout, Separation,
};
use muster_machines::geometry::Ned;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// A random plan of up to twenty drones.
pub(super) struct Plan {
    pub(super) separation: Separation,
    layout: Layout,
    changes: Vec<Change>,
    waypoints: Vec<Ned>,
}

impl Plan {
    pub(super) fn draw(rng: &mut ChaCha8Rng) -> Self {
        let separation = Separation {
            horizontal_m: rng.random_range(2.0..6.0),
            vertical_m: rng.random_range(2.0..6.0),
        };
        let gap_m = separation.horizontal_m + rng.random_range(0.5..5.0);
        let drones = NonZeroU32::new(rng.random_range(2..=20)).expect("at least two");
        let mut formation = || {
            let spacing_m = gap_m * rng.random_range(1.0..5.0);
            let heading_rad = rng.random_range(0.0..6.3);
            Formation::new(kind(rng, spacing_m), drones, spacing_m, heading_rad)
        };
        let (first, mut next) = (formation(), vec![formation(), formation()]);
        let ground = match rng.random_range(0..4) {
            0 => Ground::Grid(Assignment::Optimal),
            1 => Ground::Line(Assignment::Greedy),
            _ => Ground::Gathered,
        };
        let layering = if rng.random_bool(0.7) {
            Layering::PerDrone
        } else {
            Layering::Shared
        };
        let layout = Layout::new(first, gap_m, separation)
            .with_ground(ground)
            .with_layers(layering);
        let mut waypoints = vec![Ned::HOME.at_altitude(rng.random_range(6.0..40.0))];
        for _ in 0..rng.random_range(0..4) {
            let last = waypoints[waypoints.len() - 1];
            let leg = Ned::new(rng.random_range(0.0..150.0), 0.0, 0.0);
            let next = last + leg.turned(rng.random_range(0.0..6.3));
            waypoints.push(next.at_altitude(rng.random_range(6.0..60.0)));
        }
        let mut at: Vec<usize> = (0..rng.random_range(0..3))
            .map(|_| rng.random_range(0..waypoints.len()))
            .collect();
        at.sort_unstable();
        let mut changes: Vec<Change> = Vec::new();
        for at in at {
            let before = changes.last().map_or(&layout, Change::layout);
            let formation = next.pop().expect("as many as changes");
            let at = u16::try_from(at).expect("a few waypoints");
            changes.push(Change::new(at, before, formation));
        }
        Self {
            separation,
            layout,
            changes,
            waypoints,
        }
    }

    pub(super) fn flight_plan(&self) -> FlightPlan<'_> {
        FlightPlan {
            layout: &self.layout,
            changes: &self.changes,
            waypoints: &self.waypoints,
        }
    }

    pub(super) fn drones(&self) -> u32 {
        self.layout.formation().drones()
    }
}

fn kind(rng: &mut ChaCha8Rng, spacing_m: f64) -> Kind {
    match rng.random_range(0..7) {
        0 => Kind::Linear,
        1 => Kind::Circular,
        2 => Kind::Random {
            seed: rng.random_range(0..1_000),
        },
        3 => Kind::SplitUp {
            clusters: NonZeroU32::new(rng.random_range(1..4)).expect("at least one"),
            distance_m: spacing_m * rng.random_range(1.0..3.0),
        },
        4 => Kind::CompactMesh,
        5 => Kind::RegularMatrix,
        _ => Kind::CompactMatrix,
    }
}
