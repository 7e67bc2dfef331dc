use super::*;
use crate::patrol::tests::{config, flat};

#[test]
fn drone_beside_the_end_of_its_path_flies_there() {
    let config = config();
    let mut route = Route::new(&config);
    let end = MapXy::new(2.0, 1.5);
    route.stops = VecDeque::from([Stop {
        at: end,
        turn: 0,
        tries: 0,
        is_extra: false,
    }]);
    let seen = Seen::none(config.places.targets().len());
    for beside in [
        MapXy::new(2.0, 1.8),
        MapXy::new(2.0, 2.2),
        MapXy::new(2.5, 1.5),
    ] {
        route.phase = Phase::Flying(vec![MapXy::new(1.0, 1.5), end]);
        let pose = MapPose::new(beside.x_m, beside.y_m, 0.0);
        let order = route.fly(Timestamp::ZERO, &config, pose, &seen);
        let left_m = beside.distance_m(end);
        assert_eq!(order, Order::Fly { to: end, left_m }, "{beside:?}");
    }
}

/// The point 0.7 m ahead was behind the post of the door; VFH+ then led the drone to and fro before it.
#[test]
fn straight_line_to_the_point_that_is_flown_to_stays_clear_of_walls() {
    let config = flat();
    let mut route = Route::new(&config);
    let seen = Seen::none(config.places.targets().len());
    let path = [(3.725, 1.0), (3.725, 2.4), (5.0, 2.4)];
    let path = path.map(|(x_m, y_m)| MapXy::new(x_m, y_m));
    for y_m in [1.2, 1.9, 2.0, 2.1, 2.3] {
        route.phase = Phase::Flying(path.to_vec());
        let pose = MapPose::new(3.725, y_m, 0.0);
        let order = route.fly(Timestamp::ZERO, &config, pose, &seen);
        let Order::Fly { to, .. } = order else {
            panic!("{order:?}");
        };
        let (bearing_rad, length_m) = (pose.at.bearing_rad(to), pose.at.distance_m(to));
        let on_line = (0..=100).map(|it| {
            let along_m = length_m * f64::from(it) / 100.0;
            pose.at.towards(bearing_rad, along_m)
        });
        let mut on_line = on_line;
        assert!(on_line.all(|it| config.floor.is_free(it)), "{y_m}: {to:?}");
        assert!(length_m >= 0.15, "{y_m}: {to:?}");
    }
}

#[test]
fn way_back_has_no_loops() {
    let mut route = Route::new(&config());
    for x_m in [0.0, 0.4, 0.8, 1.2, 1.6, 1.2, 1.6, 1.9, 1.2] {
        route.note(MapXy::new(x_m, 1.0));
    }
    let back: Vec<f64> = route.came_by.iter().map(|it| it.x_m).collect();
    assert_eq!(back, [1.2, 0.8, 0.4, 0.0]);
}

/// 20 cm beside a stop, other squares are hidden by a wall's end than at the stop.
#[test]
fn squares_that_only_the_exact_stop_shows_are_looked_for_once_more() {
    let config = flat();
    let mut route = Route::new(&config);
    let (map, places) = (config.floor.map(), &config.places);
    let stop = config.stops[0];
    let beside = MapPose::new(stop.x_m + 0.15, stop.y_m + 0.1, 0.0);
    let shown = |at: MapXy| {
        let mut seen = Seen::none(places.targets().len());
        places.look_round(map, at, &mut seen);
        seen
    };
    let (from_stop, from_beside) = (shown(stop), shown(beside.at));
    assert!(from_stop.missing(&from_beside) > 0 || from_beside.missing(&from_stop) > 0);
    let seen = Seen::none(places.targets().len());
    for (is_extra, written_off) in [(false, from_beside), (true, from_stop)] {
        route.tried = seen.clone();
        route.stops[0].is_extra = is_extra;
        route.stops[0].at = stop;
        route.phase = Phase::Looking(0.0, 0);
        route.look(&config, beside, &seen, 0.1);
        assert_eq!(route.tried, written_off);
        route.stops.push_front(Stop {
            at: stop,
            turn: 0,
            tries: 0,
            is_extra: false,
        });
    }
}
