use std::sync::Arc;

use proptest::prelude::*;

use super::*;
use crate::frames::MapXy;
use crate::map::Map;

const ROOMS: &str = "
####################
#.........#........#
#.........#........#
#.........#........#
#..................#
#.........#........#
#.........#........#
####################";

/// The plan with cells of 5 cm, 25 cm for a character.
fn map(plan: &str) -> Arc<Map> {
    let wide: Vec<String> = plan
        .lines()
        .flat_map(|line| {
            let line: String = line.chars().flat_map(|it| [it; 5]).collect();
            vec![line; 5]
        })
        .collect();
    Arc::new(Map::from_text(&wide.join("\n"), 0.05).unwrap())
}

fn length_m(path: &[MapXy]) -> f64 {
    path.windows(2)
        .map(|pair| pair[0].distance_m(pair[1]))
        .sum()
}

#[test]
fn path_leads_through_the_middle_of_the_door() {
    let floor = Floor::new(map(ROOMS), 0.1);
    let path = floor
        .path(MapXy::new(0.6, 0.6), MapXy::new(4.5, 1.6))
        .unwrap();
    let door = MapXy::new(2.625, 0.875);
    let crosses = path
        .windows(2)
        .find(|leg| leg[0].x_m < door.x_m && leg[1].x_m >= door.x_m);
    let leg = crosses.expect("the path passes the door");
    let share = (door.x_m - leg[0].x_m) / (leg[1].x_m - leg[0].x_m);
    let y_m = leg[0].y_m + share * (leg[1].y_m - leg[0].y_m);
    assert!((y_m - door.y_m).abs() < 0.06, "{y_m}");
    assert!(path.len() <= 7, "{path:?}");
    assert!(length_m(&path) < 4.5, "{}", length_m(&path));
}

#[test]
fn door_that_is_too_narrow_has_no_path() {
    let (from, to) = (MapXy::new(0.6, 0.6), MapXy::new(4.5, 1.6));
    assert_eq!(Floor::new(map(ROOMS), 0.2).path(from, to), None);
    assert_eq!(
        Floor::new(map(ROOMS), 0.1).path(from, MapXy::new(9.0, 9.0)),
        None
    );
}

#[test]
fn obstacle_in_the_only_door_leaves_no_path() {
    let floor = Floor::new(map(ROOMS), 0.1);
    let (from, to) = (MapXy::new(0.6, 0.6), MapXy::new(4.5, 1.6));
    let mut obstacles = Obstacles::default();
    obstacles.add(MapXy::new(2.6, 0.9), 0.3);
    assert_eq!(floor.without(&obstacles).path(from, to), None);
    assert!(floor.path(from, to).is_some());
}

#[test]
fn paused_search_finds_the_same_path() {
    let floor = Floor::new(map(ROOMS), 0.1);
    let (from, to) = (MapXy::new(0.6, 0.6), MapXy::new(4.5, 1.6));
    let cell = |point| floor.map().cell(point).unwrap();
    let (from, to) = (floor.map().centre(cell(from)), floor.map().centre(cell(to)));
    let mut search = Search::new(&floor, cell(from), cell(to));
    let mut pauses = 0;
    let found = loop {
        match search.advance(&floor, 10) {
            Found::NotYet => pauses += 1,
            found => break found,
        }
    };
    assert!(pauses > 10, "{pauses}");
    assert_eq!(found, Found::Path(floor.path(from, to).unwrap()));
}

#[test]
fn straight_legs_are_as_short_as_the_room_allows() {
    let empty = "
##########
#........#
#........#
#........#
#........#
##########";
    let floor = Floor::new(map(empty), 0.05);
    let (from, to) = (MapXy::new(0.7, 0.7), MapXy::new(1.9, 0.8));
    let path = floor.path(from, to).unwrap();
    assert!(length_m(&path) < 1.02 * from.distance_m(to), "{path:?}");
}

#[test]
fn obstacles_are_bounded_and_the_oldest_goes() {
    let mut obstacles = Obstacles::default();
    for at in 0..=Obstacles::MAX {
        obstacles.add(MapXy::new(at as f64, 0.0), 0.1);
    }
    assert!(!obstacles.cover(MapXy::new(0.0, 0.0)));
    assert!(obstacles.cover(MapXy::new(Obstacles::MAX as f64, 0.0)));
}

#[test]
fn path_begins_and_ends_at_the_given_places() {
    let floor = Floor::new(map(ROOMS), 0.1);
    let (from, to) = (MapXy::new(0.61, 0.63), MapXy::new(4.52, 1.58));
    let path = floor.path(from, to).unwrap();
    assert_eq!((path[0], path[path.len() - 1]), (from, to));
    let beside = MapXy::new(0.62, 0.62);
    assert_eq!(floor.path(from, beside), Some(vec![from, beside]));
    assert_eq!(floor.path(from, from), Some(vec![from]));
}

/// It went through a square of as many rows as there are columns: for hours.
#[test]
fn nearest_free_cell_of_a_long_thin_map_is_found_at_once() {
    let columns = 1_000_000;
    let map = Arc::new(Map::from_text(&".".repeat(columns), 0.05).unwrap());
    let floor = Floor::new(map, 0.0);
    let (sender, receiver) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let middle = floor.nearest_free(MapXy::new(25_000.0, 0.02), 50_001.0);
        let beside = floor.nearest_free(MapXy::new(-10.0, 9.0), f64::INFINITY);
        let beyond = floor.nearest_free(MapXy::new(-10.0, 0.0), 9.0);
        sender.send([middle, beside, beyond]).unwrap();
    });
    let found = receiver.recv_timeout(std::time::Duration::from_secs(20));
    let [middle, beside, beyond] = found.expect("at once");
    assert!(middle.unwrap().column.abs_diff(columns / 2) <= 1);
    assert_eq!((beside.unwrap().column, beyond), (0, None));
}

#[test]
fn closed_diagonal_wall_has_no_path_through_it() {
    let plan = "
######
#..#.#
#.#..#
##...#
######";
    let map = Arc::new(Map::from_text(plan, 0.5).unwrap());
    let floor = Floor::new(map, 0.0);
    let (beyond, behind) = (MapXy::new(0.75, 1.75), MapXy::new(2.25, 0.75));
    assert_eq!(floor.path(beyond, behind), None);
    assert!(floor.path(MapXy::new(2.25, 1.75), behind).is_some());
}

/// Distance of a point from the nearest place outside of the room, or in a cell that isn't free.
fn clearance_m(map: &Map, at: MapXy) -> f64 {
    let size = |cells: usize| cells as f64 * map.resolution_m();
    let (width_m, height_m) = (size(map.columns()), size(map.rows()));
    let outside_m = [at.x_m, at.y_m, width_m - at.x_m, height_m - at.y_m];
    let closed = map
        .cells()
        .filter(|cell| map.state(*cell) != crate::map::State::Free || map.is_kept_out(*cell));
    let half_m = map.resolution_m() / 2.0;
    let away_m = closed.map(|cell| {
        let centre = map.centre(cell);
        let beyond = |off_m: f64| (off_m.abs() - half_m).max(0.0);
        libm::hypot(beyond(at.x_m - centre.x_m), beyond(at.y_m - centre.y_m))
    });
    away_m
        .chain(outside_m)
        .min_by(f64::total_cmp)
        .unwrap_or(f64::INFINITY)
}

proptest! {
    /// With cells of 50 cm and 25 cm to keep, paths led along walls and through their corners.
    #[test]
    fn path_keeps_its_distance_from_all_that_is_not_free(
        cells in proptest::collection::vec(0_u8..12, 100),
        cell_m in prop::sample::select(vec![0.05, 0.25, 0.5]),
        radius_m in prop::sample::select(vec![0.0, 0.1, 0.25, 0.3]),
        ends in [0.0..1.0, 0.0..1.0, 0.0..1.0, 0.0..1.0],
    ) {
        let drawn = |cell: &u8| ['#', 'x', '?'].get(usize::from(*cell)).copied().unwrap_or('.');
        let rows: Vec<String> = cells.chunks(10).map(|row| row.iter().map(drawn).collect()).collect();
        let map = Map::from_text(&rows.join("\n"), cell_m).unwrap();
        let map = Arc::new(map.split(0.05));
        let floor = Floor::new(Arc::clone(&map), radius_m);
        let edge_m = 10.0 * cell_m;
        let [x1, y1, x2, y2] = ends.map(|it| it * edge_m);
        let path = floor.path(MapXy::new(x1, y1), MapXy::new(x2, y2)).unwrap_or_default();
        for leg in path.windows(2) {
            let (bearing_rad, length_m) = (leg[0].bearing_rad(leg[1]), leg[0].distance_m(leg[1]));
            for step in 0..=20 {
                let at = leg[0].towards(bearing_rad, length_m * f64::from(step) / 20.0);
                let away_m = clearance_m(&map, at);
                prop_assert!(away_m >= radius_m - 1e-9, "{away_m} at {at:?} of {path:?}");
            }
        }
    }
}
