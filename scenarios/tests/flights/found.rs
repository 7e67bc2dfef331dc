//! Scenarios found by fault searches and fixed since: they break no rule any more.

use std::fs;

use muster_scenarios::engine::Engine;

use crate::support::{fly, scenario};

#[test]
fn scenarios_found_by_searches_break_no_rule() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/found");
    let mut found = 0;
    for file in fs::read_dir(folder).unwrap() {
        let name = file.unwrap().file_name().into_string().unwrap();
        let report = fly(&scenario(&format!("found/{name}"), &[]), Engine::Events);
        assert_eq!(report.violations, [], "{name}");
        found += 1;
    }
    assert!(found > 0, "{folder} is empty");
}
