//! The values that agents observed, as series for the page's script.

use std::collections::BTreeMap;

use muster_scenarios::report::{ObservedValue, Report};
use serde::Serialize;

/// Most names of values that are plotted.
pub(super) const NAMES_MAX: usize = 6;
/// Most points of one name, over all drones.
pub(super) const POINTS_MAX: usize = 5_000;

/// The values of a run, by name in alphabetical order.
#[derive(Debug, Serialize)]
pub(super) struct Values {
    series: Vec<Series>,
    /// Names that are not plotted, because [`NAMES_MAX`] others are.
    omitted: Vec<String>,
}

/// The values of one name.
#[derive(Debug, Serialize)]
struct Series {
    name: String,
    lines: Vec<Line>,
    /// Whether points were left out, so that at most about [`POINTS_MAX`] remain.
    thinned: bool,
}

/// The values of one drone, in order of time.
#[derive(Debug, Serialize)]
struct Line {
    drone: u32,
    /// Milliseconds from the start of the run.
    times: Vec<i64>,
    values: Vec<f64>,
}

/// The values of a run. Those that are not finite can't be plotted and are left out.
pub(super) fn values(report: &Report) -> Values {
    let mut by_name: BTreeMap<&str, BTreeMap<u32, Vec<&ObservedValue>>> = BTreeMap::new();
    let observed = report.swarms().flat_map(|swarm| &swarm.observed);
    for value in observed.filter(|it| it.value.is_finite()) {
        let by_drone = by_name.entry(&value.name).or_default();
        by_drone.entry(value.drone).or_default().push(value);
    }
    let omitted = by_name.keys().skip(NAMES_MAX);
    let omitted = omitted.map(|name| (*name).to_owned()).collect();
    let plotted = by_name.into_iter().take(NAMES_MAX);
    Values {
        series: plotted
            .map(|(name, by_drone)| series(name, by_drone))
            .collect(),
        omitted,
    }
}

fn series(name: &str, by_drone: BTreeMap<u32, Vec<&ObservedValue>>) -> Series {
    let most = (POINTS_MAX / by_drone.len()).max(2);
    let thinned = by_drone.values().any(|points| points.len() > most);
    let lines = by_drone.into_iter().map(|(drone, points)| {
        let points = extremes(points, most);
        Line {
            drone,
            times: points
                .iter()
                .map(|it| super::record::milliseconds(it.at_s))
                .collect(),
            values: points.iter().map(|it| short(it.value)).collect(),
        }
    });
    Series {
        name: name.to_owned(),
        lines: lines.collect(),
        thinned,
    }
}

/// At most `most` points, at least two: the least and the greatest of each of `most / 2` stretches, in order of time.
fn extremes(points: Vec<&ObservedValue>, most: usize) -> Vec<&ObservedValue> {
    if points.len() <= most {
        return points;
    }
    let stretch = points.len().div_ceil(most / 2);
    let of_stretch = points.chunks(stretch).flat_map(|stretch| {
        let by_value = |a: &usize, b: &usize| stretch[*a].value.total_cmp(&stretch[*b].value);
        let least = (0..stretch.len()).min_by(by_value).unwrap_or(0);
        let greatest = (0..stretch.len()).max_by(by_value).unwrap_or(0);
        let (first, second) = (least.min(greatest), least.max(greatest));
        let second = (first != second).then(|| stretch[second]);
        std::iter::once(stretch[first]).chain(second)
    });
    of_stretch.collect()
}

/// A value with six significant digits, which a plot can't tell from the value itself.
fn short(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}
