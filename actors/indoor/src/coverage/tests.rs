use std::collections::BTreeSet;
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

use super::*;
use crate::frames::MapPose;
use crate::map::{Header, Map};

const FLAT: &str = "
########################
#..........#...........#
#......................#
#......................#
#......................#
#..........#...........#
####...#########...#####
#..........#...........#
#..........#...........#
#..........#...........#
#..........#...........#
########################";

const VIEW: View = View {
    range_m: 3.0,
    cone_rad: 1.0,
};

/// The flat, 30 cm a character in cells of 5 cm.
fn floor() -> Floor {
    let wide: Vec<String> = FLAT
        .lines()
        .flat_map(|line| {
            let line: String = line.chars().flat_map(|it| [it; 6]).collect();
            vec![line; 6]
        })
        .collect();
    let map = Map::from_text(&wide.join("\n"), 0.05).unwrap();
    Floor::new(Arc::new(map), 0.25)
}

const START: MapXy = MapXy::new(0.9, 2.6);

fn seen_from(floor: &Floor, places: &Places, stops: &[MapXy]) -> Seen {
    let mut seen = Seen::none(places.targets().len());
    for stop in stops {
        let pose = MapPose::new(stop.x_m, stop.y_m, 0.0);
        places
            .targets()
            .look(floor.map(), pose, VIEW.all_round(), &mut seen);
    }
    seen
}

#[test]
fn tours_see_all_that_can_be_seen() {
    let floor = floor();
    let (tours, places) = plan(&floor, VIEW, &[START], 2.0).unwrap();
    let [tour] = &tours[..] else {
        panic!("one drone")
    };
    let seen = seen_from(&floor, &places, &tour.stops);
    assert_eq!(seen.missing(places.visible()), 0);
    // All rooms are open, so nothing is hidden.
    assert_eq!(places.visible().len(), places.targets().len());
    assert!((3..=12).contains(&tour.stops.len()), "{}", tour.stops.len());
}

#[test]
fn walls_hide_and_the_cone_limits_the_view() {
    let floor = floor();
    let targets = Targets::new(floor.map()).unwrap();
    let look = |heading_rad: f64, view: View| {
        let mut seen = Seen::none(targets.len());
        let pose = MapPose::new(1.5, 1.0, heading_rad);
        targets.look(floor.map(), pose, view, &mut seen);
        (0..targets.len())
            .filter(|it| seen.contains(*it))
            .collect::<BTreeSet<_>>()
    };
    let round = look(0.0, VIEW.all_round());
    assert!(round.iter().all(|it| targets.centre(*it).x_m < 3.5));
    let east = look(0.0, VIEW);
    let north = look(FRAC_PI_2, VIEW);
    assert!(east.is_subset(&round) && !east.is_empty() && east.is_disjoint(&north));
    let near = look(
        0.0,
        View {
            range_m: 0.9,
            ..VIEW
        },
    );
    assert!(near.is_subset(&east) && near.len() < east.len());
}

#[test]
fn shared_tours_see_all_together_and_are_about_as_long() {
    let floor = floor();
    let turn_m = 2.0;
    let whole = &plan(&floor, VIEW, &[START], turn_m).unwrap().0[0];
    let cost = |tour: &Tour| tour.length_m + turn_m * tour.stops.len() as f64;
    for drones in 2..=3 {
        let starts = vec![START; drones];
        let (tours, places) = plan(&floor, VIEW, &starts, turn_m).unwrap();
        let stops: Vec<_> = tours.iter().flat_map(|tour| tour.stops.clone()).collect();
        assert_eq!(
            seen_from(&floor, &places, &stops).missing(places.visible()),
            0
        );
        let longest = tours.iter().map(cost).fold(0.0, f64::max);
        assert!(longest < cost(whole), "{drones}: {longest}");
        // The bound of splitting a tour: an equal share, and the way there.
        let farthest = 9.0 + turn_m;
        assert!(
            longest <= cost(whole) / drones as f64 + farthest,
            "{drones}: {longest}"
        );
        assert_eq!(tours, plan(&floor, VIEW, &starts, turn_m).unwrap().0);
    }
}

#[test]
fn what_no_drone_can_get_to_is_seen_through_the_gap_only() {
    // The room on the right has a gap that is too narrow to pass.
    let plan_text = "
##########
#...#....#
#........#
#...#....#
##########";
    let wide: Vec<String> = plan_text
        .lines()
        .flat_map(|line| {
            let line: String = line.chars().flat_map(|it| [it; 8]).collect();
            vec![line; 8]
        })
        .collect();
    let map = Map::from_text(&wide.join("\n"), 0.05).unwrap();
    let floor = Floor::new(Arc::new(map), 0.3);
    let (_, places) = plan(&floor, VIEW, &[MapXy::new(1.0, 1.0)], 2.0).unwrap();
    let (visible, all) = (places.visible().len(), places.targets().len());
    assert!(visible < all && visible > all / 3, "{visible} of {all}");
}

#[test]
fn starts_in_walls_or_apart_are_refused() {
    let floor = floor();
    let wall = MapXy::new(0.1, 0.1);
    assert_eq!(
        plan(&floor, VIEW, &[wall], 2.0).unwrap_err(),
        PlanError::Start(wall)
    );
    assert_eq!(
        plan(&floor, VIEW, &[], 2.0).unwrap_err(),
        PlanError::NoDrone
    );
}

#[test]
fn a_drone_without_a_size_can_be_at_the_edge_of_the_map() {
    let map = Map::from_text(&"......\n".repeat(6), 0.4).unwrap();
    let floor = Floor::new(Arc::new(map), 0.0);
    let (_, places) = plan(&floor, VIEW, &[MapXy::new(1.0, 1.0)], 2.0).unwrap();
    assert_eq!(places.visible().len(), places.targets().len());
}

#[test]
fn maps_too_large_for_tours_are_refused() {
    let open = |side: usize, resolution_m: f64| {
        let plan = format!("{}\n", ".".repeat(side)).repeat(side);
        Floor::new(Arc::new(Map::from_text(&plan, resolution_m).unwrap()), 0.0)
    };
    let refused = |floor: &Floor, range_m: f64| {
        let view = View { range_m, ..VIEW };
        match plan(floor, view, &[MapXy::new(1.0, 1.0)], 2.0) {
            Err(PlanError::TooLarge { what, .. }) => what,
            other => panic!("{other:?}"),
        }
    };
    // A plan of ten kilobytes that is a square kilometre.
    assert_eq!(refused(&open(100, 10.0), 4.0), "squares of 20 cm");
    let looks = "targets to look at from all places";
    assert_eq!(refused(&open(480, 0.4), 20.0), looks);
    assert_eq!(refused(&open(48, 0.4), 0.25), "stops");
}

/// The flat, turned by 0.3 rad.
fn turned() -> Floor {
    let text = format!(
        "resolution: 0.05\ncells_per_character: 6\norigin: [3.0, -2.0, 0.3]\nplan: |{}\n",
        FLAT.replace('\n', "\n  ")
    );
    let map = Map::parse(&Header::parse(&text).unwrap(), &[]).unwrap();
    Floor::new(Arc::new(map), 0.25)
}

/// Rays for all stops of a tour take up to 0.3 s.
#[test]
fn what_is_seen_from_a_stop_is_known_without_rays() {
    let turned = turned();
    let start = turned
        .map()
        .origin()
        .place(crate::frames::BodyXy::new(0.9, 2.6));
    for (floor, start) in [(floor(), START), (turned, start)] {
        let map = floor.map();
        let (tours, places) = plan(&floor, VIEW, &[start], 2.0).unwrap();
        let stops = &tours[0].stops;
        assert!(!stops.is_empty());
        for stop in stops.iter().chain([&start]) {
            assert!(places.sight(map, *stop).is_some(), "{stop:?}");
        }
        let beside = stops[0].towards(0.5, 0.03);
        assert!(places.sight(map, beside).is_none());
        let mut before = Seen::none(places.targets().len());
        for point in stops.iter().copied().chain([start, beside]) {
            let looked = seen_from(&floor, &places, &[point]);
            let mut stored = Seen::none(places.targets().len());
            places.look_round(map, point, &mut stored);
            assert_eq!(stored, looked, "{point:?}");
            let new = before.missing_of(&looked);
            let new = new.filter(|target| places.visible().contains(*target));
            assert_eq!(
                places.added_from(map, point, &before),
                new.count(),
                "{point:?}"
            );
            places.look_round(map, point, &mut before);
            assert_eq!(places.added_from(map, point, &before), 0, "{point:?}");
        }
        assert_eq!(before.missing(&seen_from(&floor, &places, stops)), 0);
    }
}
