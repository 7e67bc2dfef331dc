//! Drones' files: whatever one says, it is a drone that can be flown or refused with its place.

use muster_daemon::config::DroneConfig;
use muster_fuzz::with_file;

pub(crate) fn run(bytes: &[u8]) {
    with_file("drone.toml", bytes, |path| match DroneConfig::load(path) {
        Ok(config) => assert!(!config.description().is_empty()),
        Err(error) => assert!(!error.rendered().is_empty()),
    });
}
