use std::collections::BTreeSet;

use proptest::prelude::*;

use super::*;

fn many(number: u32) -> NonZeroU32 {
    NonZeroU32::new(number).unwrap()
}

fn formation(kind: Kind, drones: u32, spacing_m: f64) -> Formation {
    Formation::new(kind, many(drones), spacing_m, 0.0)
}

pub(super) fn kinds() -> impl Strategy<Value = Kind> {
    prop_oneof![
        Just(Kind::Linear),
        Just(Kind::Circular),
        any::<u64>().prop_map(|seed| Kind::Random { seed }),
        (1_u32..6, 10.0..500.0_f64).prop_map(|(clusters, distance_m)| Kind::SplitUp {
            clusters: many(clusters),
            distance_m,
        }),
        Just(Kind::CompactMesh),
        Just(Kind::RegularMatrix),
        Just(Kind::CompactMatrix),
    ]
}

fn places(formation: &Formation) -> Vec<(i64, i64)> {
    let slots = formation.slots().iter();
    #[expect(clippy::cast_possible_truncation, reason = "metres of a formation")]
    let places = slots.map(|slot| (slot.north_m().round() as i64, slot.east_m().round() as i64));
    places.collect()
}

#[test]
fn line_is_across_the_heading_with_the_master_in_the_middle() {
    let formation = formation(Kind::Linear, 5, 160.0);
    let east: Vec<_> = formation.slots().iter().map(|slot| slot.east_m()).collect();
    assert_eq!(east, [-320.0, -160.0, 0.0, 160.0, 320.0]);
    assert_eq!(formation.centre(), NodeId(2));
}

#[test]
fn succession_goes_from_the_centre_outwards() {
    let ranks = |kind| formation(kind, 5, 160.0).ranks().to_vec();
    assert_eq!(ranks(Kind::Linear), [3, 1, 0, 2, 4]);
    assert_eq!(ranks(Kind::RegularMatrix), [3, 1, 4, 2, 0]);
    assert_eq!(ranks(Kind::Circular), [0, 1, 2, 3, 4]);
}

#[test]
fn circle_has_the_master_at_its_centre_and_keeps_the_spacing() {
    let small = formation(Kind::Circular, 5, 100.0);
    assert_eq!(
        places(&small),
        [(0, 0), (100, 0), (0, 100), (-100, 0), (0, -100)]
    );
    let large = formation(Kind::Circular, 41, 100.0);
    assert!((large.slot_distance_min_m() - 100.0).abs() < 1e-9);
    assert!(large.slots()[1].north_m() > 600.0);
}

#[test]
fn mesh_has_six_neighbours_around_the_master() {
    let mesh = formation(Kind::CompactMesh, 19, 100.0);
    let near = mesh.slots()[1..]
        .iter()
        .filter(|slot| (slot.0.norm() - 100.0).abs() < 1e-9);
    assert_eq!(near.count(), 6);
    assert!(mesh.slots().iter().all(|slot| slot.0.norm() < 200.1));
}

#[test]
fn compact_matrix_grows_by_square_rings() {
    for (drones, side) in [(1, 0), (9, 1), (25, 2), (49, 3)] {
        let matrix = formation(Kind::CompactMatrix, drones, 1.0);
        let places = places(&matrix);
        let rings = places.iter().map(|it| it.0.abs().max(it.1.abs()));
        assert_eq!(rings.max(), Some(side), "{drones} drones");
    }
}

#[test]
fn regular_matrix_is_filled_row_by_row() {
    let matrix = formation(Kind::RegularMatrix, 7, 100.0);
    assert_eq!(matrix.centre(), NodeId(4));
    assert_eq!(
        places(&matrix),
        [
            (100, -100),
            (100, 0),
            (100, 100),
            (0, -100),
            (0, 0),
            (0, 100),
            (-100, -100)
        ]
    );
}

#[test]
fn regular_matrices_give_the_distances_behind_tables_12_and_13() {
    // Law of the five experiments: the master takes 368 s; a drone at d metres from it takes 368 + d/10 + 12.4 s.
    for (drones, spacing_m, mean_s, maximum_s) in
        [(7, 100.0, 389.0, 394.5), (11, 160.0, 399.5, 416.2)]
    {
        let formation = formation(Kind::RegularMatrix, drones, spacing_m);
        let times_s: Vec<f64> = (0..)
            .zip(formation.slots())
            .map(|(id, slot)| {
                if NodeId(id) == formation.centre() {
                    368.0
                } else {
                    368.0 + slot.0.norm() / 10.0 + 12.4
                }
            })
            .collect();
        let mean = times_s.iter().sum::<f64>() / f64::from(drones);
        let maximum = times_s.iter().copied().fold(0.0, f64::max);
        assert!((mean - mean_s).abs() < 0.06, "{drones} drones: {mean} s");
        assert!(
            (maximum - maximum_s).abs() < 0.06,
            "{drones} drones: {maximum} s"
        );
    }
}

#[test]
fn matrices_of_34_and_more_drones_have_distinct_places() {
    // The predecessor's matrices have duplicates.
    for kind in [Kind::RegularMatrix, Kind::CompactMatrix] {
        for drones in 30..=400 {
            let distinct: BTreeSet<_> =
                places(&formation(kind, drones, 10.0)).into_iter().collect();
            assert_eq!(distinct.len(), drones as usize, "{kind:?}");
        }
    }
}

#[test]
fn split_up_places_the_remainder() {
    // The predecessor drops the remainder of (n - 1) / clusters.
    for drones in 2..=60 {
        for clusters in 1..=5 {
            let kind = Kind::SplitUp {
                clusters: many(clusters),
                distance_m: 300.0,
            };
            let placed: BTreeSet<_> = places(&formation(kind, drones, 50.0)).into_iter().collect();
            assert_eq!(placed.len(), drones as usize, "{clusters} clusters");
        }
    }
}

#[test]
fn diagonal_neighbours_of_a_mesh_are_the_spacing_apart() {
    // The predecessor offsets by i * d along each axis, which stretches diagonals by √2.
    let mesh = formation(Kind::CompactMesh, 61, 100.0);
    let stretched = 100.0 * 2.0_f64.sqrt();
    for (index, slot) in mesh.slots().iter().enumerate() {
        let others = mesh.slots().iter().enumerate();
        let nearest = others
            .filter(|(other, _)| *other != index)
            .map(|(_, other)| other.distance_m(*slot))
            .fold(f64::INFINITY, f64::min);
        assert!((nearest - 100.0).abs() < 1e-9 && nearest < stretched);
    }
}

#[test]
fn random_formation_depends_on_its_seed_only() {
    let slots = |seed| formation(Kind::Random { seed }, 200, 30.0);
    assert_eq!(slots(1), slots(1));
    assert_ne!(slots(1), slots(2));
}

#[test]
fn random_formation_is_connected() {
    let formation = formation(Kind::Random { seed: 7 }, 300, 100.0);
    for (index, slot) in formation.slots().iter().enumerate().skip(1) {
        let nearest = formation.slots()[..index]
            .iter()
            .map(|before| before.distance_m(*slot))
            .fold(f64::INFINITY, f64::min);
        assert!(
            nearest <= 150.001,
            "{index} is {nearest} m from the nearest drone"
        );
    }
}

#[test]
fn formations_of_4000_drones_keep_the_spacing() {
    for kind in [
        Kind::Linear,
        Kind::Circular,
        Kind::Random { seed: 3 },
        Kind::SplitUp {
            clusters: many(5),
            distance_m: 315.0,
        },
        Kind::CompactMesh,
        Kind::RegularMatrix,
        Kind::CompactMatrix,
    ] {
        let formation = formation(kind, 4_000, 20.0);
        assert_eq!(formation.drones(), 4_000);
        assert!(
            formation.slot_distance_min_m() >= 20.0 * (1.0 - 1e-9),
            "{kind:?}"
        );
    }
}

proptest! {
    #[test]
    fn slots_keep_the_spacing_and_are_centred(
        kind in kinds(),
        drones in 1_u32..300,
        spacing_m in 6.0..500.0_f64,
        heading_rad in -7.0..7.0_f64,
    ) {
        let formation = Formation::new(kind, many(drones), spacing_m, heading_rad);
        prop_assert_eq!(formation.drones(), drones);
        let slots = formation.slots();
        for (index, a) in slots.iter().enumerate() {
            for b in &slots[..index] {
                prop_assert!(a.distance_m(*b) >= spacing_m * (1.0 - 1e-9));
                prop_assert!(a.distance_m(*b) >= formation.slot_distance_min_m() - 1e-6);
            }
        }
        prop_assert!(slots[formation.centre().0 as usize].0.norm() < 1e-9);
    }

    #[test]
    fn succession_does_not_depend_on_heading_or_spacing(
        kind in kinds(),
        drones in 1_u32..300,
        spacing_m in 6.0..500.0_f64,
        heading_rad in -7.0..7.0_f64,
    ) {
        let formation = Formation::new(kind, many(drones), spacing_m, heading_rad);
        prop_assert_eq!(formation.ranks()[formation.centre().0 as usize], 0);
        let turned = Formation::new(kind, many(drones), spacing_m, heading_rad + 1.0);
        prop_assert_eq!(formation.ranks(), turned.ranks());
        if !matches!(kind, Kind::Random { .. }) {
            let wider = Formation::new(kind, many(drones), spacing_m * 1.7, heading_rad);
            prop_assert_eq!(formation.ranks(), wider.ranks());
        }
        let mut ranks = formation.ranks().to_vec();
        ranks.sort_unstable();
        prop_assert!(ranks.into_iter().eq(0..drones), "ranks are unique");
    }

    #[test]
    fn clusters_keep_distance_and_even_sizes_and_heads_come_first_in_succession(
        drones in 6_u32..200,
        clusters in 2_u32..6,
        spacing_m in 10.0..100.0_f64,
        distance_m in 100.0..500.0_f64,
    ) {
        let kind = Kind::SplitUp { clusters: many(clusters), distance_m };
        let formation = formation(kind, drones, spacing_m);
        let members = drones - 1;
        let mut first = 1;
        let mut bounds = Vec::new();
        for cluster in 0..clusters {
            let size = members / clusters + u32::from(cluster < members % clusters);
            bounds.push(first..first + size);
            // The heads come next in succession, and are within the master's radio range.
            prop_assert_eq!(formation.ranks()[first as usize], 1 + cluster);
            let head_m = formation.slots()[first as usize].0.norm();
            prop_assert!(head_m < distance_m.max(spacing_m + 1e-9));
            first += size;
        }
        prop_assert_eq!(first, drones);
        for (index, cluster) in bounds.iter().enumerate() {
            for other in &bounds[..index] {
                for a in cluster.clone() {
                    for b in other.clone() {
                        let apart = formation.slots()[a as usize]
                            .distance_m(formation.slots()[b as usize]);
                        prop_assert!(apart >= distance_m - 1e-6, "{a} and {b}: {apart} m");
                    }
                }
            }
        }
    }
}
