//! Missions, in each format: whatever a file says, it is a route within its bounds or refused with its place.

use std::path::Path;

use muster_runtime::mission_file::{HEIGHT_MAX_M, WAYPOINTS_MAX, parse};

pub(crate) fn run(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else {
        return;
    };
    match parse(Path::new("mission"), text) {
        Ok(mission) => {
            let waypoints = mission.waypoints();
            assert!((1..=WAYPOINTS_MAX).contains(&waypoints.len()));
            let is_low = |height: f64| height > 0.0 && height <= HEIGHT_MAX_M;
            assert!(waypoints.iter().all(|it| is_low(it.altitude_m())));
        }
        Err(error) => assert!(!error.rendered().is_empty()),
    }
}
