//! One program for all that reads bytes from outside, so that what they share is built once: which of it is fuzzed is told
//! by the name by which the program is called.
#![no_main]

mod drone;
mod drone_file;
mod frames;
mod journal;
mod lists;
mod mission;
mod scenario;

use std::path::Path;
use std::sync::OnceLock;

use libfuzzer_sys::fuzz_target;

/// What is done with some bytes.
type Target = fn(&[u8]);

const TARGETS: [(&str, Target); 7] = [
    ("frames", frames::run),
    ("drone", drone::run),
    ("journal", journal::run),
    ("lists", lists::run),
    ("mission", mission::run),
    ("scenario", scenario::run),
    ("drone-file", drone_file::run),
];

fuzz_target!(|bytes: &[u8]| {
    static CALLED: OnceLock<Target> = OnceLock::new();
    CALLED.get_or_init(called)(bytes);
});

fn called() -> Target {
    let program = std::env::args_os().next().unwrap_or_default();
    let name = Path::new(&program).file_name().unwrap_or_default();
    let target = TARGETS.into_iter().find(|(target, _)| name == *target);
    let names = TARGETS.map(|(target, _)| target).join(", ");
    target
        .unwrap_or_else(|| panic!("call this program by one of these names: {names}"))
        .1
}
