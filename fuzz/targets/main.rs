//! One program for all fuzz targets, so that shared code is built once. The name by which the program is called selects the
//! target.
#![no_main]

mod drone;
mod drone_file;
mod echo;
mod flat;
mod frames;
mod journal;
mod lidar;
mod lists;
mod log;
mod map;
mod mission;
mod msp;
mod scenario;

use std::path::Path;
use std::sync::OnceLock;

use libfuzzer_sys::fuzz_target;

/// Runs a target on an input.
type Target = fn(&[u8]);

const TARGETS: [(&str, Target); 13] = [
    ("frames", frames::run),
    ("drone", drone::run),
    ("journal", journal::run),
    ("lists", lists::run),
    ("mission", mission::run),
    ("scenario", scenario::run),
    ("drone-file", drone_file::run),
    ("msp", msp::run),
    ("map", map::run),
    ("log", log::run),
    ("flat", flat::run),
    ("lidar", lidar::run),
    ("echo", echo::run),
];

fuzz_target!(|bytes: &[u8]| {
    static TARGET: OnceLock<Target> = OnceLock::new();
    TARGET.get_or_init(selected_target)(bytes);
});

fn selected_target() -> Target {
    let program = std::env::args_os().next().unwrap_or_default();
    let name = Path::new(&program).file_name().unwrap_or_default();
    let target = TARGETS.into_iter().find(|(target, _)| name == *target);
    let names = TARGETS.map(|(target, _)| target).join(", ");
    target
        .unwrap_or_else(|| panic!("call this program by one of these names: {names}"))
        .1
}
