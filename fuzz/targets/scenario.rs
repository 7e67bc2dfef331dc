//! Scenario files: whatever one says, it is a scenario or refused with its place.

use muster_fuzz::with_file;
use muster_scenarios::scenario;

/// Thousands of drones are assigned to their slots in seconds, which is not what is looked for here.
const DIGITS_MAX: usize = 3;

pub(crate) fn run(bytes: &[u8]) {
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
