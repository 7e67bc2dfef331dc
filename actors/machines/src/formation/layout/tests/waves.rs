//! Drones that take off, cross and land in waves.

use super::*;
use crate::formation::{Change, Path};

/// The height of the slots, in metres.
const SLOTS_M: f64 = 30.0;

/// The way of a drone between ground and slot, flown either way.
fn way_up(layout: &Layout, ground: Ned, layer_m: f64, id: NodeId) -> [Path; 3] {
    let slot = layout.slot(id, Ned::new(0.0, 0.0, -SLOTS_M));
    let level_m = SLOTS_M + layer_m;
    let corners = [
        ground,
        ground.at_altitude(level_m),
        slot.at_altitude(level_m),
        slot,
    ];
    [0, 1, 2].map(|at| Path {
        from: corners[at],
        to: corners[at + 1],
    })
}

fn standing(place: Ned) -> Path {
    Path {
        from: place,
        to: place,
    }
}

fn near(paths: &[Path], others: &[Path]) -> bool {
    paths.iter().any(|path| {
        others
            .iter()
            .any(|other| path.comes_near(*other, SEPARATION))
    })
}

/// Drones that rest in their slots are clear of the ways of the waves after them, and ways of one wave of each other, except
/// so many pairs.
fn assert_apart(paths: &[[Path; 3]], wave_of: impl Fn(NodeId) -> u16, exposed: usize) {
    let at = |id: usize| NodeId(u32::try_from(id).unwrap());
    let mut near_in_wave = 0;
    for (a, one) in paths.iter().enumerate() {
        for (b, other) in paths.iter().enumerate().take(a) {
            match wave_of(at(a)).cmp(&wave_of(at(b))) {
                Ordering::Equal => near_in_wave += usize::from(near(one, other)),
                Ordering::Less => assert!(!near(&[standing(one[2].to)], other), "{b} passes {a}"),
                Ordering::Greater => {
                    assert!(!near(&[standing(other[2].to)], one), "{a} passes {b}");
                }
            }
        }
    }
    assert!(near_in_wave <= exposed, "{near_in_wave} of {exposed}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn a_wave_flies_clear_of_those_that_have_flown_and_of_itself(
        kind in kinds(),
        drones in 2_u32..50,
        ground in grounds(),
        layers_max in 1_u32..6,
        heading_rad in 0.0..6.3_f64,
    ) {
        let layout = Layout::new(formation(kind, drones, 60.0, heading_rad), 10.0, SEPARATION)
            .standing(ground)
            .in_waves(layers_max);
        let layers_m = layout.take_off_layers_m();
        let up: Vec<_> = (0..drones).map(NodeId).map(|id| {
            let stand = layout.stand(id, Ned::HOME);
            way_up(&layout, stand, layers_m[id.0 as usize], id)
        }).collect();
        let exposed = layout.take_off().arranged.stack.exposed;
        assert_apart(&up, |id| layout.take_off_wave(id), exposed);

        // A landing is flown the other way round, and its waves are reversed.
        let layers_m = layout.landing_layers_m();
        let down: Vec<_> = (0..drones).map(NodeId).map(|id| {
            let place = layout.place(id, Ned::HOME);
            way_up(&layout, place, layers_m[id.0 as usize], id)
        }).collect();
        let last = layout.landing_waves() - 1;
        let exposed = layout.landing.arranged.stack.exposed;
        assert_apart(&down, |id| last - layout.landing_wave(id), exposed);

        let master = layout.formation().centre();
        prop_assert_eq!((layout.take_off_wave(master), layout.landing_wave(master)), (0, last));
    }

    #[test]
    fn a_wave_crosses_clear_of_those_that_rest_in_their_sectors(
        from in kinds(),
        to in kinds(),
        drones in 2_u32..50,
        layers_max in 1_u32..4,
    ) {
        let layout = Layout::new(formation(from, drones, 60.0, 0.0), 10.0, SEPARATION)
            .in_waves(layers_max);
        let change = Change::new(0, &layout, formation(to, drones, 60.0, 0.0));
        let at = Ned::new(0.0, 0.0, -SLOTS_M);
        let paths: Vec<_> = (0..drones).map(NodeId).map(|id| {
            let [from, to, _] = change.path(id, at);
            (change.wave(id), Path { from, to })
        }).collect();
        for (a, (wave, path)) in paths.iter().enumerate() {
            for (other_wave, other) in &paths[..a] {
                let rests = match wave.cmp(other_wave) {
                    Ordering::Equal => false,
                    // The later one rests where it begins, the earlier one where it ends.
                    Ordering::Less => near(&[*path], &[standing(other.from)])
                        || near(&[*other], &[standing(path.to)]),
                    Ordering::Greater => near(&[*other], &[standing(path.from)])
                        || near(&[*path], &[standing(other.to)]),
                };
                let meets = wave == other_wave && near(&[*path], &[*other]);
                prop_assert!(!rests && !meets, "{wave} and {other_wave}");
            }
        }
    }
}

#[test]
fn a_hundred_drones_in_a_grid_do_with_eight_layers() {
    let layout = Layout::new(
        formation(Kind::RegularMatrix, 100, 100.0, 0.0),
        10.0,
        SEPARATION,
    );
    assert!(layout.take_off_layers_m().iter().any(|it| *it > 8.0 * 5.5));
    let layout = layout.in_waves(8);
    assert!(layout.take_off_layers_m().iter().all(|it| *it <= 8.0 * 5.5));
    assert!(
        (2..=10).contains(&layout.take_off_waves()),
        "{}",
        layout.take_off_waves()
    );
    assert_eq!(layout.take_off_waves(), layout.landing_waves());
}

#[test]
fn where_layers_do_all_fly_in_one_wave() {
    let layout = Layout::new(line(15, 160.0, 0.0), 10.0, SEPARATION).in_waves(3);
    assert_eq!((layout.take_off_waves(), layout.landing_waves()), (1, 1));
}
