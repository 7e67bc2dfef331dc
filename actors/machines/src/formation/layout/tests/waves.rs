//! Take-off, crossing and landing in waves.

use super::*;
use crate::formation::{Change, Path, WaveLimits};

/// Altitude of the slots, in metres.
const SLOTS_M: f64 = 30.0;

fn in_waves(layout: Layout, layers_max: u32) -> Layout {
    let link_m = layout.formation().longest_link_m(f64::INFINITY);
    layout.in_waves(WaveLimits {
        layers_max,
        link_m,
        ground_link_m: 40.0,
        hops_max: u32::MAX,
        searches_on: false,
    })
}

/// Path of a drone between ground and slot; flown in either direction.
fn ground_path(layout: &Layout, ground: Ned, layer_m: f64, id: NodeId) -> [Path; 3] {
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

fn waiting_at(place: Ned) -> Path {
    Path {
        from: place,
        to: place,
    }
}

fn violate(paths: &[Path], others: &[Path]) -> bool {
    paths
        .iter()
        .any(|path| others.iter().any(|other| path.violates(*other, SEPARATION)))
}

/// Checks that drones waiting in their slots are clear of the paths of later waves, and that paths within a wave are
/// clear of each other, except for up to `exposed` pairs.
fn assert_apart(paths: &[[Path; 3]], wave_of: impl Fn(NodeId) -> u16, exposed: usize) {
    let at = |id: usize| NodeId(u32::try_from(id).unwrap());
    let mut violations_in_wave = 0;
    for (a, one) in paths.iter().enumerate() {
        for (b, other) in paths.iter().enumerate().take(a) {
            match wave_of(at(a)).cmp(&wave_of(at(b))) {
                Ordering::Equal => violations_in_wave += usize::from(violate(one, other)),
                Ordering::Less => {
                    assert!(!violate(&[waiting_at(one[2].to)], other), "{b} passes {a}");
                }
                Ordering::Greater => {
                    assert!(!violate(&[waiting_at(other[2].to)], one), "{a} passes {b}");
                }
            }
        }
    }
    assert!(
        violations_in_wave <= exposed,
        "{violations_in_wave} of {exposed}"
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn wave_is_clear_of_earlier_waves_and_of_itself(
        kind in kinds(),
        drones in 2_u32..50,
        ground in grounds(),
        layers_max in 1_u32..6,
        heading_rad in 0.0..6.3_f64,
    ) {
        let layout = Layout::new(formation(kind, drones, 60.0, heading_rad), 10.0, SEPARATION)
            .with_ground(ground);
        let layout = in_waves(layout, layers_max);
        let layers_m = layout.take_off_layers_m();
        let up: Vec<_> = (0..drones).map(NodeId).map(|id| {
            let stand = layout.take_off_place(id, Ned::HOME);
            ground_path(&layout, stand, layers_m[id.0 as usize], id)
        }).collect();
        let exposed = layout.take_off_paths().places.layer_plan.exposed;
        assert_apart(&up, |id| layout.take_off_wave(id), exposed);

        // A landing is flown in the reverse direction, with its waves reversed.
        let layers_m = layout.landing_layers_m();
        let down: Vec<_> = (0..drones).map(NodeId).map(|id| {
            let place = layout.landing_place(id, Ned::HOME);
            ground_path(&layout, place, layers_m[id.0 as usize], id)
        }).collect();
        let last = layout.landing_waves() - 1;
        let exposed = layout.landing.places.layer_plan.exposed;
        assert_apart(&down, |id| last - layout.landing_wave(id), exposed);

        let master = layout.formation().centre();
        prop_assert_eq!((layout.take_off_wave(master), layout.landing_wave(master)), (0, last));
    }

    #[test]
    fn crossing_wave_is_clear_of_drones_waiting_in_their_sectors(
        from in kinds(),
        to in kinds(),
        drones in 2_u32..50,
        layers_max in 1_u32..4,
    ) {
        let layout = Layout::new(formation(from, drones, 60.0, 0.0), 10.0, SEPARATION);
        let layout = in_waves(layout, layers_max);
        let change = Change::new(0, &layout, formation(to, drones, 60.0, 0.0));
        let at = Ned::new(0.0, 0.0, -SLOTS_M);
        let paths: Vec<_> = (0..drones).map(NodeId).map(|id| {
            let [from, to, _] = change.path(id, at);
            (change.wave(id), Path { from, to })
        }).collect();
        for (a, (wave, path)) in paths.iter().enumerate() {
            for (other_wave, other) in &paths[..a] {
                let violates_waiting = match wave.cmp(other_wave) {
                    Ordering::Equal => false,
                    // The later one waits at its start, the earlier one at its end.
                    Ordering::Less => violate(&[*path], &[waiting_at(other.from)])
                        || violate(&[*other], &[waiting_at(path.to)]),
                    Ordering::Greater => violate(&[*other], &[waiting_at(path.from)])
                        || violate(&[*path], &[waiting_at(other.to)]),
                };
                let violates_flying = wave == other_wave && violate(&[*path], &[*other]);
                prop_assert!(!violates_waiting && !violates_flying, "{wave} and {other_wave}");
            }
        }
    }
}

#[test]
fn hundred_drones_in_a_grid_fly_in_waves_with_eight_layers() {
    let layout = Layout::new(
        formation(Kind::RegularMatrix, 100, 100.0, 0.0),
        10.0,
        SEPARATION,
    );
    assert!(layout.take_off_layers_m().iter().any(|it| *it > 8.0 * 5.5));
    let layout = in_waves(layout, 8);
    assert!(layout.take_off_layers_m().iter().all(|it| *it <= 8.0 * 5.5));
    assert!(
        (2..=10).contains(&layout.take_off_waves()),
        "{}",
        layout.take_off_waves()
    );
    assert_eq!(layout.take_off_waves(), layout.landing_waves());
}

#[test]
fn all_fly_in_one_wave_if_layers_suffice() {
    let layout = in_waves(Layout::new(line(15, 160.0, 0.0), 10.0, SEPARATION), 3);
    assert_eq!((layout.take_off_waves(), layout.landing_waves()), (1, 1));
}
