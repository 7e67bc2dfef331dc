use std::f64::consts::TAU;

use super::*;

const NOISE: Noise = Noise::GPS;

fn at(seconds: f64) -> Timestamp {
    Timestamp::from_secs_f64(seconds)
}

/// A fix `north_m` north of home, where a degree is 111,200 m long, that moves north at `speed_mps`.
fn fix(north_m: f64, speed_mps: f64) -> RawGps {
    RawGps {
        fix: 1,
        satellites: 12,
        latitude_e7: 490_000_000 + (north_m / 111_206.0 * 1e7) as i32,
        longitude_e7: 120_000_000,
        altitude_m: 400,
        speed_cmps: (speed_mps * 100.0) as u16,
        course_ddeg: 0,
        pdop_e2: None,
    }
}

fn estimator() -> Estimator {
    estimator_of(&super::super::tests::config())
}

fn estimator_of(config: &Config) -> Estimator {
    let mut estimator = Estimator::new(config, at(0.0), None);
    estimator.measure_altitude(at(0.0), &Altitude::default());
    estimator.set_ground();
    estimator
}

#[test]
fn moving_vehicle_is_where_the_delayed_fixes_say_it_was_and_has_moved_since() {
    let mut estimator = estimator();
    // It leans against the drag.
    let leaning = Attitude {
        pitch_ddeg: 129,
        ..Attitude::default()
    };
    estimator.measure_attitude(at(0.0), &leaning);
    for step in 0..100 {
        let seconds = f64::from(step) / 10.0;
        estimator.predict(at(seconds));
        let seen_m = 5.0 * (seconds - NOISE.gps_delay.as_secs_f64());
        estimator.measure_gps(at(seconds), &fix(seen_m, 5.0));
    }
    let estimate = estimator.estimate().unwrap();
    let north_m = estimate.position.north_m();
    assert!((north_m - 49.5).abs() < 0.3, "{north_m}");
    assert!((estimate.velocity.0.x - 5.0).abs() < 0.1);
}

#[test]
fn an_accelerating_vehicle_is_where_late_poses_say_it_was_and_has_moved_since() {
    // Without drag 5° of tilt accelerate by 0.858 m/s².
    let mut config = super::super::tests::config();
    config.gains.drag_per_s = 0.0;
    let mut estimator = estimator_of(&config);
    let leaning = Attitude {
        pitch_ddeg: 50,
        ..Attitude::default()
    };
    estimator.measure_attitude(at(0.0), &leaning);
    let place_m = |seconds: f64| 0.5 * 0.858 * seconds * seconds;
    let age = Duration::from_millis(100);
    for step in 0..300_u32 {
        let now = at(f64::from(step) / 50.0);
        estimator.predict(now);
        if step % 5 == 0 {
            let seen_m = place_m((f64::from(step) / 50.0 - 0.1).max(0.0));
            let position = Ned::new(seen_m, 2.0, -1.5);
            let pose = Pose {
                position,
                sigma_m: 0.05,
                age,
            };
            estimator.measure_pose(now, &pose);
        }
    }
    let estimate = estimator.estimate().unwrap();
    let north_m = estimate.position.north_m() - place_m(299.0 / 50.0);
    assert!(north_m.abs() < 0.03, "{north_m}");
    assert!((estimate.velocity.0.x - 0.858 * 5.98).abs() < 0.05);
    assert!((estimate.position.altitude_m() - 1.5).abs() < 0.05);
}

#[test]
fn a_wrong_barometer_does_not_count_while_poses_tell_the_height() {
    let mut estimator = estimator();
    let pose = |altitude_m: f64| Pose {
        position: Ned::new(0.0, 0.0, -altitude_m),
        sigma_m: 0.05,
        age: Duration::from_millis(100),
    };
    let height_m = |estimator: &Estimator| estimator.estimate().unwrap().position.altitude_m();
    for step in 0..200_u32 {
        let now = at(f64::from(step) / 10.0);
        estimator.predict(now);
        // It stays at zero.
        estimator.measure_altitude(now, &Altitude::default());
        estimator.measure_pose(now, &pose(2.0));
    }
    assert!((height_m(&estimator) - 2.0).abs() < 0.05);
    // Without poses the barometer counts on from there.
    for step in 200..240_u32 {
        let now = at(f64::from(step) / 10.0);
        estimator.predict(now);
        estimator.measure_altitude(now, &Altitude::default());
    }
    assert!((height_m(&estimator) - 2.0).abs() < 0.1);
}

#[test]
fn a_pose_that_is_old_or_no_number_is_rejected() {
    let mut estimator = estimator();
    let good = Pose {
        position: Ned::new(1.0, 2.0, 0.0),
        sigma_m: 0.05,
        age: Duration::from_millis(100),
    };
    let bad = [
        Pose {
            position: Ned::new(f64::NAN, 2.0, 0.0),
            ..good
        },
        Pose {
            sigma_m: 0.0,
            ..good
        },
        Pose {
            sigma_m: 1.1,
            ..good
        },
        Pose {
            sigma_m: f64::MAX,
            ..good
        },
        Pose {
            age: Duration::from_secs(2),
            ..good
        },
    ];
    for pose in bad {
        for tenths in 1..6 {
            let now = at(f64::from(tenths) / 10.0);
            estimator.measure_pose(now, &pose);
            assert!(estimator.lost_for(now).is_some());
        }
    }
    for tenths in 6..9 {
        estimator.measure_pose(at(f64::from(tenths) / 10.0), &good);
    }
    assert_eq!(estimator.lost_for(at(0.8)), None);
    let here = estimator.estimate().unwrap().position;
    assert!(here.distance_m(good.position) < 0.1, "{here:?}");
}

#[test]
fn position_is_lost_while_poses_say_that_they_may_be_anywhere() {
    let mut estimator = estimator();
    let mut pose = Pose {
        position: Ned::HOME,
        sigma_m: 0.05,
        age: Duration::from_millis(100),
    };
    for tenths in 1..60 {
        let now = at(f64::from(tenths) / 10.0);
        estimator.predict(now);
        estimator.measure_pose(now, &pose);
        if tenths == 30 {
            assert_eq!(estimator.lost_for(now), None);
            pose.sigma_m = 500.0;
        }
    }
    assert!(estimator.lost_for(at(6.0)).is_some());
}

#[test]
fn poses_that_agree_count_more_than_the_estimate_and_outliers_do_not() {
    let mut estimator = estimator();
    let mut seconds = 0.0;
    let mut see = |estimator: &mut Estimator, north_m: f64| {
        seconds += 0.1;
        let now = at(seconds);
        estimator.predict(now);
        estimator.measure_pose(
            now,
            &Pose {
                position: Ned::new(north_m, 0.0, 0.0),
                sigma_m: 0.05,
                age: Duration::from_millis(100),
            },
        );
        estimator.estimate().unwrap().position.north_m()
    };
    // The first is an outlier.
    for north_m in [4.0, 0.0, 0.0, 0.0] {
        see(&mut estimator, north_m);
    }
    for step in 0..60 {
        let is_outlier = step % 3 == 0;
        let north_m = see(
            &mut estimator,
            if is_outlier { f64::from(step) } else { 0.0 },
        );
        assert!(north_m.abs() < 0.05, "{step}: {north_m}");
    }
    // It moves with 3 m/s, and is where the last pose says that it was 0.1 s ago.
    let seen: Vec<f64> = (0..3)
        .map(|step| see(&mut estimator, 10.0 + 0.3 * f64::from(step)))
        .collect();
    assert!((seen[2] - 10.9).abs() < 0.05, "{seen:?}");
    let velocity_mps = estimator.estimate().unwrap().velocity.0.x;
    assert!((velocity_mps - 3.0).abs() < 0.1, "{velocity_mps}");
}

#[test]
fn an_outlier_is_rejected_and_a_position_without_fixes_is_lost() {
    let mut estimator = estimator();
    for tenth in 0..20 {
        let now = at(f64::from(tenth) / 10.0);
        estimator.predict(now);
        estimator.measure_gps(now, &fix(0.0, 0.0));
    }
    estimator.measure_gps(at(2.0), &fix(500.0, 0.0));
    assert!(estimator.estimate().unwrap().position.north_m().abs() < 0.5);
    assert_eq!(estimator.lost_for(at(2.5)), None);
    assert!(estimator.lost_for(at(3.0)).is_some());
    let bad = RawGps {
        satellites: 4,
        ..fix(0.0, 0.0)
    };
    estimator.measure_gps(at(3.0), &bad);
    assert!(estimator.lost_for(at(3.0)).is_some(), "too few satellites");
}

#[test]
fn an_attitude_that_no_vehicle_can_have_is_rejected() {
    let mut estimator = estimator();
    let turned = Attitude {
        roll_ddeg: 1_900,
        ..Attitude::default()
    };
    estimator.measure_attitude(at(0.0), &turned);
    assert!(estimator.tilt().roll_rad.abs() < f64::EPSILON);
}

#[test]
fn a_turn_that_no_vehicle_can_make_is_believed_when_the_next_attitude_confirms_it() {
    let attitude = |yaw_deg| Attitude {
        yaw_deg,
        ..Attitude::default()
    };
    let mut estimator = estimator();
    let mut yaw_deg = |seconds, yaw_deg| {
        estimator.measure_attitude(at(seconds), &attitude(yaw_deg));
        estimator.tilt().yaw_rad.to_degrees().round() as i16
    };
    assert_eq!(yaw_deg(0.0, 359), 359);
    assert_eq!(yaw_deg(0.1, 10), 10, "11° in 0.1 s");
    assert_eq!(yaw_deg(0.2, 120), 10, "110° in 0.1 s");
    assert_eq!(yaw_deg(0.3, 12), 12);
    assert_eq!(yaw_deg(0.4, 120), 12);
    assert_eq!(yaw_deg(0.5, 121), 121);
}

#[test]
fn vehicle_that_lies_on_its_side_is_not_taken_to_vanish() {
    let side = Tilt {
        roll_rad: TAU / 4.0,
        ..Tilt::default()
    };
    let [north, east] = side.acceleration_mps2();
    assert!(north.abs() < 1e-9 && (east - 16.98).abs() < 0.01);
}

#[test]
fn tilt_accelerates_to_where_it_leans() {
    let tilt = |roll_deg: f64, nose_down_deg: f64, yaw_deg: f64| Tilt {
        roll_rad: roll_deg.to_radians(),
        nose_down_rad: nose_down_deg.to_radians(),
        yaw_rad: yaw_deg.to_radians(),
    };
    let [north, east] = tilt(0.0, 10.0, 0.0).acceleration_mps2();
    assert!((north - 1.729).abs() < 1e-3 && east.abs() < 1e-9);
    let [north, east] = tilt(0.0, 10.0, 90.0).acceleration_mps2();
    assert!(north.abs() < 1e-9 && (east - 1.729).abs() < 1e-3);
    let [north, east] = tilt(10.0, 0.0, 0.0).acceleration_mps2();
    assert!(north.abs() < 1e-9 && (east - 1.729).abs() < 1e-3);
}
