//! One program for all fuzz targets, so that shared code is built once. The name by which the program is called selects the
//! target.
#![no_main]

use std::path::Path;
use std::sync::OnceLock;

use libfuzzer_sys::fuzz_target;
use muster_fuzz::TARGETS;

fuzz_target!(|bytes: &[u8]| {
    static TARGET: OnceLock<fn(&[u8])> = OnceLock::new();
    TARGET.get_or_init(selected_target)(bytes);
});

fn selected_target() -> fn(&[u8]) {
    let program = std::env::args_os().next().unwrap_or_default();
    let name = Path::new(&program).file_name().unwrap_or_default();
    let target = TARGETS.iter().find(|target| name == target.name);
    let names = TARGETS.map(|target| target.name).join(", ");
    target
        .unwrap_or_else(|| panic!("call this program by one of these names: {names}"))
        .run
}
