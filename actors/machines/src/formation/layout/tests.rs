mod waves;

use std::num::NonZeroU32;

use proptest::prelude::*;

use super::super::assignment::Assignment;
use super::super::tests::kinds;
use super::super::{Change, Kind, OPTIMAL_MAX};
use super::*;

const SEPARATION: Separation = Separation {
    horizontal_m: 5.0,
    vertical_m: 5.0,
};

fn formation(kind: Kind, drones: u32, spacing_m: f64, heading_rad: f64) -> Formation {
    let drones = NonZeroU32::new(drones).unwrap();
    Formation::new(kind, drones, spacing_m, heading_rad)
}

fn line(drones: u32, spacing_m: f64, heading_rad: f64) -> Formation {
    formation(Kind::Linear, drones, spacing_m, heading_rad)
}

fn nearest_m(places: &[Ned]) -> f64 {
    super::super::crossings::nearest_pair_m(places).unwrap_or(f64::INFINITY)
}

fn grounds() -> impl Strategy<Value = Ground> {
    prop_oneof![
        Just(Ground::Gathered),
        Just(Ground::Line(Assignment::Optimal)),
        Just(Ground::Grid(Assignment::Greedy)),
        Just(Ground::Grid(Assignment::Optimal)),
    ]
}

#[test]
fn line_across_the_legs_needs_no_layers() {
    let layout = Layout::new(line(15, 160.0, 0.0), 10.0, SEPARATION);
    let north = [Ned::new(0.0, 0.0, -25.0), Ned::new(400.0, 100.0, -25.0)];
    assert_eq!(*layout.layers_m(&north), [0.0; 15]);
    assert_eq!(layout.take_off_layers_m(), [0.0; 15]);
}

#[test]
fn line_along_the_legs_has_a_layer_for_each_drone() {
    let layout = Layout::new(line(4, 160.0, 0.0), 10.0, SEPARATION);
    let east = [Ned::new(0.0, 0.0, -25.0), Ned::new(0.0, 1_000.0, -25.0)];
    let mut layers = layout.layers_m(&east).to_vec();
    layers.sort_by(f64::total_cmp);
    assert_eq!(layers, [5.5, 11.0, 16.5, 22.0]);
    assert_eq!(
        layout.landing_layers_m(),
        [0.0; 4],
        "in lockstep no drone passes another"
    );
}

#[test]
fn drones_farther_apart_than_a_leg_share_a_layer() {
    let layout = Layout::new(line(4, 160.0, 0.0), 10.0, SEPARATION);
    let east = [Ned::new(0.0, 0.0, -25.0), Ned::new(0.0, 170.0, -25.0)];
    assert_eq!(*layout.layers_m(&east), [5.5, 11.0, 5.5, 11.0]);
}

#[test]
fn master_has_the_lowest_layer() {
    let layout = Layout::new(line(4, 160.0, 0.0), 10.0, SEPARATION).with_layers(Layering::PerDrone);
    assert_eq!(layout.formation().centre(), NodeId(2));
    assert_eq!(*layout.layers_m(&[]), [11.0, 16.5, 5.5, 22.0]);
}

#[test]
fn layers_computed_beforehand_are_those_of_their_mission_only() {
    let fresh = || Layout::new(line(4, 160.0, 0.0), 10.0, SEPARATION);
    let east = [Ned::new(0.0, 0.0, -25.0), Ned::new(0.0, 170.0, -25.0)];
    let farther = [Ned::new(0.0, 0.0, -25.0), Ned::new(0.0, 1_000.0, -25.0)];
    assert_ne!(fresh().layers_m(&east), fresh().layers_m(&farther));
    let layout = fresh().for_mission(&east);
    for waypoints in [&east, &farther] {
        assert_eq!(layout.layers_m(waypoints), fresh().layers_m(waypoints));
    }
    let mesh = || formation(Kind::CompactMesh, 4, 40.0, 0.0);
    let (known, unknown) = (
        Change::new(1, &layout, mesh()),
        Change::new(1, &fresh(), mesh()),
    );
    assert_eq!(
        known.layout().layers_m(&east),
        unknown.layout().layers_m(&east)
    );
    let each = layout.with_layers(Layering::PerDrone);
    assert_eq!(*each.layers_m(&east), [11.0, 16.5, 5.5, 22.0]);
}

#[test]
fn gathered_swarms_of_forty_need_at_most_four_layers_and_expose_no_ends() {
    for kind in [
        Kind::Linear,
        Kind::Circular,
        Kind::Random { seed: 1 },
        Kind::CompactMesh,
        Kind::RegularMatrix,
        Kind::CompactMatrix,
    ] {
        for drones in 1..=40 {
            let layout = Layout::new(formation(kind, drones, 100.0, 0.0), 10.0, SEPARATION);
            let highest_m = layout.highest_layer_m(&[]);
            assert!(highest_m <= 4.0 * 5.5, "{kind:?}, {drones}: {highest_m} m");
            assert_eq!(layout.exposed_ends(), 0, "{kind:?}, {drones}");
        }
    }
}

#[test]
fn line_and_circle_need_no_layers_to_take_off() {
    for kind in [Kind::Linear, Kind::Circular] {
        for drones in [2, 7, 40, 200] {
            let layout = Layout::new(formation(kind, drones, 100.0, 0.3), 10.0, SEPARATION);
            assert!(layout.take_off_layers_m().iter().all(|layer| *layer == 0.0));
        }
    }
}

#[test]
fn swarms_above_the_optimal_limit_are_assigned_greedily() {
    assert_eq!(Assignment::for_drones(OPTIMAL_MAX), Assignment::Optimal);
    assert_eq!(Assignment::for_drones(OPTIMAL_MAX + 1), Assignment::Greedy);
}

/// Smallest sum of squared distances over all assignments, in m².
fn least_m2(places: &mut Vec<Ned>, slots: &[Ned]) -> f64 {
    let Some((slot, rest)) = slots.split_first() else {
        return 0.0;
    };
    let mut least = f64::INFINITY;
    for index in 0..places.len() {
        let place = places.remove(index);
        let cost = place.horizontal_distance_m(*slot).powi(2) + least_m2(places, rest);
        least = least.min(cost);
        places.insert(index, place);
    }
    least
}

fn sum_m2(places: &[Ned], slots: &[Ned]) -> f64 {
    let pairs = places.iter().zip(slots);
    pairs
        .map(|(a, b)| a.horizontal_distance_m(*b).powi(2))
        .sum()
}

/// Positions on the path of a drone from its place on the ground to its slot, in small steps.
fn along(ground: Ned, slot: Ned, layer_m: f64) -> impl Iterator<Item = Ned> {
    let level = (0..=100).map(move |part| {
        let path = Ned((slot.0 - ground.0) * (f64::from(part) / 100.0));
        (ground + path).at_altitude(25.0 + layer_m)
    });
    let climb =
        (0..=50).map(move |part| ground.at_altitude((25.0 + layer_m) * f64::from(part) / 50.0));
    let descent =
        (0..=10).map(move |part| slot.at_altitude(25.0 + layer_m * f64::from(part) / 10.0));
    climb.chain(level).chain(descent)
}

proptest! {
    #[test]
    fn places_on_the_ground_keep_the_gap(
        kind in kinds(),
        ground in grounds(),
        drones in 1_u32..40,
        gap_m in 6.0..100.0_f64,
    ) {
        let layout = Layout::new(formation(kind, drones, 160.0, 0.5), gap_m, SEPARATION).with_ground(ground);
        let all = |place: &dyn Fn(NodeId) -> Ned| (0..drones).map(NodeId).map(place).collect::<Vec<_>>();
        for places in [
            all(&|id| layout.take_off_place(id, Ned::HOME)),
            all(&|id| layout.landing_place(id, Ned::HOME)),
        ] {
            prop_assert!(nearest_m(&places) >= gap_m * (1.0 - 1e-9));
        }
    }

    #[test]
    fn optimal_assignment_has_the_least_squared_distance(
        kind in kinds(),
        drones in 1_u32..7,
        turn_rad in 0.0..6.3_f64,
    ) {
        let slots = formation(kind, drones, 100.0, 0.0);
        let mut places = line(drones, 10.0, turn_rad).slots().to_vec();
        let assigned = Assignment::Optimal.assign(&places, slots.slots());
        let least = least_m2(&mut places, slots.slots());
        prop_assert!(sum_m2(&assigned, slots.slots()) <= least + 1.0, "square metres");
        let greedy = Assignment::Greedy.assign(&places, slots.slots());
        prop_assert!(sum_m2(&greedy, slots.slots()) >= least - 1e-6);
        prop_assert!(nearest_m(&greedy) >= 9.999 || drones == 1, "each place is assigned once");
    }

    #[test]
    fn without_exposed_ends_drones_are_separated_anywhere_on_their_paths(
        kind in kinds(),
        drones in 2_u32..16,
        spacing_m in 20.0..200.0_f64,
    ) {
        let layout = Layout::new(formation(kind, drones, spacing_m, 0.2), 10.0, SEPARATION);
        prop_assume!(layout.exposed_ends() == 0);
        // Bare numbers, as this compares hundreds of millions of places.
        let paths: Vec<Vec<[f64; 3]>> = (0..drones).map(|id| {
            let slot = layout.slot(NodeId(id), Ned::HOME);
            let layer_m = layout.landing_layers_m()[id as usize];
            along(layout.landing_place(NodeId(id), Ned::HOME), slot, layer_m).map(|it| it.0.into()).collect()
        }).collect();
        let is_apart = |a: &[f64; 3], b: &[f64; 3]| {
            let [north, east, down] = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
            down.abs() >= 5.0 || north * north + east * east >= 25.0
        };
        for (a, path) in paths.iter().enumerate() {
            for (b, other) in paths[..a].iter().enumerate() {
                for here in path {
                    for there in other {
                        if !is_apart(here, there) {
                            prop_assert!(false, "{a} and {b}: {here:?}, {there:?}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn drones_passing_slots_on_a_leg_have_vertically_separated_layers(
        heading_rad in 0.0..3.2_f64,
        legs in prop::collection::vec((0.0..6.3_f64, 20.0..600.0_f64), 1..5),
    ) {
        let layout = Layout::new(line(6, 40.0, heading_rad), 10.0, SEPARATION);
        let mut waypoints = vec![Ned::new(0.0, 0.0, -25.0)];
        for (course, length_m) in legs {
            let last = waypoints[waypoints.len() - 1];
            waypoints.push(last + Ned::new(length_m, 0.0, 0.0).turned(course));
        }
        let layers = layout.layers_m(&waypoints);
        let slots = layout.formation().slots();
        for leg in waypoints.windows(2) {
            let path = leg[1] - leg[0];
            for a in 0..6 {
                for b in 0..a {
                    // One waits at its slot; the other flies its whole leg past it.
                    let nearest = (0..=200).map(|part| {
                        let flown = Ned(path.0 * (f64::from(part) / 200.0));
                        (slots[b] + flown).horizontal_distance_m(slots[a])
                    }).fold(f64::INFINITY, f64::min);
                    let apart = (layers[a] - layers[b]).abs() >= 5.0;
                    prop_assert!(apart || nearest >= 5.0, "{a} and {b}: {nearest} m");
                }
            }
        }
    }
}
