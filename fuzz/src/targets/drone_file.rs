//! Drone files: any bytes are a valid configuration or refused with an error that can be shown.

use crate::with_file;
use muster_daemon::config::DroneConfig;

pub(super) fn run(bytes: &[u8]) {
    with_file("drone.toml", bytes, |path| match DroneConfig::load(path) {
        Ok(config) => assert!(!config.description().is_empty()),
        Err(error) => assert!(!error.rendered().is_empty()),
    });
}
