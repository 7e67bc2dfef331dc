use std::sync::Arc;

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
    let floor = Floor::new(map, 0.01);
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
