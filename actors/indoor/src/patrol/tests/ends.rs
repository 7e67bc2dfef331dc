//! Restarts, and patrols that can't go on.

use super::*;

/// After 15 s it flew by wrong poses for minutes: particles spread over metres settled where it was not.
#[test]
fn restart_after_seconds_or_a_clock_that_went_back_finds_the_pose_before_it_flies() {
    let config = flat();
    for (down_s, back_s) in [(15_u64, 0), (30, 0), (3_600, 0), (0, 10)] {
        let mut bench = Bench::new(&config);
        for _ in 0..200 {
            bench.step(|_, echo| Some(echo));
        }
        bench.steps = bench.steps + 10 * down_s - 10 * back_s;
        bench.restart(&config);
        assert!(bench.patrol.place.is_lost(), "{down_s} s, {back_s} s back");
        for _ in 0..300 {
            bench.step(|_, echo| Some(echo));
            let error_m = bench.patrol.place.pose().at.distance_m(bench.pose.at);
            let is_wrong = !bench.patrol.place.is_lost() && error_m > 0.5;
            assert!(!is_wrong, "{down_s} s, {back_s} s back: {error_m} m");
        }
        assert!(!bench.patrol.place.is_lost(), "{down_s} s, {back_s} s back");
    }
}

/// Stops behind the door were given up, and what they show was looked for from forty more, a minute and a half each.
#[test]
fn closed_door_ends_the_patrol_once_the_stops_behind_it_are_given_up() {
    let config = flat();
    let mut bench = Bench::new(&config);
    bench.map = map_of(&ROOMS.replace(
        "#..............................#",
        "#...............#..............#",
    ));
    while !bench.is_done() && bench.steps < 6_000 {
        bench.step(|_, echo| Some(echo));
    }
    assert!(bench.is_done());
    let given_up = bench.events.iter();
    let given_up = given_up.filter(|it| matches!(it, Event::GivenUp(_)));
    let stops = config.stops.iter().filter(|it| it.x_m > 4.0).count();
    assert!((1..=stops).contains(&given_up.count()), "{stops} stops");
    assert_eq!(bench.landing(), None);
}

/// An optical flow over a dark floor: the pose stood still on the map while the drone flew.
#[test]
fn drone_without_odometry_hovers_and_lands_after_ten_seconds() {
    let mut bench = Bench::new(&config());
    while bench.velocity.speed_mps() < 0.3 {
        bench.step(|_, echo| Some(echo));
        assert!(bench.steps < 1_000);
    }
    // A gap of some seconds ends no patrol.
    for (gap, lands) in [(50, false), (120, true)] {
        bench.feels = false;
        for step in 1..=gap {
            bench.step(|_, echo| Some(echo));
            let hovers = bench.velocity == Velocity::default();
            assert!(hovers || step < 6, "{step}: {:?}", bench.velocity);
            assert_eq!(bench.is_done(), step >= 100, "{step}");
        }
        let cause = lands.then_some(EarlyLanding::NoOdometry);
        assert_eq!(bench.landing(), cause);
        bench.feels = true;
        for _ in 0..5 {
            bench.step(|_, echo| Some(echo));
        }
        assert_eq!(bench.velocity == Velocity::default(), lands);
    }
}

#[test]
fn patrol_that_takes_too_long_lands_and_a_restart_gives_it_no_more_time() {
    let config = Config {
        lasts_max: Duration::from_secs(20),
        ..config()
    };
    let mut bench = Bench::new(&config);
    while !bench.is_done() && bench.steps < 300 {
        bench.step(|_, echo| Some(echo));
        if bench.steps.is_multiple_of(60) {
            bench.restart(&config);
        }
    }
    assert!((200..=210).contains(&bench.steps), "{}", bench.steps);
    assert_eq!(bench.landing(), Some(EarlyLanding::TimeOver));
}

/// It looked round at its first stop for ever.
#[test]
fn drone_that_does_not_turn_gives_its_stops_up() {
    let mut bench = Bench::new(&room((80, 60), MapPose::new(1.0, 1.5, 0.0), 5.0));
    while !bench.is_done() && bench.steps < 10_000 {
        bench.velocity.turn_rps = 0.0;
        bench.step(|_, echo| Some(echo));
    }
    assert!(bench.is_done());
    let mut events = bench.events.iter();
    assert!(events.any(|it| matches!(it, Event::GivenUp(_))));
}

/// With sonars alone, wrong poses fit well: it flew by them for minutes.
#[test]
fn drone_that_is_carried_away_notices_and_finds_its_pose() {
    let flat = include_str!("../../../../../scenarios/indoor/flats/flat.toml");
    let plan = flat.split("'''").nth(1).expect("a plan");
    let config = config_of(&map_of(plan), MapPose::new(1.0, 3.9, 0.0), 3.8);
    for (x_m, y_m, heading_rad) in [(8.0, 1.5, 3.0), (2.0, 6.5, -2.0), (8.5, 3.9, 0.0)] {
        let mut bench = Bench::new(&config);
        for _ in 0..150 {
            bench.step(|_, echo| Some(echo));
        }
        bench.pose = MapPose::new(x_m, y_m, heading_rad);
        for _ in 0..300 {
            bench.step(|_, echo| Some(echo));
        }
        let error_m = bench.patrol.place.pose().at.distance_m(bench.pose.at);
        let is_lost = bench.patrol.place.is_lost();
        assert!(!is_lost && error_m < 0.3, "{x_m}, {y_m}: {error_m} m");
    }
}
