//! Statistics of the runs of each combination.

use std::collections::{BTreeMap, BTreeSet};

use muster_scenarios::report::{command, count};

use super::plan::Campaign;
use super::row::{Row, or_empty, rounded, to_15_digits};
use super::statistics::Estimate;

/// A figure of a run that a summary estimates.
#[derive(Debug)]
pub struct Figure {
    /// Column in `runs.csv`.
    pub column: &'static str,
    /// Name in headings.
    pub name: &'static str,
    /// Short name of two lines, with the unit.
    pub short: &'static str,
    /// Unit; empty for a count.
    pub unit: &'static str,
    /// How it is measured.
    pub about: &'static str,
    /// Number of decimals in texts.
    pub digits: usize,
    /// Whether it is estimated from all runs without violations, or from those of them that completed their missions.
    scope: Scope,
    of: fn(&Row) -> Option<f64>,
}

/// The runs that a figure is estimated from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Scope {
    /// Those that broke no rule.
    Unbroken,
    /// Those that broke no rule and completed their missions.
    Complete,
}

/// All figures of a summary, in the order of the columns.
pub const FIGURES: [Figure; 11] = [
    Figure {
        column: "finished",
        name: "Drones that finished",
        short: "drones\nfinished",
        unit: "",
        about: "Drones that flew the mission to its end. Others stayed on the ground, landed early or were lost.",
        digits: 0,
        scope: Scope::Unbroken,
        of: |row| Some(count(row.finished)),
    },
    Figure {
        column: "flight_time_master_s",
        name: "Flight time of the master",
        short: "flight s\nmaster",
        unit: "s",
        about: "From the start of neighbour discovery to the end of landing.",
        digits: 1,
        scope: Scope::Complete,
        of: |row| row.flight_time_master_s,
    },
    Figure {
        column: "flight_time_mean_s",
        name: "Flight time, mean of the drones",
        short: "flight s\nmean",
        unit: "s",
        about: "Mean over the drones of a run that flew and landed.",
        digits: 1,
        scope: Scope::Complete,
        of: |row| row.flight_time_mean_s,
    },
    Figure {
        column: "flight_time_max_s",
        name: "Flight time, longest",
        short: "flight s\nlongest",
        unit: "s",
        about: "Longest flight time of a drone in a run.",
        digits: 1,
        scope: Scope::Complete,
        of: |row| row.flight_time_max_s,
    },
    Figure {
        column: "messages_received_mean",
        name: "Messages received, mean of the drones",
        short: "messages\nreceived",
        unit: "",
        about: "Frames that a drone accepted during its flight time.",
        digits: 0,
        scope: Scope::Unbroken,
        of: |row| Some(row.messages_received_mean),
    },
    Figure {
        column: "waypoint_wait_mean_ms",
        name: "Barrier wait, mean",
        short: "barrier\nwait ms",
        unit: "ms",
        about: "From the last arrival to the last departure at a waypoint.",
        digits: 1,
        scope: Scope::Unbroken,
        of: |row| row.waypoint_wait_mean_ms,
    },
    Figure {
        column: "transmissions_per_barrier",
        name: "Transmissions per barrier, mean",
        short: "frames/\nbarrier",
        unit: "",
        about: "Frames of all drones from the first arrival to the last departure, without keep-alives.",
        digits: 1,
        scope: Scope::Unbroken,
        of: |row| row.transmissions_per_barrier,
    },
    Figure {
        column: "keep_alives_per_barrier",
        name: "Keep-alives per barrier, mean",
        short: "keep-\nalives",
        unit: "",
        about: "Periodic frames sent in the same time.",
        digits: 1,
        scope: Scope::Unbroken,
        of: |row| row.keep_alives_per_barrier,
    },
    Figure {
        column: "retries_per_barrier",
        name: "Retries per barrier, mean",
        short: "MAC\nretries",
        unit: "",
        about: "Unicast frames retransmitted by the medium in the same time, for lack of an acknowledgement.",
        digits: 1,
        scope: Scope::Unbroken,
        of: |row| row.retries_per_barrier,
    },
    Figure {
        column: "election_max_s",
        name: "Election, longest",
        short: "election\nlongest s",
        unit: "s",
        about: "From the loss of the master until each network segment has one master that all its drones follow; of elections that ended.",
        digits: 2,
        scope: Scope::Unbroken,
        of: |row| row.election_max_s,
    },
    Figure {
        column: "min_separation_m",
        name: "Closest approach",
        short: "closest\nm",
        unit: "m",
        about: "Smallest straight-line distance of two flying drones.",
        digits: 2,
        scope: Scope::Unbroken,
        of: |row| row.min_separation_m,
    },
];

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

/// Collected figures of a combination's runs; 80 bytes of memory per run.
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
    for column in FIGURES
        .iter()
        .map(|it| it.column)
        .chain(observed.iter().copied())
    {
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
                or_empty(estimate.map(|it| it.n)),
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
        assert!(record.iter().skip(10).all(String::is_empty), "{record:?}");
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
