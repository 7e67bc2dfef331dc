use std::f64::consts::PI;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::*;
use crate::frames::{BodyXy, MapPose, MapXy};
use crate::map::Map;
use crate::reading::{Echo, Mounting};

/// The indoor thesis's sonars: across the front, and one down.
const AXES_DEG: [Option<f64>; 6] = [
    Some(0.0),
    Some(53.0),
    Some(90.0),
    Some(127.0),
    Some(180.0),
    None,
];

fn axes_rad() -> Vec<Option<f64>> {
    let turned = |axis: f64| (axis - 90.0).to_radians();
    AXES_DEG.iter().map(|axis| axis.map(turned)).collect()
}

fn sonar(bearing_rad: f64) -> Mounting {
    Mounting {
        at: BodyXy::new(0.0, 0.0),
        bearing_rad,
        aperture_rad: PI / 6.0,
        range_min_m: 0.05,
        range_max_m: 4.0,
    }
}

/// An empty room of 6 m × 5 m, at 5 cm.
fn room() -> Map {
    let inner = format!("#{}#\n", ".".repeat(118)).repeat(98);
    Map::from_text(&format!("{0}\n{inner}{0}", "#".repeat(120)), 0.05).unwrap()
}

fn exact() -> SonarModel {
    SonarModel {
        sigma_m: 0.0,
        lost: 0.0,
    }
}

fn of<'a>(map: &'a Map, surfaces: Surfaces<'a>) -> Room<'a> {
    Room {
        map,
        surfaces,
        discs: &[],
    }
}

fn heard(surface: Reflector, pose: MapPose) -> Echo {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let (map, surfaces) = (room(), |_| surface);
    exact().measure(of(&map, &surfaces), pose, &sonar(0.0), &[], &mut rng)
}

/// When each of the thesis's sonars fires in ten seconds at 8 Hz, if it is asked for at `times`.
fn firings(times: impl Iterator<Item = Duration>) -> Vec<Vec<Duration>> {
    let mut turns = Turns::new(Schedule::new(&axes_rad(), 8.0).unwrap());
    let mut fired = vec![Vec::new(); 6];
    for now in times.take_while(|it| *it < Duration::from_secs(10)) {
        for sonar in turns.next(now).unwrap_or_default() {
            fired[*sonar].push(now);
        }
    }
    fired
}

fn every(millis: u64) -> impl Iterator<Item = Duration> {
    (0..).map(move |step| Duration::from_millis(millis * step))
}

#[test]
fn every_sonar_fires_eight_times_a_second_if_it_is_asked_for_a_little_late() {
    for millis in [1, 3, 5, 7] {
        let fired = firings(every(millis));
        assert!(
            fired.iter().all(|it| (79..=81).contains(&it.len())),
            "{millis} ms: {:?}",
            fired.iter().map(Vec::len).collect::<Vec<_>>()
        );
    }
}

#[test]
fn polls_slower_than_the_turns_starve_no_sonar() {
    for millis in [10, 20, 45, 63, 84, 125, 500] {
        let fired = firings(every(millis));
        let number = |times: &Vec<Duration>| times.len();
        let (least, most) = (
            fired.iter().map(number).min().unwrap(),
            fired.iter().map(number).max().unwrap(),
        );
        assert!(
            least > 0 && most - least <= 1,
            "{millis} ms: {least} to {most}"
        );
    }
}

#[test]
fn after_a_stall_no_group_hears_the_one_before() {
    let stalled = every(1).filter(|it| !(2_000..2_900).contains(&it.as_millis()));
    let mut times: Vec<Duration> = firings(stalled).concat();
    times.sort();
    times.dedup();
    let heard = Duration::from_secs_f64(8.0 / SOUND_MPS);
    assert!(times.windows(2).all(|pair| pair[1] - pair[0] >= heard));
    let first = times.iter().position(|it| it.as_millis() >= 2_900).unwrap();
    assert_eq!(times[first].as_millis(), 2_900);
    assert!(times[first + 32].as_millis() <= 2_900 + 1_000);
}

#[test]
fn faster_turns_than_echoes_are_refused() {
    assert!(matches!(
        Schedule::new(&axes_rad(), 20.0),
        Err(ScheduleError::TooFast { groups: 4, .. })
    ));
    // The line of a single sonar is high for 45 ms, longer than its ping is heard.
    let Err(ScheduleError::TooFast { fastest_hz, .. }) = Schedule::new(&[Some(0.0)], 30.0) else {
        panic!("a line that is still high")
    };
    assert!((fastest_hz - 1.0 / 0.045).abs() < 1e-9, "{fastest_hz}");
    assert!(Schedule::new(&[Some(0.0)], 22.0).is_ok());
    assert_eq!(Schedule::new(&[], 8.0), Err(ScheduleError::Empty));
    assert_eq!(
        Schedule::new(&axes_rad(), f64::NAN),
        Err(ScheduleError::Empty)
    );
}

/// The share of readings that others' pings change by more than 5 cm, over random poses in a room of mirrors.
fn cross_talk(groups: &[Vec<usize>], slot_s: f64) -> f64 {
    let (map, axes) = (room(), axes_rad());
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let (mut changed, mut all) = (0, 0);
    for _ in 0..400 {
        let mut uniform = || f64::from(rng.next_u32()) / f64::from(u32::MAX);
        let pose = MapPose::new(
            0.4 + 5.2 * uniform(),
            0.4 + 4.2 * uniform(),
            2.0 * PI * uniform(),
        );
        for (turn, group) in groups.iter().enumerate() {
            let before = &groups[(turn + groups.len() - 1) % groups.len()];
            for listener in group {
                let Some(axis) = axes[*listener] else {
                    continue;
                };
                let ping = |other: &usize, earlier_s: f64| {
                    let axis = axes[*other]?;
                    let from = MapPose::new(pose.at.x_m, pose.at.y_m, pose.heading_rad + axis);
                    Some(Ping {
                        from,
                        mounting: sonar(axis),
                        earlier_s,
                    })
                };
                let together = group.iter().filter(|it| *it != listener);
                let pings: Vec<Ping> = together
                    .filter_map(|it| ping(it, 0.0))
                    .chain(before.iter().filter_map(|it| ping(it, slot_s)))
                    .collect();
                let mut measure = |pings: &[Ping]| {
                    let mirrors = of(&map, &|_| Reflector::Specular);
                    exact().measure(mirrors, pose, &sonar(axis), pings, &mut rng)
                };
                let (alone, among) = (measure(&[]), measure(&pings));
                all += 1;
                changed += usize::from(match (alone, among) {
                    (Echo::At(alone), Echo::At(among)) => (alone - among).abs() > 0.05,
                    (alone, among) => alone != among,
                });
            }
        }
    }
    changed as f64 / all as f64
}

#[test]
fn sonars_on_the_schedule_hear_others_in_at_most_one_percent_of_readings() {
    let schedule = Schedule::new(&axes_rad(), 8.0).unwrap();
    let groups: Vec<Vec<usize>> = (0..)
        .map(|it| schedule.group(it).to_vec())
        .take_while(|it| !it.is_empty())
        .collect();
    let share = cross_talk(&groups, schedule.slot().as_secs_f64());
    println!("cross-talk {share}");
    assert!(share <= 0.01, "{share}");
    let at_once = cross_talk(&[vec![0, 1, 2, 3, 4, 5]], 0.125);
    assert!(
        at_once > 0.02,
        "the room has no cross-talk to avoid: {at_once}"
    );
}

#[test]
fn the_nearest_thing_in_the_cone_answers_not_the_one_on_its_axis() {
    // 15° to the right of the axis the side wall is nearer than the wall ahead.
    let echo = heard(Reflector::Rough, MapPose::new(4.0, 0.55, 0.0));
    let Echo::At(range_m) = echo else {
        panic!("{echo:?}")
    };
    assert!((range_m - 1.95).abs() < 0.06, "{range_m}");
    let near = heard(Reflector::Rough, MapPose::new(4.0, 0.4, 0.0));
    let Echo::At(range_m) = near else {
        panic!("{near:?}")
    };
    assert!(
        (range_m - 0.35 / libm::sin(PI / 12.0)).abs() < 0.1,
        "{range_m}"
    );
}

#[test]
fn mirrors_answer_only_head_on() {
    assert!(matches!(
        heard(Reflector::Specular, MapPose::new(4.5, 2.5, 0.0)),
        Echo::At(_)
    ));
    let aslant = MapPose::new(2.0, 2.5, PI / 4.0);
    assert_eq!(heard(Reflector::Specular, aslant), Echo::Silence);
    assert!(matches!(heard(Reflector::Rough, aslant), Echo::At(_)));
}

#[test]
fn people_answer_with_the_side_that_the_cone_meets_unless_a_wall_is_between() {
    let map = room();
    let pose = MapPose::new(2.0, 2.5, 0.0);
    let answers = |x_m: f64, y_m: f64| {
        let person = Disc {
            at: MapXy::new(x_m, y_m),
            radius_m: 0.2,
        };
        let room = Room {
            discs: &[person],
            ..of(&map, &|_| Reflector::Rough)
        };
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        match exact().measure(room, pose, &sonar(0.0), &[], &mut rng) {
            Echo::At(range_m) => range_m,
            echo => panic!("{echo:?}"),
        }
    };
    let wall_m = answers(1.0, 2.5);
    assert!((answers(3.5, 2.5) - 1.3).abs() < 1e-9, "ahead");
    // 0.35 m to the left of the axis at 1 m: its middle is out of the cone, its right side is in it.
    assert!((0.85..0.95).contains(&answers(3.0, 2.85)), "aside");
    assert!((answers(3.0, 3.5) - wall_m).abs() < 1e-9, "beside");
    assert!((answers(6.2, 2.5) - wall_m).abs() < 1e-9, "behind the wall");
}

#[test]
fn curtains_answer_from_near_only() {
    assert!(matches!(
        heard(Reflector::Absorbing, MapPose::new(5.0, 2.5, 0.0)),
        Echo::At(_)
    ));
    assert_eq!(
        heard(Reflector::Absorbing, MapPose::new(3.5, 2.5, 0.0)),
        Echo::Silence
    );
}

#[test]
fn noise_and_losses_are_as_large_as_the_model_says() {
    let (map, model) = (room(), SonarModel::default());
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let pose = MapPose::new(4.0, 2.5, 0.0);
    let echoes: Vec<Echo> = (0..4_000)
        .map(|_| {
            let rough = of(&map, &|_| Reflector::Rough);
            model.measure(rough, pose, &sonar(0.0), &[], &mut rng)
        })
        .collect();
    let ranges: Vec<f64> = echoes
        .iter()
        .filter_map(|echo| match echo {
            Echo::At(it) => Some(*it),
            _ => None,
        })
        .collect();
    let lost = 1.0 - ranges.len() as f64 / echoes.len() as f64;
    let mean = ranges.iter().sum::<f64>() / ranges.len() as f64;
    let variance = ranges
        .iter()
        .map(|it| (it - mean) * (it - mean))
        .sum::<f64>()
        / ranges.len() as f64;
    assert!((lost - model.lost).abs() < 0.01, "{lost}");
    assert!((libm::sqrt(variance) - model.sigma_m).abs() < 0.001);
    assert!((mean - 1.95).abs() < 0.01);
}

#[test]
fn lasers_measure_along_each_beam_and_rangefinders_the_mean_of_their_view() {
    let map = room();
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let laser = LaserModel {
        mounting: Mounting::laser(BodyXy::new(0.0, 0.0), 0.0, 12.0),
        view_rad: PI,
        beams: 3,
        sigma_m: 0.0,
        expiry: Duration::from_millis(200),
    };
    let pose = MapPose::new(4.0, 2.0, 0.0);
    let now = Duration::from_secs(3);
    let scan: Vec<_> = laser.scan(&map, pose, now, &mut rng).collect();
    let ranges: Vec<f64> = scan
        .iter()
        .filter_map(|reading| reading.range_m(now))
        .collect();
    let expected = [1.95, 1.95, 2.95];
    assert_eq!(ranges.len(), expected.len());
    for (range_m, expected) in ranges.iter().zip(expected) {
        assert!((range_m - expected).abs() < 1e-6, "{ranges:?}");
    }
    assert_eq!(scan[0].range_m(now + laser.expiry), None, "expired");
    let tof = TofModel {
        mounting: Mounting {
            range_max_m: 4.0,
            ..sonar(0.0)
        },
        sigma: 0.0,
        expiry: Duration::from_millis(100),
    };
    let range_m = tof.measure(&map, pose, now, &mut rng).range_m(now).unwrap();
    assert!(range_m > 1.95 && range_m < 2.02, "{range_m}");
}
