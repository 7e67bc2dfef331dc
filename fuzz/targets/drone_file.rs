//! Drone files: any bytes are a valid configuration or refused with an error that can be shown.

use muster_daemon::config::DroneConfig;
use muster_fuzz::with_file;

pub(crate) fn run(bytes: &[u8]) {
    with_file("drone.toml", bytes, |path| match DroneConfig::load(path) {
        Ok(config) => assert!(!config.description().is_empty()),
        Err(error) => assert!(!error.rendered().is_empty()),
    });
}
