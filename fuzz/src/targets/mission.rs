//! Mission files of each format: any text is a route within its limits, or refused with an error that can be shown.

use std::path::Path;

use muster_runtime::mission_file::{HEIGHT_MAX_M, WAYPOINTS_MAX, parse};

pub(super) fn run(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else {
        return;
    };
    match parse(Path::new("mission"), text) {
        Ok(mission) => {
            let waypoints = mission.waypoints();
            assert!((1..=WAYPOINTS_MAX).contains(&waypoints.len()));
            let is_valid = |height: f64| height > 0.0 && height <= HEIGHT_MAX_M;
            assert!(waypoints.iter().all(|it| is_valid(it.altitude_m())));
        }
        Err(error) => assert!(!error.rendered().is_empty()),
    }
}
