//! Scenario files: any bytes are a scenario, or refused with an error that can be shown.

use crate::with_file;
use muster_scenarios::scenario;

/// The most digits of a number, to skip scenarios with thousands of drones: assigning their slots takes seconds.
const DIGITS_MAX: usize = 3;

pub(super) fn run(bytes: &[u8]) {
    let is_small = |run: &[u8]| run.iter().filter(|it| it.is_ascii_digit()).count() <= DIGITS_MAX;
    if !bytes
        .split(|it| !it.is_ascii_digit() && *it != b'_')
        .all(is_small)
    {
        return;
    }
    with_file("scenario.toml", bytes, |path| {
        match scenario::load(path, &[]) {
            Ok(scenario) => assert!(!scenario.description().is_empty()),
            Err(error) => assert!(!error.rendered().is_empty()),
        }
    });
}
