use std::num::NonZeroU32;

use proptest::prelude::*;

use super::*;
use crate::formation::tests::kinds;
use crate::formation::{Assignment, Change, Formation, Ground, Kind, Layering, Layout};
use crate::geometry::Ned;

const SEPARATION: Separation = Separation {
    horizontal_m: 5.0,
    vertical_m: 5.0,
};

fn formation(kind: Kind, drones: u32, spacing_m: f64, heading_rad: f64) -> Formation {
    Formation::new(
        kind,
        NonZeroU32::new(drones).unwrap(),
        spacing_m,
        heading_rad,
    )
}

fn at(north_m: f64, altitude_m: f64) -> Ned {
    Ned::new(north_m, 0.0, -altitude_m)
}

/// Exposures of a line of five drones along its legs, by phase.
fn exposures_of_a_line(waypoints: &[Ned]) -> Vec<Vec<(Exposure, Proximity)>> {
    let along = std::f64::consts::FRAC_PI_2;
    let layout = Layout::new(formation(Kind::Linear, 5, 20.0, along), 10.0, SEPARATION)
        .with_layers(Layering::PerDrone);
    let flown = FlightPlan {
        layout: &layout,
        changes: &[],
        waypoints,
    };
    flown.exposures().collect()
}

fn pairs(of: &[(Exposure, Proximity)], exposure: Exposure) -> usize {
    let (_, nearness) = of.iter().find(|(it, _)| *it == exposure).unwrap();
    nearness.conflicts.len()
}

#[test]
fn late_drone_in_a_column_conflicts_with_those_behind_it() {
    // A leg of 30 m leads past one slot, one of 50 m past two slots.
    for (length_m, pairs_passed) in [(30.0, 4), (50.0, 7), (14.0, 0)] {
        let of = exposures_of_a_line(&[at(0.0, 20.0), at(length_m, 20.0)]);
        // Either drone of a pair may be late.
        assert_eq!(
            pairs(&of[1], Exposure::Late),
            2 * pairs_passed,
            "{length_m} m"
        );
    }
}

#[test]
fn drone_in_its_own_layer_is_above_a_slope() {
    let of = exposures_of_a_line(&[at(0.0, 20.0), at(14.0, 40.0)]);
    assert_eq!(pairs(&of[1], Exposure::Apart), 0);
}

#[test]
fn drones_alone_on_different_legs_come_near_each_other() {
    // Two legs along a line of drones 20 m apart, of 14 m each: the second leads past where the next drone began, through its climb
    // if that has a higher layer. The way back is on the same lines.
    let along = std::f64::consts::FRAC_PI_2;
    let there = [0.0, 14.0, 28.0];
    let [near, back] = [&there[..], &[0.0, 14.0, 28.0, 14.0, 28.0]].map(|norths_m| {
        let waypoints: Vec<Ned> = norths_m.iter().map(|it| at(*it, 20.0)).collect();
        let layout = Layout::new(formation(Kind::Linear, 5, 20.0, along), 10.0, SEPARATION)
            .with_layers(Layering::PerDrone);
        let flown = FlightPlan {
            layout: &layout,
            changes: &[],
            waypoints: &waypoints,
        };
        let of: Vec<_> = flown.exposures().collect();
        let legs = 1..waypoints.len();
        legs.map(|leg| pairs(&of[leg], Exposure::BothApart))
            .collect::<Vec<_>>()
    });
    assert_eq!(near, [0, 2 * 4]);
    // A leg that is flown again is exposed again.
    assert_eq!(back, [0, 2 * 4, 2 * 4, 2 * 4]);
}

#[test]
fn drones_that_land_on_the_way_come_near_others_in_a_shared_layer() {
    // They draw together to land, over the slots of others. With a layer for each, all land below their slots.
    for (layering, is_exposed) in [(Layering::PerDrone, false), (Layering::Shared, true)] {
        let drawn = formation(Kind::Random { seed: 1 }, 20, 20.0, 0.0);
        let layout = Layout::new(drawn, 10.0, SEPARATION).with_layers(layering);
        let flown = FlightPlan {
            layout: &layout,
            changes: &[],
            waypoints: &[at(0.0, 20.0), at(100.0, 20.0)],
        };
        let take_off = flown.exposures().next().unwrap();
        let is_near = pairs(&take_off, Exposure::BothApart) > 0;
        assert_eq!(is_near, is_exposed, "{layering:?}");
    }
}

#[test]
fn part_that_lands_around_an_earlier_waypoint_comes_near_those_that_land_around_the_last() {
    // Drawn together, drones of a line along the leg are 10 m apart.
    for (length_m, pairs_near) in [(20.0, 3), (24.0, 3), (26.0, 2), (60.0, 0)] {
        let waypoints = [at(0.0, 20.0), at(length_m, 20.0)];
        let layout = Layout::new(formation(Kind::Linear, 5, 20.0, 0.0), 10.0, SEPARATION);
        let flown = FlightPlan {
            layout: &layout,
            changes: &[],
            waypoints: &waypoints,
        };
        let of = flown.exposures().last().unwrap();
        assert_eq!(pairs(&of, Exposure::Apart), pairs_near, "{length_m} m");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]
    #[test]
    fn drones_in_lockstep_keep_the_separation(
        kinds in (kinds(), kinds()),
        grid in any::<bool>(),
        drones in 2_u32..16,
        spacing_m in 12.0..80.0_f64,
        heading_rad in 0.0..6.3_f64,
        each in any::<bool>(),
        legs in prop::collection::vec((0.0..6.3_f64, 5.0..200.0_f64, 12.0..60.0_f64), 0..4),
    ) {
        let ground = if grid { Ground::Grid(Assignment::Optimal) } else { Ground::Gathered };
        let layering = if each { Layering::PerDrone } else { Layering::Shared };
        let layout = Layout::new(formation(kinds.0, drones, spacing_m, heading_rad), 10.0, SEPARATION)
            .with_ground(ground)
            .with_layers(layering);
        let mut waypoints = vec![at(0.0, 20.0)];
        for (course_rad, length_m, altitude_m) in legs {
            let last = waypoints[waypoints.len() - 1];
            let next = last + at(length_m, 0.0).turned(course_rad);
            waypoints.push(next.at_altitude(altitude_m));
        }
        let change_at = u16::try_from(waypoints.len() / 2).unwrap();
        let after = formation(kinds.1, drones, spacing_m + 3.0, heading_rad + 1.0);
        let changes = if waypoints.len() > 1 {
            vec![Change::new(change_at, &layout, after)]
        } else {
            Vec::new()
        };
        let flown = FlightPlan { layout: &layout, changes: &changes, waypoints: &waypoints };
        for PhaseSeparation { phase, lockstep, .. } in flown.in_lockstep() {
            prop_assert!(lockstep.conflicts.is_empty(), "{:?}: {:?}", phase.kind, lockstep.closest);
            let ratio = lockstep.closest.unwrap().clearance.ratio;
            prop_assert!(ratio >= 1.0, "{:?}: {}", phase.kind, ratio);
        }
    }

    #[test]
    fn search_finds_the_closest_approach_and_all_conflicts(
        kind in kinds(),
        drones in 2_u32..9,
        spacing_m in 12.0..60.0_f64,
        length_m in 5.0..100.0_f64,
    ) {
        let layout = Layout::new(formation(kind, drones, spacing_m, 0.3), 10.0, SEPARATION);
        let waypoints = [at(0.0, 20.0), at(length_m, 30.0)];
        let flown = FlightPlan { layout: &layout, changes: &[], waypoints: &waypoints };
        let leg = flown.phases().nth(1).unwrap();
        let of = flown.exposures().nth(1).unwrap();
        let late = &of[0].1;
        let mut closest = f64::INFINITY;
        let mut conflicts = BTreeSet::new();
        for (a, one) in tubes(&leg) {
            for (b, other) in tubes(&leg).filter(|(b, _)| a != *b) {
                let (one, other) = (Tube::from(one), Tube::from(other));
                closest = closest.min(one.clearance(other, SEPARATION).ratio);
                if one.violates(other, SEPARATION) {
                    conflicts.insert([a, b]);
                }
            }
        }
        prop_assert_eq!(&late.conflicts, &conflicts);
        prop_assert!((late.closest.unwrap().clearance.ratio - closest).abs() < 1e-9);
    }
}
