//! What agents reported, as lines of the summary.

use std::collections::BTreeMap;

use muster_runtime::text::figure;
use muster_scenarios::report::{AgentFailure, Report};

/// Most drones that a line names.
const NAMED_MAX: usize = 4;

/// Failures of agents, and the last value of each name by drone.
pub(super) fn lines(report: &Report) -> Vec<(&'static str, String)> {
    let mut lines = Vec::new();
    let mut failures: BTreeMap<u32, (usize, &AgentFailure)> = BTreeMap::new();
    for failure in &report.agent_failures {
        let first = (0, failure);
        failures.entry(failure.drone).or_insert(first).0 += 1;
    }
    for (drone, (times, first)) in failures.iter().take(NAMED_MAX) {
        let what = first.cause();
        let times = if *times == 1 {
            "once".to_owned()
        } else {
            format!("{times} times")
        };
        let at = figure(first.at_s, 1);
        lines.push((
            "agent",
            format!("of drone {drone} failed {times}, first at {at} s: {what}"),
        ));
    }
    if failures.len() > NAMED_MAX {
        let more = failures.len() - NAMED_MAX;
        lines.push(("agent", format!("{more} other drones' agents failed, too")));
    }
    let mut values: BTreeMap<&str, BTreeMap<u32, f64>> = BTreeMap::new();
    for observed in &report.observed {
        let of_name = values.entry(&observed.name).or_default();
        of_name.insert(observed.drone, observed.value);
    }
    for (name, by_drone) in values {
        let named = by_drone.iter().take(NAMED_MAX);
        let named: Vec<_> = named
            .map(|(drone, value)| format!("{} (drone {drone})", short(*value)))
            .collect();
        let more = by_drone.len().saturating_sub(NAMED_MAX);
        let more = if more == 0 {
            String::new()
        } else {
            format!(" and {more} more")
        };
        lines.push(("value", format!("{name}: {}{more}", named.join(", "))));
    }
    lines
}

/// A value without needless digits.
fn short(value: f64) -> String {
    if value.fract() == 0.0 {
        format!("{value}")
    } else {
        figure(value, 2)
    }
}
