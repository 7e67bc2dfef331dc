//! Statistics of the runs of each combination.

use std::collections::{BTreeMap, BTreeSet};

use muster_scenarios::report::command;

use super::figures::{FIGURES, Figure, Scope};
use super::plan::Campaign;
use super::row::{Row, or_empty, rounded, to_15_digits};
use super::statistics::Estimate;

/// Statistics of a combination of varied values.
///
/// Runs that broke a rule are counted but excluded from the estimates, because they stopped early. So are incomplete runs
/// from those of the flight times: drones that land early or stay on the ground would make them look better.
#[derive(Debug, Clone, PartialEq)]
pub struct Summary {
    /// Index of the combination, from 0.
    pub combination: u64,
    /// Values of the varied fields, in the order of the variations.
    pub values: Vec<String>,
    /// Number of runs.
    pub runs: u64,
    /// Runs that broke a rule.
    pub broken: u64,
    /// Runs that broke no rule but did not complete the mission.
    pub incomplete: u64,
    /// Number of violations.
    pub violations: u64,
    /// Number of elections.
    pub elections: u64,
    /// Number of elections that were not over at the end of a run.
    pub elections_unsettled: u64,
    /// Runs in which a fault of the scenario never happened.
    pub never_injected: u64,
    /// Estimates of [`FIGURES`], over the runs that broke no rule and have the figure; of flight times, over the complete ones.
    pub estimates: Vec<Option<Estimate>>,
    /// Estimates of the last value of each name that agents observed, over the runs that broke no rule and have it.
    pub observed: BTreeMap<String, Estimate>,
}

/// A run that broke a rule.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BrokenRun {
    /// Index in the campaign's list.
    pub run: u64,
    /// Number of the first broken rule.
    pub rule: Option<u8>,
    /// Description of the violation.
    pub what: String,
    /// Command that repeats the run.
    pub command: String,
}

impl BrokenRun {
    pub(super) fn new(campaign: &Campaign, row: &Row) -> Self {
        let overrides = campaign.overrides(row.combination);
        let overrides: Vec<_> = overrides.iter().map(ToString::to_string).collect();
        Self {
            run: row.run,
            rule: row.rule,
            what: row.violation.clone().unwrap_or_default(),
            command: command(
                &campaign.scenario,
                row.seed,
                Some(campaign.engine),
                &overrides,
            ),
        }
    }
}

/// Collected figures of a combination's runs; at most 136 bytes of memory per run.
#[derive(Debug, Default)]
pub(super) struct Tally {
    runs: u64,
    broken: u64,
    incomplete: u64,
    violations: u64,
    elections: u64,
    elections_unsettled: u64,
    never_injected: u64,
    samples: [Vec<f64>; FIGURES.len()],
    observed: BTreeMap<String, Vec<f64>>,
}

impl Tally {
    pub(super) fn add(&mut self, row: &Row) {
        self.runs += 1;
        self.violations += row.violations;
        self.elections += row.elections;
        self.never_injected += u64::from(row.never_injected > 0);
        self.elections_unsettled += row.elections_unsettled;
        self.incomplete += u64::from(row.is_incomplete());
        if row.is_broken() {
            self.broken += 1;
            return;
        }
        for (sample, figure) in self.samples.iter_mut().zip(&FIGURES) {
            if row.mission_completed || figure.scope == Scope::Unbroken {
                sample.extend((figure.of)(row));
            }
        }
        for (name, value) in &row.observed {
            self.observed.entry(name.clone()).or_default().push(*value);
        }
    }

    pub(super) fn summary(self, campaign: &Campaign, combination: u64) -> Summary {
        let values = campaign.varied(combination);
        Summary {
            combination,
            values: values
                .iter()
                .map(|change| change.value().to_owned())
                .collect(),
            runs: self.runs,
            broken: self.broken,
            incomplete: self.incomplete,
            violations: self.violations,
            elections: self.elections,
            elections_unsettled: self.elections_unsettled,
            never_injected: self.never_injected,
            estimates: self.samples.into_iter().map(Estimate::of).collect(),
            observed: (self.observed.into_iter())
                .filter_map(|(name, sample)| Some((name, Estimate::of(sample)?)))
                .collect(),
        }
    }
}

/// The figures that some run has, with their places in [`FIGURES`]: no run of a mission has a formation error.
pub(super) fn shown(summaries: &[Summary]) -> Vec<(usize, &'static Figure)> {
    let has = |place: usize| summaries.iter().any(|it| it.estimates[place].is_some());
    let figures = FIGURES.iter().enumerate();
    figures.filter(|(place, _)| has(*place)).collect()
}

/// The names that agents observed, in alphabetical order.
pub(super) fn observed(summaries: &[Summary]) -> BTreeSet<&str> {
    let names = summaries.iter().flat_map(|it| it.observed.keys());
    names.map(String::as_str).collect()
}

/// The header of `summary.csv`. `observed`: the names that agents observed.
pub(super) fn heading(campaign: &Campaign, observed: &BTreeSet<&str>) -> Vec<String> {
    let mut names = vec!["combination".to_owned()];
    names.extend(
        campaign
            .vary
            .iter()
            .map(|variation| variation.key().to_owned()),
    );
    let counts = [
        "runs",
        "broken",
        "incomplete",
        "violations",
        "elections",
        "elections_unsettled",
        "never_injected",
    ];
    names.extend(counts.map(str::to_owned));
    let columns = FIGURES.iter().map(|it| it.column.to_owned());
    for column in columns.chain(observed.iter().map(|name| column_of(name))) {
        names.extend([
            format!("{column}_median"),
            format!("{column}_low"),
            format!("{column}_high"),
            format!("{column}_p99"),
            format!("{column}_n"),
        ]);
    }
    names
}

/// The column of an observed value: its name, after "observed." if a figure has that name.
fn column_of(observed: &str) -> String {
    let is_taken = FIGURES.iter().any(|it| it.column == observed);
    let prefix = if is_taken { "observed." } else { "" };
    format!("{prefix}{observed}")
}

impl Summary {
    /// Its fields in the order of `summary.csv`.
    pub(super) fn record(&self, observed: &BTreeSet<&str>) -> Vec<String> {
        let mut fields = vec![self.combination.to_string()];
        fields.extend(self.values.iter().cloned());
        let counts = [
            self.runs,
            self.broken,
            self.incomplete,
            self.violations,
            self.elections,
            self.elections_unsettled,
            self.never_injected,
        ];
        fields.extend(counts.map(|count| count.to_string()));
        let figures = self.estimates.iter().map(Option::as_ref);
        let figures = figures.map(|it| (it, rounded as fn(f64) -> f64));
        let observed = observed.iter().map(|name| self.observed.get(*name));
        let observed = observed.map(|it| (it, to_15_digits as fn(f64) -> f64));
        for (estimate, rounded) in figures.chain(observed) {
            let interval = estimate.and_then(|it| it.interval);
            fields.extend([
                or_empty(estimate.map(|it| rounded(it.median))),
                or_empty(interval.map(|(low, _)| low)),
                or_empty(interval.map(|(_, high)| high)),
                or_empty(estimate.and_then(|it| it.p99).map(rounded)),
                estimate.map_or(0, |it| it.n).to_string(),
            ]);
        }
        fields
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::{plan, row};

    #[test]
    fn broken_runs_are_counted_but_excluded_from_estimates() {
        let campaign = plan::tests::campaign();
        let mut tally = Tally::default();
        for run in 0..6 {
            tally.add(&row::tests::row(&campaign, run, false));
        }
        let without = tally.summary(&campaign, 1);
        let mut tally = Tally::default();
        for run in 0..8 {
            tally.add(&row::tests::row(&campaign, run, run >= 6));
        }
        let with = tally.summary(&campaign, 1);
        assert_eq!((with.runs, with.broken, with.violations), (8, 2, 4));
        assert_eq!(with.estimates, without.estimates);
        assert_eq!(with.observed, without.observed);
        assert!((with.observed["finds"].median - 3.2e-8).abs() < 1e-15);
        assert_eq!(with.values, ["0", "300"]);
        let record = with.record(&BTreeSet::from(["finds"]));
        assert_eq!(record[record.len() - 5], "0.000000032", "{record:?}");
        assert_eq!(record[record.len() - 1], "6", "runs that broke no rule");
        assert!(
            with.estimates
                .iter()
                .all(|it| it.as_ref().unwrap().interval.is_some())
        );
    }

    #[test]
    fn flight_times_of_incomplete_runs_are_not_estimated_from() {
        let campaign = plan::tests::campaign();
        let mut tally = Tally::default();
        for run in 0..8 {
            let mut row = row::tests::row(&campaign, run, false);
            if run >= 6 {
                row.mission_completed = false;
                row.flight_time_master_s = Some(1.0);
            }
            tally.add(&row);
        }
        let summary = tally.summary(&campaign, 1);
        assert_eq!((summary.broken, summary.incomplete), (0, 2));
        for (figure, estimate) in FIGURES.iter().zip(&summary.estimates) {
            let is_flight_time = figure.column.starts_with("flight_time");
            let estimate = estimate.as_ref().unwrap();
            let n = if is_flight_time { 6 } else { 8 };
            assert_eq!(estimate.n, n, "{}", figure.column);
            assert!(
                !is_flight_time || estimate.drawn[0] > 1.0,
                "{}",
                figure.column
            );
        }
    }

    #[test]
    fn record_without_runs_has_one_field_per_column() {
        let campaign = plan::tests::campaign();
        let observed = BTreeSet::from(["finds"]);
        let record = Tally::default().summary(&campaign, 0).record(&observed);
        assert_eq!(record.len(), heading(&campaign, &observed).len());
        let estimates = record[10..].chunks(5);
        assert_eq!(estimates.len(), FIGURES.len() + 1);
        for estimate in estimates {
            assert_eq!(estimate, ["", "", "", "", "0"], "{record:?}");
        }
    }

    #[test]
    fn observed_value_with_the_name_of_a_figure_has_a_column_of_its_own() {
        let campaign = plan::tests::campaign();
        let mut names = heading(&campaign, &BTreeSet::from(["finds", "finished"]));
        for expected in ["finds_n", "finished_median", "observed.finished_median"] {
            assert!(names.iter().any(|it| it == expected), "{expected}");
        }
        let all = names.len();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), all, "no column is there twice");
    }

    #[test]
    fn broken_run_has_the_command_that_repeats_it() {
        let campaign = plan::tests::campaign();
        let broken = BrokenRun::new(&campaign, &row::tests::row(&campaign, 29, true));
        assert_eq!(
            broken.command,
            "muster sim scenarios/thesis-1.toml --seed 14 --engine events \
             --set formation.drones=7 --set radio.loss=0.2 --set radio.range_m=300"
        );
    }
}
