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

/// A flight up a slope and back, with a change at the first corner.
fn with_plan(check: impl FnOnce(FlightPlan<'_>)) {
    let layout =
        Layout::new(formation(Kind::Linear), 10.0, SEPARATION).with_layers(Layering::PerDrone);
    let changes = [Change::new(1, &layout, formation(Kind::Circular))];
    let waypoints = [(0.0, 20.0), (100.0, 35.0), (50.0, 30.0)]
        .map(|(north_m, altitude_m)| Ned::new(north_m, 0.0, -altitude_m));
    check(FlightPlan {
        layout: &layout,
        changes: &changes,
        waypoints: &waypoints,
    });
}

#[test]
fn phases_lead_from_ground_to_ground_without_a_gap() {
    with_plan(|plan| {
        let phases: Vec<Phase> = plan.phases().collect();
        let kinds: Vec<PhaseKind> = phases.iter().map(|phase| phase.kind).collect();
        let change = 0;
        assert_eq!(
            kinds,
            [
                PhaseKind::TakeOff { wave: 0 },
                PhaseKind::Leg { to: 1 },
                PhaseKind::Climb { change },
                PhaseKind::Cross { change, wave: 0 },
                PhaseKind::Descend { change },
                PhaseKind::Leg { to: 2 },
                PhaseKind::Land { wave: 0 },
            ]
        );
        for id in (0..5).map(NodeId) {
            let paths = phases.iter().flat_map(|phase| &phase.paths[id.0 as usize]);
            let paths: Vec<&Path> = paths.collect();
            assert_eq!(paths[0].from, plan.layout.take_off_place(id, Ned::HOME));
            for pair in paths.windows(2) {
                assert!(pair[0].to.distance_m(pair[1].from) < 1e-9, "{id}: {pair:?}");
            }
            let last = paths[paths.len() - 1].to;
            let place = plan.layout_after(1).landing_place(id, plan.waypoints[2]);
            assert_eq!(last, place.at_altitude(0.0));
        }
    });
}

#[test]
fn only_legs_are_translations() {
    with_plan(|plan| {
        for phase in plan.phases() {
            let is_leg = matches!(phase.kind, PhaseKind::Leg { .. });
            assert_eq!(phase.is_translation(), is_leg, "{:?}", phase.kind);
        }
    });
}

#[test]
fn drone_out_of_lockstep_flies_above_all_waypoints_and_lands_below_slot() {
    with_plan(|plan| {
        for phase in plan.phases() {
            let tubes = plan.tubes_alone(&phase, &plan.landing_places_alone());
            let own: Vec<_> = tubes.iter().filter(|(id, _)| *id == NodeId(3)).collect();
            let highest_m = own
                .iter()
                .map(|(_, tube)| -tube.bounds().low.z)
                .fold(0.0, f64::max);
            let waypoint = plan.waypoints[phase.waypoint];
            let alone_m = plan.altitude_alone_m(NodeId(3), phase.changes, waypoint);
            assert!((highest_m - alone_m).abs() < 1e-9, "{:?}", phase.kind);
            assert!(highest_m > 35.0);
            let lands = own.iter().any(|(_, tube)| tube.bounds().high.z > -1e-9);
            assert_eq!(lands, matches!(phase.kind, PhaseKind::Land { .. }));
        }
    });
}
