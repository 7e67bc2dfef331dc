use std::f64::consts::PI;

use super::*;

#[test]
fn malaga_lines_hold_motion_and_ranges_from_right_to_left() {
    let steps = parse("0 0.5 -0.1 0.2 3.0 4 1.0 2.5 - -1.000\n1 0 0 0 3.0 2 1 1\n").unwrap();
    assert_eq!(steps.len(), 2);
    let Step { motion, scan, .. } = &steps[0];
    assert_eq!(
        (motion.forward_m, motion.left_m, motion.turn_rad),
        (0.5, -0.1, 0.2)
    );
    assert!((scan.first_rad + 1.5).abs() < 1e-12 && (scan.between_rad - 1.0).abs() < 1e-12);
    assert_eq!(scan.ranges_m, [Some(1.0), Some(2.5), None, None]);
}

#[test]
fn carmen_scans_hold_the_motion_between_their_poses() {
    let log = "# CARMEN Logfile\nPARAM robot_frontlaser_offset 0.1\nTRUEPOS 4 5 0.5 0 0 0 1 host 1\n\
               FLASER 4 1 2 3 4 0.1 0 0 1.0 2.0 1.5707963267948966 10 host 10\n\
               ODOM 1 2 3 0 0 0 11 host 11\n\
               FLASER 3 1 2 3 0 0 0 1.0 2.5 1.5707963267948966 12 host 12\n";
    let steps = parse(log).unwrap();
    assert_eq!(steps[0].motion, Motion::default());
    assert!((steps[1].motion.forward_m - 0.5).abs() < 1e-9);
    assert!(steps[1].motion.left_m.abs() < 1e-9);
    assert!((steps[0].scan.between_rad - PI / 4.0).abs() < 1e-12);
    assert!((steps[1].scan.between_rad - PI / 2.0).abs() < 1e-12);
    assert_eq!(steps[1].truth, Some(MapPose::new(4.0, 5.0, 0.5)));
}

#[test]
fn carmen_ranges_at_the_lasers_maximum_are_no_return() {
    let log = "ROBOTLASER1 0 -1.5 3.0 0.5 81.9 0.01 0 3 1.0 81.9 2.0 1 7 0 0 0 1 2 0.5 0 0 0 0 0 1 host 1\n";
    let steps = parse(log).unwrap();
    assert_eq!(steps[0].scan.ranges_m, [Some(1.0), None, Some(2.0)]);
    assert!((steps[0].scan.first_rad + 1.5).abs() < 1e-12);
}

/// A fifth of such ranges, taken for walls right before the laser, led the filter astray.
#[test]
fn ranges_of_zero_are_no_return() {
    let ranges = |log: &str| parse(log).unwrap()[0].scan.ranges_m.clone();
    let expected = [Some(1.0), None, None];
    assert_eq!(ranges("0 0 0 0 3.1 3 1.0 0 0.000\n"), expected);
    assert_eq!(ranges("FLASER 3 1.0 0 0.0 0 0 0 0 0 0 1 h 1\n"), expected);
    let robot =
        "ROBOTLASER1 0 -1.5 3.0 0.5 81.9 0.01 0 3 1.0 0.00 0 0 0 0 0 1 2 0.5 0 0 0 0 0 1 h 1\n";
    assert_eq!(ranges(robot), expected);
}

#[test]
fn refusals_name_the_word_at_fault() {
    let place = |text: &str| {
        let refusal = parse(text).unwrap_err();
        text[refusal.span].to_owned()
    };
    assert_eq!(place("0 0 0 0 3.1 2 1.0 x"), "x");
    assert_eq!(place("0 0 nan 0 3.1 2 1.0 1.0"), "nan");
    assert_eq!(place("0 0 0 0 3.1 2 1.0 1.0 9.0"), "9.0");
    assert_eq!(place("0 0 0 0 3.1 2.5 1.0 1.0"), "2.5");
    assert_eq!(place("FLASER 2 1.0 -3 0 0 0 0 0 0"), "-3");
    assert_eq!(place("FLASER 2 1 1 0 0 0 0 0 0 1 h 1\nflaser 2"), "flaser");
}
