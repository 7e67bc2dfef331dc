//! What the runs of each combination come to.

use super::plan::Campaign;
use super::row::{Row, or_empty, rounded};
use super::statistics::Estimate;
use crate::report::command;

/// A figure that a run has and a summary estimates.
#[derive(Debug)]
pub struct Figure {
    /// Its column in `runs.csv`.
    pub column: &'static str,
    /// What it is, for a heading.
    pub name: &'static str,
    /// The same in two short lines, with its unit.
    pub short: &'static str,
    /// In what; empty for a count.
    pub unit: &'static str,
    /// How it is measured, in a sentence.
    pub about: &'static str,
    /// Digits after the point that mean something to a person.
    pub digits: usize,
    of: fn(&Row) -> Option<f64>,
}

/// Every figure of a summary, in the order of its columns.
pub const FIGURES: [Figure; 10] = [
    Figure {
        column: "flight_time_master_s",
        name: "Flight time of the master",
        short: "flight s\nmaster",
        unit: "s",
        about: "From the start of its neighbour discovery to the end of its landing.",
        digits: 1,
        of: |row| row.flight_time_master_s,
    },
    Figure {
        column: "flight_time_mean_s",
        name: "Flight time, mean of the drones",
        short: "flight s\nmean",
        unit: "s",
        about: "Over the drones of a run that flew and came down.",
        digits: 1,
        of: |row| row.flight_time_mean_s,
    },
    Figure {
        column: "flight_time_max_s",
        name: "Flight time, longest",
        short: "flight s\nlongest",
        unit: "s",
        about: "Of the drone of a run that flew the longest.",
        digits: 1,
        of: |row| row.flight_time_max_s,
    },
    Figure {
        column: "messages_received_mean",
        name: "Messages received, mean of the drones",
        short: "messages\nreceived",
        unit: "",
        about: "Frames that a drone let in during its flight time.",
        digits: 0,
        of: |row| Some(row.messages_received_mean),
    },
    Figure {
        column: "waypoint_wait_mean_ms",
        name: "Wait at a waypoint, mean",
        short: "waypoint\nwait ms",
        unit: "ms",
        about: "From the arrival of the last drone to the departure of the last drone.",
        digits: 1,
        of: |row| row.waypoint_wait_mean_ms,
    },
    Figure {
        column: "transmissions_per_barrier",
        name: "Transmissions a barrier, mean",
        short: "frames a\nbarrier",
        unit: "",
        about: "Frames that anyone sent from the arrival of the first drone to the departure of the last, those apart \
                that were sent only because their time had come.",
        digits: 1,
        of: |row| row.transmissions_per_barrier,
    },
    Figure {
        column: "keep_alives_per_barrier",
        name: "Keep-alives a barrier, mean",
        short: "keep-\nalives",
        unit: "",
        about: "Frames that were sent meanwhile only because their time had come.",
        digits: 1,
        of: |row| row.keep_alives_per_barrier,
    },
    Figure {
        column: "retries_per_barrier",
        name: "Retries of the medium a barrier, mean",
        short: "MAC\nretries",
        unit: "",
        about: "Frames for one drone that the medium sent again meanwhile, for want of an acknowledgement.",
        digits: 1,
        of: |row| row.retries_per_barrier,
    },
    Figure {
        column: "election_max_s",
        name: "Election, longest",
        short: "election\nlongest s",
        unit: "s",
        about: "From when a part of the swarm had lost its master until each part had one that all in it leader.",
        digits: 2,
        of: |row| row.election_max_s,
    },
    Figure {
        column: "min_separation_m",
        name: "Closest two drones came",
        short: "closest\nm",
        unit: "m",
        about: "In a straight line, at the closest approach of any two flying drones.",
        digits: 2,
        of: |row| row.min_separation_m,
    },
];

/// A combination of varied values and what its runs come to.
///
/// Runs that broke a rule are counted and not estimated from: they ended before their time.
#[derive(Debug, Clone, PartialEq)]
pub struct Summary {
    /// Which combination, from 0.
    pub combination: u64,
    /// Its values, in the order of the variations.
    pub values: Vec<String>,
    /// How many runs it has.
    pub runs: u64,
    /// How many of them broke a rule.
    pub broken: u64,
    /// How many of the others did not fly the mission to its end.
    pub incomplete: u64,
    /// How often rules were broken in them.
    pub violations: u64,
    /// How often a part of a swarm had lost its master in them.
    pub elections: u64,
    /// Each of [`FIGURES`], over the runs that kept the rules and have it.
    pub estimates: Vec<Option<Estimate>>,
}

/// A run that broke a rule.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Broken {
    /// Its place in the list.
    pub run: u64,
    /// The number of the first rule that it broke.
    pub rule: Option<u8>,
    /// What happened.
    pub what: String,
    /// The command that flies it again.
    pub command: String,
}

impl Broken {
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

/// The figures of a combination's runs: 80 bytes of memory a run.
#[derive(Debug, Default)]
pub(super) struct Tally {
    runs: u64,
    broken: u64,
    incomplete: u64,
    violations: u64,
    elections: u64,
    samples: [Vec<f64>; FIGURES.len()],
}

impl Tally {
    pub(super) fn add(&mut self, row: &Row) {
        self.runs += 1;
        self.violations += row.violations;
        self.elections += row.elections;
        self.incomplete += u64::from(row.is_incomplete());
        if row.is_broken() {
            self.broken += 1;
            return;
        }
        for (sample, figure) in self.samples.iter_mut().zip(&FIGURES) {
            sample.extend((figure.of)(row));
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
            estimates: self.samples.into_iter().map(Estimate::of).collect(),
        }
    }
}

/// The heading of `summary.csv`.
pub(super) fn heading(campaign: &Campaign) -> Vec<String> {
    let mut names = vec!["combination".to_owned()];
    names.extend(
        campaign
            .vary
            .iter()
            .map(|variation| variation.key().to_owned()),
    );
    let counts = ["runs", "broken", "incomplete", "violations", "elections"];
    names.extend(counts.map(str::to_owned));
    for Figure { column, .. } in &FIGURES {
        names.extend([
            format!("{column}_median"),
            format!("{column}_low"),
            format!("{column}_high"),
            format!("{column}_p99"),
        ]);
    }
    names
}

impl Summary {
    /// Its fields as they stand in `summary.csv`.
    pub(super) fn record(&self) -> Vec<String> {
        let mut fields = vec![self.combination.to_string()];
        fields.extend(self.values.iter().cloned());
        let counts = [
            self.runs,
            self.broken,
            self.incomplete,
            self.violations,
            self.elections,
        ];
        fields.extend(counts.map(|count| count.to_string()));
        for estimate in &self.estimates {
            let interval = estimate.as_ref().and_then(|it| it.interval);
            fields.extend([
                or_empty(estimate.as_ref().map(|it| rounded(it.median))),
                or_empty(interval.map(|(low, _)| low)),
                or_empty(interval.map(|(_, high)| high)),
                or_empty(estimate.as_ref().and_then(|it| it.p99).map(rounded)),
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
    fn runs_that_broke_a_rule_are_counted_and_not_estimated_from() {
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
        assert_eq!(with.values, ["0", "300"]);
        assert!(
            with.estimates
                .iter()
                .all(|it| it.as_ref().unwrap().interval.is_some())
        );
    }

    #[test]
    fn a_record_has_a_field_for_each_column_even_if_nothing_was_measured() {
        let campaign = plan::tests::campaign();
        let record = Tally::default().summary(&campaign, 0).record();
        assert_eq!(record.len(), heading(&campaign).len());
        assert!(record.iter().skip(8).all(String::is_empty), "{record:?}");
    }

    #[test]
    fn a_broken_run_names_the_command_that_repeats_it() {
        let campaign = plan::tests::campaign();
        let broken = Broken::new(&campaign, &row::tests::row(&campaign, 29, true));
        assert_eq!(
            broken.command,
            "muster sim scenarios/thesis-1.toml --seed 14 --engine events \
             --set formation.drones=7 --set radio.loss=0.2 --set radio.range_m=300"
        );
    }
}
