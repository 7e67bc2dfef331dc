use proptest::prelude::*;

use super::*;

const SEPARATION: Separation = Separation {
    horizontal_m: 5.0,
    vertical_m: 5.0,
};

fn line(drones: u32, spacing_m: f64, heading_rad: f64) -> Formation {
    let drones = NonZeroU32::new(drones).unwrap();
    Formation::new(Kind::Linear, drones, spacing_m, heading_rad)
}

fn nearest_pair_m(places: &[Ned]) -> f64 {
    let pairs = places
        .iter()
        .enumerate()
        .flat_map(|(index, a)| places[index + 1..].iter().map(|b| a.distance_m(*b)));
    pairs.fold(f64::INFINITY, f64::min)
}

#[test]
fn a_line_stands_across_its_heading_with_the_master_in_the_middle() {
    let formation = line(5, 160.0, 0.0);
    let east: Vec<_> = formation.slots().iter().map(|slot| slot.east_m()).collect();
    assert_eq!(east, [-320.0, -160.0, 0.0, 160.0, 320.0]);
    assert_eq!(formation.centre(), NodeId(2));
}

#[test]
fn succession_goes_from_the_centre_outwards() {
    assert_eq!(line(5, 160.0, 0.0).ranks(), [3, 1, 0, 2, 4]);
}

#[test]
fn a_line_across_the_legs_needs_no_layers() {
    let layout = Layout::new(line(15, 160.0, 0.0), 10.0, SEPARATION);
    let north = [Ned::new(0.0, 0.0, -25.0), Ned::new(400.0, 100.0, -25.0)];
    assert_eq!(*layout.layers_m(&north), [0.0; 15]);
}

#[test]
fn a_line_along_the_legs_has_a_layer_for_each_drone() {
    let layout = Layout::new(line(4, 160.0, 0.0), 10.0, SEPARATION);
    let east = [Ned::new(0.0, 0.0, -25.0), Ned::new(0.0, 1_000.0, -25.0)];
    let mut layers = layout.layers_m(&east).to_vec();
    layers.sort_by(f64::total_cmp);
    assert_eq!(layers, [5.5, 11.0, 16.5, 22.0]);
}

#[test]
fn only_neighbours_on_a_short_leg_share_no_layer() {
    let layout = Layout::new(line(4, 160.0, 0.0), 10.0, SEPARATION);
    let east = [Ned::new(0.0, 0.0, -25.0), Ned::new(0.0, 170.0, -25.0)];
    assert_eq!(*layout.layers_m(&east), [5.5, 11.0, 5.5, 11.0]);
}

proptest! {
    #[test]
    fn slots_are_the_spacing_apart_and_centred(
        drones in 1_u32..60,
        spacing_m in 6.0..500.0_f64,
        heading_rad in -7.0..7.0_f64,
    ) {
        let formation = line(drones, spacing_m, heading_rad);
        prop_assert!(nearest_pair_m(formation.slots()) >= spacing_m * (1.0 - 1e-9));
        prop_assert!(formation.slots()[formation.centre().0 as usize].0.norm() < 1e-9);
        let mut ranks = formation.ranks();
        prop_assert_eq!(ranks[formation.centre().0 as usize], 0);
        ranks.sort_unstable();
        prop_assert!(ranks.into_iter().eq(0..drones), "ranks are unique");
    }

    #[test]
    fn landing_places_are_the_gap_apart(drones in 1_u32..60, gap_m in 6.0..100.0_f64) {
        let gathered = line(drones, 160.0, 0.5).gathered(gap_m);
        prop_assert!(nearest_pair_m(&gathered) >= gap_m * (1.0 - 1e-9));
    }

    #[test]
    fn drones_whose_ways_cross_differ_by_the_vertical_minimum(
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
            let way = leg[1] - leg[0];
            for a in 0..6 {
                for b in 0..a {
                    // One stands at its slot, the other flies its whole leg past it.
                    let nearest = (0..=200).map(|part| {
                        let flown = Ned(way.0 * (f64::from(part) / 200.0));
                        (slots[b] + flown).horizontal_distance_m(slots[a])
                    }).fold(f64::INFINITY, f64::min);
                    let apart = (layers[a] - layers[b]).abs() >= 5.0;
                    prop_assert!(apart || nearest >= 5.0, "{a} and {b}: {nearest} m");
                }
            }
        }
    }
}
