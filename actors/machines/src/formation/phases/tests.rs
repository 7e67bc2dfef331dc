use std::num::NonZeroU32;

use super::*;
use crate::formation::{Change, Formation, Kind, Layering, Layout, Separation};

const SEPARATION: Separation = Separation {
    horizontal_m: 5.0,
    vertical_m: 5.0,
};

fn formation(kind: Kind) -> Formation {
    Formation::new(kind, NonZeroU32::new(5).unwrap(), 40.0, 0.3)
}

/// Up a slope and back, with a change at the first corner.
fn flown(look: impl FnOnce(Flown<'_>)) {
    let layout = Layout::new(formation(Kind::Linear), 10.0, SEPARATION).with_layers(Layering::Each);
    let changes = [Change::new(1, &layout, formation(Kind::Circular))];
    let waypoints = [(0.0, 20.0), (100.0, 35.0), (50.0, 30.0)]
        .map(|(north_m, altitude_m)| Ned::new(north_m, 0.0, -altitude_m));
    look(Flown {
        layout: &layout,
        changes: &changes,
        waypoints: &waypoints,
    });
}

#[test]
fn phases_lead_from_the_ground_to_the_ground_without_a_gap() {
    flown(|flown| {
        let phases: Vec<Phase> = flown.phases().collect();
        let acts: Vec<Act> = phases.iter().map(|phase| phase.act).collect();
        let change = 0;
        assert_eq!(
            acts,
            [
                Act::TakesOff { wave: 0 },
                Act::Flies { to: 1 },
                Act::Climbs { change },
                Act::Crosses { change, wave: 0 },
                Act::Descends { change },
                Act::Flies { to: 2 },
                Act::Lands { wave: 0 },
            ]
        );
        for id in (0..5).map(NodeId) {
            let paths = phases.iter().flat_map(|phase| &phase.paths[id.0 as usize]);
            let paths: Vec<&Path> = paths.collect();
            assert_eq!(paths[0].from, flown.layout.stand(id, Ned::HOME));
            for pair in paths.windows(2) {
                assert!(pair[0].to.distance_m(pair[1].from) < 1e-9, "{id}: {pair:?}");
            }
            let last = paths[paths.len() - 1].to;
            let place = flown.layout_after(1).place(id, flown.waypoints[2]);
            assert_eq!(last, place.at_altitude(0.0));
        }
    });
}

#[test]
fn in_lockstep_only_legs_are_flown_by_all_alike() {
    flown(|flown| {
        for phase in flown.phases() {
            let is_leg = matches!(phase.act, Act::Flies { .. });
            assert_eq!(phase.is_translation(), is_leg, "{:?}", phase.act);
        }
    });
}

#[test]
fn one_that_is_out_of_lockstep_flies_above_all_waypoints_and_lands_below_its_slot() {
    flown(|flown| {
        for phase in flown.phases() {
            let tubes = flown.tubes_alone(&phase);
            let own: Vec<_> = tubes.iter().filter(|(id, _)| *id == NodeId(3)).collect();
            let highest_m = own
                .iter()
                .map(|(_, tube)| -tube.bounds().low.z)
                .fold(0.0, f64::max);
            let waypoint = flown.waypoints[phase.waypoint];
            let alone_m = flown.altitude_alone_m(NodeId(3), phase.changes, waypoint);
            assert!((highest_m - alone_m).abs() < 1e-9, "{:?}", phase.act);
            assert!(highest_m > 35.0);
            let lands = own.iter().any(|(_, tube)| tube.bounds().high.z > -1e-9);
            assert_eq!(lands, matches!(phase.act, Act::Lands { .. }));
        }
    });
}
