//! The row of one run.

use std::collections::BTreeMap;

use muster_scenarios::report::{Barrier, DroneReport, Engine, Report};
use serde::{Deserialize, Serialize};

use super::plan::Campaign;

/// A line of `runs.jsonl`. `runs.csv` has the same fields but what agents observed, and one column per varied field.
///
/// No field depends on when, where or how fast the run was made. Times and lengths are rounded to 1e-6, so that any JSON
/// reader reads back the same value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    /// Index in the campaign's list, from 0.
    pub run: u64,
    /// Index of the combination of varied values, from 0.
    pub combination: u64,
    /// Values of the varied fields.
    pub varied: BTreeMap<String, String>,
    /// Random seed.
    pub seed: u64,
    /// Simulation engine.
    pub engine: Engine,
    /// BLAKE3 of all observable events, in hexadecimal.
    pub trace: String,
    /// Duration in simulated seconds.
    pub simulated_s: f64,
    /// Number of drones of the scenario's own swarm. The fields below refer to this swarm unless they say otherwise.
    pub drones: u64,
    /// Number of drones that took off and landed; one that fell did not land.
    pub landed: u64,
    /// Number of drones that flew the mission to its end.
    pub finished: u64,
    /// Flight time of the master, in seconds; `None` if it did not land.
    pub flight_time_master_s: Option<f64>,
    /// Mean flight time of the drones that have one: from the start of neighbour discovery to the end of landing.
    pub flight_time_mean_s: Option<f64>,
    /// Longest flight time.
    pub flight_time_max_s: Option<f64>,
    /// Accepted frames, mean over the drones.
    pub messages_received_mean: f64,
    /// Sent frames, mean over the drones.
    pub messages_sent_mean: f64,
    /// Number of barriers.
    pub barriers: u64,
    /// Barrier wait, from the last arrival to the last departure, in milliseconds; mean over the barriers.
    pub waypoint_wait_mean_ms: Option<f64>,
    /// Frames sent by all drones from the first arrival to the last departure, without keep-alives; mean over the barriers.
    pub transmissions_per_barrier: Option<f64>,
    /// Keep-alives sent in the same time; mean over the barriers.
    pub keep_alives_per_barrier: Option<f64>,
    /// Retries of the medium in the same time; mean over the barriers.
    pub retries_per_barrier: Option<f64>,
    /// Time from a drone's arrival to its departure, in seconds; mean of the drones' means.
    pub waypoint_delay_mean_s: Option<f64>,
    /// Number of periods in which a segment of any swarm had no master, or more than one.
    pub elections: u64,
    /// Number of such periods that lasted until the end.
    pub elections_unsettled: u64,
    /// Longest such period that ended, in seconds.
    pub election_max_s: Option<f64>,
    /// Distance of the drones that followed the master from their slots around it, in metres; mean. `None` if none followed.
    pub following_mean_m: Option<f64>,
    /// 95th percentile of these distances.
    pub following_p95_m: Option<f64>,
    /// Longest of these distances.
    pub following_max_m: Option<f64>,
    /// Receptions lost to a collision or because the receiver was transmitting, of all radios. `None` on an ideal medium.
    pub medium_collided: Option<u64>,
    /// Receptions lost by `radio.loss`, likewise.
    pub medium_lost: Option<u64>,
    /// Unicast datagrams that the medium gave up after the last retry, likewise.
    pub medium_given_up: Option<u64>,
    /// Closest approach of two flying drones, in metres.
    pub min_separation_m: Option<f64>,
    /// Number of actor restarts of all drones.
    pub restarts: u64,
    /// Number of failures of agents, of all swarms.
    pub agent_failures: u64,
    /// The last value of each name that agents of the scenario's own swarm observed, of whichever drone; finite ones, of the
    /// names that were observed first.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub observed: BTreeMap<String, f64>,
    /// Whether all swarms completed their missions, each in contact and without drones that stayed on the ground.
    pub mission_completed: bool,
    /// Number of faults in the scenario file that never happened; 0 if a rule was broken, which ended the run.
    pub never_injected: u64,
    /// Number of violations; the first one stops the run.
    pub violations: u64,
    /// Number of the first broken rule.
    pub rule: Option<u8>,
    /// Description of the first violation.
    pub violation: Option<String>,
}

/// The columns of `runs.csv` before and after the varied fields.
const COLUMNS: (&[&str], &[&str]) = (
    &["run", "combination"],
    &[
        "seed",
        "engine",
        "trace",
        "simulated_s",
        "drones",
        "landed",
        "finished",
        "flight_time_master_s",
        "flight_time_mean_s",
        "flight_time_max_s",
        "messages_received_mean",
        "messages_sent_mean",
        "barriers",
        "waypoint_wait_mean_ms",
        "transmissions_per_barrier",
        "keep_alives_per_barrier",
        "retries_per_barrier",
        "waypoint_delay_mean_s",
        "elections",
        "elections_unsettled",
        "election_max_s",
        "following_mean_m",
        "following_p95_m",
        "following_max_m",
        "medium_collided",
        "medium_lost",
        "medium_given_up",
        "min_separation_m",
        "restarts",
        "agent_failures",
        "mission_completed",
        "never_injected",
        "violations",
        "rule",
        "violation",
    ],
);

impl Row {
    /// The row of run `run` of a campaign.
    #[must_use]
    pub(super) fn new(campaign: &Campaign, run: u64, report: &Report) -> Self {
        let (combination, seed) = campaign.run(run);
        Self {
            run,
            combination,
            varied: varied(campaign, combination),
            seed,
            engine: campaign.engine,
            ..Self::of(report)
        }
    }

    /// The row of a simulation on its own: run 0, without varied fields.
    ///
    /// # Panics
    /// The drones flew as processes.
    #[must_use]
    pub fn of(report: &Report) -> Self {
        let flight_times = || report.drones.iter().filter_map(|drone| drone.flight_time_s);
        let master = report.master().and_then(|drone| drone.flight_time_s);
        let number = |which: &dyn Fn(&DroneReport) -> bool| {
            report.drones.iter().filter(|it| which(it)).count() as u64
        };
        let mean = |what: fn(&Barrier) -> u64| report.mean_of_barriers(what).map(rounded);
        let first = report.violations.first();
        let following = report.following.as_ref();
        let elections = || report.swarms().flat_map(|swarm| &swarm.elections);
        let settled = elections().filter_map(|it| it.settled_after_s);
        Self {
            run: 0,
            combination: 0,
            varied: BTreeMap::new(),
            seed: report.seed,
            engine: report.engine.expect("a simulation has an engine"),
            trace: report.trace.clone().expect("a simulation has a trace"),
            simulated_s: rounded(report.simulated_s),
            drones: report.drones.len() as u64,
            landed: number(&|it| it.landed),
            finished: number(&DroneReport::has_finished),
            flight_time_master_s: master.map(rounded),
            flight_time_mean_s: report.means.flight_time_s.map(rounded),
            flight_time_max_s: flight_times().reduce(f64::max).map(rounded),
            messages_received_mean: rounded(report.means.messages_received),
            messages_sent_mean: rounded(report.mean_messages_sent().unwrap_or_default()),
            barriers: report.barriers.len() as u64,
            waypoint_wait_mean_ms: report.mean_wait_s().map(|it| rounded(it * 1e3)),
            transmissions_per_barrier: mean(|barrier| barrier.transmissions),
            keep_alives_per_barrier: mean(|barrier| barrier.keep_alives),
            retries_per_barrier: mean(|barrier| barrier.retries),
            waypoint_delay_mean_s: report.mean_waypoint_delay_s().map(rounded),
            elections: elections().count() as u64,
            elections_unsettled: elections()
                .filter(|it| it.settled_after_s.is_none())
                .count() as u64,
            election_max_s: settled.reduce(f64::max).map(rounded),
            following_mean_m: following.map(|it| rounded(it.mean_m)),
            following_p95_m: following.map(|it| rounded(it.p95_m)),
            following_max_m: following.map(|it| rounded(it.max_m)),
            medium_collided: report.medium.map(|it| it.collided),
            medium_lost: report.medium.map(|it| it.lost),
            medium_given_up: report.medium.map(|it| it.given_up),
            min_separation_m: report.min_separation_m.map(rounded),
            restarts: report.drones.iter().map(restarts).sum(),
            agent_failures: report
                .swarms()
                .map(|it| it.agent_failures.len() as u64)
                .sum(),
            observed: observed(report),
            mission_completed: report.are_missions_completed(),
            never_injected: report.never_injected.len() as u64,
            violations: report.violations.len() as u64,
            rule: first.map(|violation| violation.rule),
            violation: first.map(|violation| violation.what.clone()),
        }
    }

    /// Whether it is the row of run `run` of a campaign.
    pub(super) fn belongs_to(&self, campaign: &Campaign, run: u64) -> bool {
        let (combination, seed) = campaign.run(run);
        (self.run, self.combination, self.seed, self.engine)
            == (run, combination, seed, campaign.engine)
            && self.varied == varied(campaign, combination)
    }

    /// Whether a rule was broken, which stopped the run.
    #[must_use]
    pub const fn is_broken(&self) -> bool {
        self.violations > 0
    }

    /// Whether no rule was broken but the mission was not completed.
    #[must_use]
    pub const fn is_incomplete(&self) -> bool {
        !self.is_broken() && !self.mission_completed
    }

    /// Its fields in the order of `runs.csv`.
    pub(super) fn record(&self, campaign: &Campaign) -> Vec<String> {
        let varied = campaign.varied(self.combination);
        let mut fields = vec![self.run.to_string(), self.combination.to_string()];
        fields.extend(varied.iter().map(|change| change.value().to_owned()));
        fields.extend([
            self.seed.to_string(),
            self.engine.to_string(),
            self.trace.clone(),
            self.simulated_s.to_string(),
            self.drones.to_string(),
            self.landed.to_string(),
            self.finished.to_string(),
            or_empty(self.flight_time_master_s),
            or_empty(self.flight_time_mean_s),
            or_empty(self.flight_time_max_s),
            self.messages_received_mean.to_string(),
            self.messages_sent_mean.to_string(),
            self.barriers.to_string(),
            or_empty(self.waypoint_wait_mean_ms),
            or_empty(self.transmissions_per_barrier),
            or_empty(self.keep_alives_per_barrier),
            or_empty(self.retries_per_barrier),
            or_empty(self.waypoint_delay_mean_s),
            self.elections.to_string(),
            self.elections_unsettled.to_string(),
            or_empty(self.election_max_s),
            or_empty(self.following_mean_m),
            or_empty(self.following_p95_m),
            or_empty(self.following_max_m),
            or_empty(self.medium_collided),
            or_empty(self.medium_lost),
            or_empty(self.medium_given_up),
            or_empty(self.min_separation_m),
            self.restarts.to_string(),
            self.agent_failures.to_string(),
            self.mission_completed.to_string(),
            self.never_injected.to_string(),
            self.violations.to_string(),
            or_empty(self.rule),
            or_empty(self.violation.as_deref()),
        ]);
        fields
    }
}

/// The header of `runs.csv`.
pub(super) fn heading(campaign: &Campaign) -> Vec<String> {
    let (before, after) = COLUMNS;
    let owned = |names: &[&str]| {
        names
            .iter()
            .map(|name| (*name).to_owned())
            .collect::<Vec<_>>()
    };
    let mut names = owned(before);
    names.extend(
        campaign
            .vary
            .iter()
            .map(|variation| variation.key().to_owned()),
    );
    names.extend(owned(after));
    names
}

/// A value as a CSV field; empty for `None`.
pub(super) fn or_empty(value: Option<impl ToString>) -> String {
    value.map(|value| value.to_string()).unwrap_or_default()
}

fn varied(campaign: &Campaign, combination: u64) -> BTreeMap<String, String> {
    campaign
        .varied(combination)
        .into_iter()
        .map(|change| (change.key().to_owned(), change.value().to_owned()))
        .collect()
}

/// Most names of observed values in a row.
const NAMES_MAX: usize = 100;

fn observed(report: &Report) -> BTreeMap<String, f64> {
    let mut last = BTreeMap::new();
    for value in &report.observed {
        let rounded = to_15_digits(value.value);
        let has_place = last.len() < NAMES_MAX || last.contains_key(&value.name);
        if rounded.is_finite() && has_place {
            last.insert(value.name.clone(), rounded);
        }
    }
    last
}

fn restarts(drone: &DroneReport) -> u64 {
    u64::from(drone.restarts)
}

/// Rounds to 15 significant digits, whatever the size of the value.
pub(super) fn to_15_digits(value: f64) -> f64 {
    let rounded = format!("{value:.14e}").parse();
    rounded
        .ok()
        .filter(|it: &f64| it.is_finite())
        .unwrap_or(value)
}

/// Rounds to 1e-6. Up to 15 digits, decimal text and float convert exactly in both directions.
pub(super) fn rounded(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}

#[cfg(test)]
pub(super) mod tests {
    use muster_scenarios::report::ObservedValue;

    use super::*;
    use crate::campaign::plan;
    use crate::output::sample;

    /// The row of a sample run, with or without faults.
    pub(in crate::campaign) fn row(campaign: &Campaign, run: u64, faulty: bool) -> Row {
        let (mut report, _) = if faulty {
            sample::faulty()
        } else {
            sample::swarm(5)
        };
        report.engine = Some(Engine::Events);
        report.elections = vec![muster_scenarios::report::Election {
            at_s: 100.0,
            led_after_s: Some(0.4),
            settled_after_s: Some(0.5),
            masters: vec![1, 3],
        }];
        report.following = Some(muster_scenarios::report::FormationError {
            followed_s: 60.0,
            mean_m: 0.5,
            p95_m: 1.25,
            max_m: 2.0,
        });
        report.medium = Some(muster_scenarios::report::MediumCounters {
            sent: 900,
            acknowledgements: 100,
            retries: 12,
            given_up: 1,
            dropped: 0,
            collided: 30,
            lost: 7,
        });
        report.agent_failures = vec![muster_scenarios::report::AgentFailure {
            at_s: 50.0,
            drone: 2,
            what: "on purpose".to_owned(),
        }];
        report.observed = [f64::MAX, 3.2e-8, f64::NAN]
            .map(|value| ObservedValue {
                at_s: value,
                drone: 1,
                name: "finds".to_owned(),
                value,
            })
            .into();
        Row::new(campaign, run, &report)
    }

    #[test]
    fn row_is_read_back_as_written() {
        let campaign = plan::tests::campaign();
        for faulty in [false, true] {
            let row = row(&campaign, 7, faulty);
            assert_eq!(row.observed, [("finds".to_owned(), 3.2e-8)].into());
            let line = serde_json::to_string(&row).unwrap();
            assert_eq!(serde_json::from_str::<Row>(&line).unwrap(), row);
            assert!(row.belongs_to(&campaign, 7));
            assert!(!row.belongs_to(&campaign, 8));
        }
    }

    #[test]
    fn columns_are_the_fields_of_a_row_but_what_agents_observed() {
        let mut campaign = plan::tests::campaign();
        campaign.vary.clear();
        let json = serde_json::to_value(row(&campaign, 0, false)).unwrap();
        let fields = json.as_object().unwrap().keys().map(String::as_str);
        let mut columns = heading(&campaign);
        columns.extend(["varied", "observed"].map(str::to_owned));
        columns.sort_unstable();
        let mut fields: Vec<_> = fields.collect();
        fields.sort_unstable();
        assert_eq!(columns, fields);
    }

    #[test]
    fn record_has_one_field_per_column() {
        let campaign = plan::tests::campaign();
        let names = heading(&campaign);
        let record = row(&campaign, 29, true).record(&campaign);
        assert_eq!(names.len(), record.len());
        let field = |name: &str| &record[names.iter().position(|it| it == name).unwrap()];
        assert_eq!(field("radio.loss"), "0.2");
        assert_eq!(field("seed"), "14");
        assert_eq!(field("rule"), "3");
        assert_eq!(field("drones"), "6");
        assert_eq!(field("landed"), "5");
        assert_eq!(field("finished"), "4", "one landed early, one did not land");
        assert_eq!(field("agent_failures"), "1");
        assert_eq!(field("following_p95_m"), "1.25");
        assert_eq!(field("medium_collided"), "30");
    }

    #[test]
    fn election_that_does_not_end_is_counted_and_has_no_duration() {
        let (mut report, _) = sample::swarm(5);
        let election = |settled_after_s| muster_scenarios::report::Election {
            at_s: 100.0,
            led_after_s: None,
            settled_after_s,
            masters: Vec::new(),
        };
        report.elections = vec![election(Some(0.5)), election(None)];
        let row = Row::of(&report);
        assert_eq!((row.elections, row.elections_unsettled), (2, 1));
        assert_eq!(row.election_max_s, Some(0.5));
    }

    #[test]
    fn row_does_not_depend_on_wall_time_and_path() {
        let campaign = plan::tests::campaign();
        let (mut report, _) = sample::swarm(5);
        let first = Row::new(&campaign, 0, &report);
        report.wall_s *= 2.0;
        report.scenario = "elsewhere.toml".to_owned();
        assert_eq!(Row::new(&campaign, 0, &report), first);
    }
}
