mod ends;

use std::sync::Arc;
use std::time::Duration;

use muster_machines::machine::{Emitted, Stimulus, step};

use super::*;
use crate::avoidance::{Limits, Method};
use crate::coverage::{self, View};
use crate::frames::{MapPose, Motion};
use crate::map::Map;
use crate::path::Floor;
use crate::reading::Echo;

/// A room of 4 × 3 m.
pub(super) fn config() -> Config {
    room((80, 60), MapPose::new(1.0, 1.5, 0.0), 1.0)
}

/// A room in cells of 5 cm, for a camera of this range.
pub(super) fn room((columns, rows): (usize, usize), start: MapPose, range_m: f64) -> Config {
    let line = |row: usize| -> String {
        let cells = (0..columns).map(|column| {
            let is_wall = row == 0 || row == rows - 1 || column == 0 || column == columns - 1;
            if is_wall { '#' } else { '.' }
        });
        cells.collect()
    };
    let text: Vec<String> = (0..rows).map(line).collect();
    let map = Arc::new(Map::from_text(&text.join("\n"), 0.05).unwrap());
    config_of(&map, start, range_m)
}

/// Rooms of 4 × 4 and 3 × 4 m with a door between, not alike.
const ROOMS: &str = "
################################
#...............#..............#
#...............#..............#
#...............#..............#
#...............#............###
#...............#............###
#..............................#
#..............................#
#..............................#
#..............................#
#...............#..............#
###.............#..............#
###.............#..............#
#...............#......##......#
#...............#......##......#
#...............#..............#
#...............#..............#
################################";

/// Two rooms of about 4 × 4 m with a door of 1 m; a camera that sees 3.8 m.
pub(super) fn flat() -> Config {
    config_of(&map_of(ROOMS), MapPose::new(1.0, 2.5, 0.0), 3.8)
}

/// A plan of which a character is 25 cm, in cells of 5 cm.
pub(super) fn map_of(plan: &str) -> Arc<Map> {
    let wide = plan.trim().lines().flat_map(|line| {
        let line: String = line.chars().flat_map(|it| [it; 5]).collect();
        vec![line; 5]
    });
    let wide: Vec<String> = wide.collect();
    Arc::new(Map::from_text(&wide.join("\n"), 0.05).unwrap())
}

/// A map, for a camera of this range.
pub(super) fn config_of(map: &Arc<Map>, start: MapPose, range_m: f64) -> Config {
    let limits = Limits {
        radius_m: 0.25,
        speed_max_mps: 0.5,
        turn_rate_max_rps: 1.5,
    };
    let floor = Floor::new(Arc::clone(map), limits.radius_m);
    let view = View {
        range_m,
        cone_rad: 1.0,
    };
    let (tours, places) = coverage::plan(&floor, view, &[start.at], 3.0).unwrap();
    Config {
        floor,
        places: Arc::new(places),
        tables: Config::tables_of(map).unwrap(),
        stops: tours[0].stops.clone(),
        view,
        start,
        sonars: thesis_sonars(),
        method: Method::VfhPlus,
        limits,
        acceleration_mps2: 1.0,
        lasts_max: Duration::from_secs(3_600),
    }
}

/// A patrol with a drone that does what it is told at once.
struct Bench {
    patrol: Patrol,
    pose: MapPose,
    velocity: Velocity,
    events: Vec<Event>,
    steps: u64,
    sonars: Vec<crate::reading::Mounting>,
    map: Arc<Map>,
    /// Whether odometry comes.
    feels: bool,
}

impl Bench {
    fn new(config: &Config) -> Self {
        Self {
            patrol: Patrol::new(config.clone(), 1, Timestamp::ZERO, None),
            pose: config.start,
            velocity: Velocity::default(),
            events: Vec::new(),
            steps: 0,
            sonars: config.sonars.clone(),
            map: Arc::clone(config.floor.map()),
            feels: true,
        }
    }

    fn feed(&mut self, now: Timestamp, stimulus: Stimulus<Input>) {
        let (velocity, events) = (&mut self.velocity, &mut self.events);
        step(&mut self.patrol, now, stimulus, |output| match output {
            Emitted::Transmit(Transmit::Velocity(it)) => *velocity = it,
            Emitted::Event(event) => events.push(event),
        });
    }

    /// A period: motion, readings of the sonars that `hears` lets through, a decision.
    fn step(&mut self, mut hears: impl FnMut(usize, Echo) -> Option<Echo>) {
        self.steps += 1;
        let now = Timestamp::ZERO + PERIOD * self.steps as u32;
        let dt_s = PERIOD.as_secs_f64();
        let motion = Motion {
            forward_m: self.velocity.forward_mps * dt_s,
            left_m: self.velocity.left_mps * dt_s,
            turn_rad: self.velocity.turn_rps * dt_s,
        };
        self.pose = self.pose.moved(motion);
        if self.feels {
            self.feed(now, Stimulus::Input(Input::Odometry(motion)));
        }
        for (place, mounting) in self.sonars.clone().into_iter().enumerate() {
            let wall = sonars::expected_m(&self.map, self.pose, &mounting);
            let echo = wall.map_or(Echo::Silence, Echo::At);
            if let Some(echo) = hears(place, echo) {
                let taken = Duration::from_nanos(now.as_nanos());
                let reading = Reading {
                    mounting,
                    echo,
                    taken,
                    expires: taken + Duration::from_millis(300),
                };
                self.feed(now, Stimulus::Input(Input::Range(reading)));
            }
        }
        self.feed(now, Stimulus::Timeout);
    }

    fn faults(&self) -> Vec<SonarChange> {
        let changes = self.events.iter().filter_map(|event| match event {
            Event::Sonar(change) => Some(*change),
            _ => None,
        });
        changes.collect()
    }

    fn last_checkpoint(&self) -> Checkpoint {
        let last = self.events.iter().rev().find_map(|event| match event {
            Event::Checkpoint(checkpoint) => Some((**checkpoint).clone()),
            _ => None,
        });
        last.unwrap()
    }

    /// The process dies and starts again from its last checkpoint.
    fn restart(&mut self, config: &Config) {
        let now = Timestamp::ZERO + PERIOD * self.steps as u32;
        let checkpoint = self.last_checkpoint();
        self.patrol = Patrol::new(config.clone(), 2, now, Some(&checkpoint));
        self.velocity = Velocity::default();
    }

    fn landing(&self) -> Option<EarlyLanding> {
        self.events.iter().find_map(|event| match event {
            Event::Landing(cause) => Some(*cause),
            _ => None,
        })
    }

    fn is_done(&self) -> bool {
        self.events
            .iter()
            .any(|event| matches!(event, Event::Remaining(it) if it.is_done))
    }
}

#[test]
fn a_room_is_seen_and_the_patrol_ends() {
    let mut bench = Bench::new(&config());
    while !bench.is_done() && bench.steps < 3_000 {
        bench.step(|_, echo| Some(echo));
    }
    assert!(bench.is_done());
    let visible = bench.patrol.config.places.visible();
    let unseen = bench.patrol.seen.missing(visible);
    assert!(
        unseen * 100 <= visible.len(),
        "{unseen} of {}",
        visible.len()
    );
    assert_eq!(bench.faults(), []);
}

/// A defect of the indoor thesis's code: bad input replayed the last sticks for ever.
#[test]
fn silent_sensors_do_not_repeat_the_last_velocity() {
    let mut bench = Bench::new(&config());
    while bench.velocity.speed_mps() < 0.3 {
        bench.step(|_, echo| Some(echo));
        assert!(bench.steps < 1_000);
    }
    for _ in 0..5 {
        bench.step(|_, _| None);
    }
    assert!(bench.velocity.speed_mps() < 1e-9);
}

#[test]
fn failing_sonars_are_found_within_two_seconds() {
    type Hear = fn(Echo) -> Option<Echo>;
    let cases: [(Fault, Hear); 3] = [
        (Fault::Dead, |_| None),
        (Fault::Stuck, |_| Some(Echo::At(0.05))),
        (Fault::Deaf, |_| Some(Echo::Silence)),
    ];
    for (fault, hear) in cases {
        for sonar in 0..5 {
            let mut bench = Bench::new(&config());
            for _ in 0..50 {
                bench.step(|_, echo| Some(echo));
            }
            for _ in 0..20 {
                bench.step(|place, echo| {
                    if place == sonar {
                        hear(echo)
                    } else {
                        Some(echo)
                    }
                });
            }
            let change = SonarChange {
                sonar,
                fault: Some(fault),
            };
            assert_eq!(bench.faults(), [change], "{fault:?}");
        }
    }
}

/// Along a corridor the walls are at the edge of the cone, where an echo may stay away. The drone stops and turns to a wall.
#[test]
fn sonar_that_grows_deaf_along_a_corridor_is_found_within_two_seconds() {
    let mut bench = Bench::new(&room((200, 26), MapPose::new(1.0, 0.65, 0.0), 4.0));
    while bench.pose.at.x_m < 3.0 {
        bench.step(|_, echo| Some(echo));
        assert!(bench.steps < 1_000);
    }
    for _ in 0..20 {
        bench.step(|place, echo| Some(if place == 2 { Echo::Silence } else { echo }));
    }
    let change = SonarChange {
        sonar: 2,
        fault: Some(Fault::Deaf),
    };
    assert_eq!(bench.faults(), [change]);
}

#[test]
fn a_sonar_that_works_again_is_believed_again() {
    let mut bench = Bench::new(&config());
    for (steps, works) in [(30, true), (20, false), (60, true)] {
        for _ in 0..steps {
            bench.step(|place, echo| (works || place != 2).then_some(echo));
        }
    }
    let faults: Vec<_> = bench.faults().into_iter().map(|it| it.fault).collect();
    assert_eq!(faults, [Some(Fault::Dead), None]);
}

#[test]
fn without_sonars_nothing_moves() {
    let mut bench = Bench::new(&config());
    for _ in 0..100 {
        bench.step(|_, _| None);
        assert!(bench.velocity.speed_mps() < 1e-9);
    }
}

/// In the middle of a hall of 13 × 13 m no wall is in range: a deaf sonar can't be told from one before a free way.
#[test]
fn silence_alone_is_no_open_space_and_a_drone_without_echoes_lands() {
    let config = room((260, 260), MapPose::new(6.5, 6.5, 0.0), 4.0);
    let mut bench = Bench::new(&config);
    while !bench.is_done() && bench.steps < 200 {
        bench.step(|_, echo| Some(echo));
        assert!(bench.velocity.speed_mps() < 1e-9);
    }
    assert!(bench.is_done());
    assert_eq!(bench.landing(), Some(EarlyLanding::NoSonar));
    assert!(bench.steps >= 100, "{}", bench.steps);
}

#[test]
fn a_restarted_patrol_continues_from_pose_covariance_and_what_was_seen() {
    let config = config();
    let mut bench = Bench::new(&config);
    for _ in 0..300 {
        bench.step(|_, echo| Some(echo));
    }
    let checkpoint = bench.last_checkpoint();
    assert!(checkpoint.pose.at.distance_m(bench.pose.at) < 0.2);
    let now = Timestamp::ZERO + PERIOD * 300;
    let restarted = Patrol::new(config, 2, now, Some(&checkpoint));
    assert!(restarted.place.pose().at.distance_m(bench.pose.at) < 0.2);
    assert_eq!(restarted.seen, bench.patrol.seen);
}

/// It had forgotten, and flew off once a sonar echoed.
#[test]
fn a_patrol_that_has_ended_stays_ended_after_a_restart() {
    let config = config();
    for lands in [false, true] {
        let mut bench = Bench::new(&config);
        while !bench.is_done() && bench.steps < 3_000 {
            bench.step(|_, echo| (!lands).then_some(echo));
        }
        assert_eq!(bench.landing().is_some(), lands);
        bench.restart(&config);
        bench.events.clear();
        for _ in 0..200 {
            bench.step(|_, echo| Some(echo));
            assert_eq!(bench.velocity, Velocity::default(), "landed: {lands}");
        }
        let is_quiet = |event: &Event| match event {
            Event::Remaining(remaining) => remaining.is_done,
            Event::Checkpoint(checkpoint) => checkpoint.has_ended,
            _ => false,
        };
        assert!(bench.events.iter().all(is_quiet), "landed: {lands}");
    }
}

#[test]
fn restarts_put_no_landing_off() {
    let config = config();
    let mut unheard = Bench::new(&config);
    while !unheard.is_done() && unheard.steps < 200 {
        unheard.step(|_, _| None);
        if unheard.steps.is_multiple_of(40) {
            unheard.restart(&config);
        }
    }
    assert!((100..=102).contains(&unheard.steps), "{}", unheard.steps);
    assert_eq!(unheard.landing(), Some(EarlyLanding::NoSonar));
    let mut lost = Bench::new(&config);
    lost.step(|_, echo| Some(echo));
    let checkpoint = Checkpoint {
        is_lost: true,
        lost: Duration::from_secs(59),
        ..lost.last_checkpoint()
    };
    lost.patrol = Patrol::new(config, 2, Timestamp::ZERO + PERIOD, Some(&checkpoint));
    while !lost.is_done() && lost.steps < 200 {
        lost.step(|_, _| None);
    }
    assert!(lost.steps < 15, "{}", lost.steps);
    assert_eq!(lost.landing(), Some(EarlyLanding::PoseLost));
}

/// As many words of targets, or as many targets, were enough to take one for the own.
#[test]
fn a_checkpoint_of_another_map_or_camera_is_ignored() {
    let start = MapPose::new(1.0, 1.5, 0.0);
    let own = config();
    let mut bench = Bench::new(&own);
    for _ in 0..100 {
        bench.step(|_, echo| Some(echo));
    }
    let checkpoint = bench.last_checkpoint();
    assert!(!checkpoint.seen.is_empty());
    let drawn = |(column, row): (usize, usize), drawn: char| {
        let map = own.floor.map();
        let line = |at: usize| -> String {
            let cells = (0..map.columns()).map(|it| {
                let is_wall = it == 0 || it == 79 || at == 0 || at == 59;
                match (it, at) == (column, row) {
                    true => drawn,
                    false if is_wall => '#',
                    false => '.',
                }
            });
            cells.collect()
        };
        let lines: Vec<String> = (0..map.rows()).rev().map(line).collect();
        Arc::new(Map::from_text(&lines.join("\n"), 0.05).unwrap())
    };
    let goes_on = |config: Config| {
        let restarted = Patrol::new(config, 2, Timestamp::ZERO + PERIOD * 100, Some(&checkpoint));
        !restarted.seen.is_empty()
    };
    assert!(goes_on(own.clone()));
    assert!(goes_on(config_of(&drawn((40, 0), '#'), start, 1.0)));
    // None of these cells is the centre of a target.
    for (cell, drawn_as) in [((40, 20), '#'), ((40, 20), 'x'), ((40, 20), '?')] {
        let other = config_of(&drawn(cell, drawn_as), start, 1.0);
        assert_eq!(other.places.targets().len(), own.places.targets().len());
        assert!(!goes_on(other), "{drawn_as}");
    }
    assert!(!goes_on(room((80, 60), start, 1.1)));
    assert!(!goes_on(room((60, 80), start, 1.0)));
}

/// Some drivers give the range that an HC-SR04 heard beyond its 4 m; the sonar was then taken for dead.
#[test]
fn echo_from_beyond_the_range_is_silence_and_other_ranges_that_can_not_be_are_failures() {
    let mounting = config().sonars[0];
    let cases = [
        (4.0, Echo::At(4.0)),
        (4.5, Echo::Silence),
        (0.02, Echo::Failed),
        (-1.0, Echo::Failed),
        (f64::NAN, Echo::Failed),
        (f64::INFINITY, Echo::Failed),
    ];
    for (range_m, echo) in cases {
        let reading = checked(Reading {
            mounting,
            echo: Echo::At(range_m),
            taken: Duration::ZERO,
            expires: Duration::from_secs(1),
        });
        assert_eq!(reading.echo, echo, "{range_m}");
    }
}

/// They kept sonars alive that had said nothing for minutes.
#[test]
fn readings_that_have_expired_are_dropped() {
    let mut bench = Bench::new(&config());
    for step in 1..=10 {
        let now = Timestamp::ZERO + PERIOD * (10 + step);
        for mounting in bench.sonars.clone() {
            let reading = Reading {
                mounting,
                echo: Echo::At(1.0),
                taken: Duration::ZERO,
                expires: Duration::from_secs(1),
            };
            bench.feed(now, Stimulus::Input(Input::Range(reading)));
        }
        bench.feed(now, Stimulus::Timeout);
    }
    let dead = bench.faults();
    assert_eq!(dead.len(), 5);
    assert!(dead.iter().all(|it| it.fault == Some(Fault::Dead)));
}

#[test]
fn readings_that_wait_are_bounded() {
    let mut bench = Bench::new(&config());
    let mounting = bench.sonars[0];
    for _ in 0..10 * READINGS_MAX {
        let reading = Reading {
            mounting,
            echo: Echo::Silence,
            taken: Duration::ZERO,
            expires: Duration::from_secs(1),
        };
        bench.feed(Timestamp::ZERO, Stimulus::Input(Input::Range(reading)));
    }
    assert_eq!(bench.patrol.readings.len(), READINGS_MAX);
}
