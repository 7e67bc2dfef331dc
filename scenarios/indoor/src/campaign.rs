//! Many patrols of one flat, seed by seed, each beside the same one without noise.

use std::num::NonZeroUsize;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::channel;

use comfy_table::{CellAlignment, Table};
use muster_experiments::campaign::{Seeds, median};
use muster_indoor::patrol::EarlyLanding;
use muster_runtime::text::{figure, plural, rounded_down, rounded_up};
use muster_scenarios::report::TABLE_STYLE;

use crate::engine;
use crate::world::{Failing, Outcome, Prepared, Setup};

/// Least share of what can be seen that a patrol must see.
pub const SEEN_MIN: f64 = 0.99;
/// A patrol may take so many times as long as the same one without noise.
pub const TIMES_MAX: f64 = 1.5;
/// Most failed patrols that a table or a page lists.
pub(crate) const LISTED_MAX: usize = 20;

/// One patrol in short.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Its seed.
    pub seed: u64,
    /// Whether the drone ended it.
    pub is_done: bool,
    /// In seconds.
    pub time_s: f64,
    /// Its time in times of the patrol among the same people without noise.
    pub times: f64,
    /// Its time in times of the patrol without noise and people.
    pub times_alone: f64,
    /// Share of what can be seen that was seen.
    pub seen: f64,
    /// Least distance from walls and people, in metres.
    pub clearance_m: f64,
    /// Touches that the drone caused, and that people caused.
    pub touches: [usize; 2],
    /// Why the drone landed early, if it did.
    pub landed: Option<EarlyLanding>,
    /// Stops that were given up.
    pub given_up: usize,
    /// Error of the believed position that 95 % of the steps stay below, in metres.
    pub error_p95_m: f64,
    /// Motions into a blind sector.
    pub blind_motions: u64,
}

impl Row {
    fn new(seed: u64, outcome: &Outcome, exact_s: f64, undisturbed_s: f64) -> Self {
        let touches = outcome.clearance.touches();
        let faults = touches.iter().filter(|it| it.is_fault()).count();
        let time_s = outcome.time.as_secs_f64();
        Self {
            seed,
            is_done: outcome.is_done,
            time_s,
            times: time_s / exact_s,
            times_alone: time_s / undisturbed_s,
            seen: outcome.seen(),
            clearance_m: outcome.clearance.least_m(),
            touches: [faults, touches.len() - faults],
            landed: outcome.landed,
            given_up: outcome.given_up.len(),
            error_p95_m: outcome.track.error_m(0.95),
            blind_motions: outcome.blind_motions,
        }
    }

    /// How it ended, in a word or two.
    #[must_use]
    pub const fn end(&self) -> &'static str {
        match (self.is_done, self.landed) {
            (true, Some(_)) => "landed",
            (true, None) => "ended",
            (false, _) => "not ended",
        }
    }

    /// Whether it broke the rule of clearance, or moved where no sonar looks.
    #[must_use]
    pub const fn broke_rule(&self) -> bool {
        self.touches[0] > 0 || self.blind_motions > 0
    }

    /// What it broke or did not reach, in words; empty if all is well.
    #[must_use]
    pub fn reasons(&self) -> Vec<String> {
        let times = |number: u64| match number {
            1 => "once".to_owned(),
            number => format!("{number} times"),
        };
        let mut reasons = Vec::new();
        if self.touches[0] > 0 {
            reasons.push(format!(
                "touched something {}",
                times(self.touches[0] as u64)
            ));
        }
        if self.blind_motions > 0 {
            reasons.push(format!(
                "moved {} where no sonar looks",
                times(self.blind_motions)
            ));
        }
        if !self.is_done {
            reasons.push("did not end".to_owned());
        }
        if let Some(cause) = self.landed {
            reasons.push(format!("landed early, as {}", cause_of(cause)));
        }
        if self.seen < SEEN_MIN {
            reasons.push(format!("saw {} %", rounded_down(100.0 * self.seen, 2)));
        }
        if self.times > TIMES_MAX {
            reasons.push(format!(
                "took {} times as long as without noise",
                rounded_up(self.times, 2)
            ));
        }
        reasons
    }

    /// Whether it ended where it was to, saw enough, and took no longer than it may.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        let has_ended = self.is_done && self.landed.is_none();
        has_ended && self.seen >= SEEN_MIN && self.times <= TIMES_MAX
    }
}

/// A landing's cause, in words.
pub(crate) const fn cause_of(landing: EarlyLanding) -> &'static str {
    match landing {
        EarlyLanding::NoSonar => "no sonar worked",
        EarlyLanding::PoseLost => "its pose was lost",
        EarlyLanding::NoOdometry => "no odometry came",
        EarlyLanding::TimeOver => "its time was over",
    }
}

/// Patrols of one flat.
#[derive(Debug, Clone, PartialEq)]
pub struct Campaign {
    /// Time of the patrol without noise and people, in seconds.
    pub undisturbed_s: f64,
    /// One row a seed, in order.
    pub rows: Vec<Row>,
}

/// Runs a patrol for each seed, `jobs` at a time; `failing` sonars fail from their times on. `watcher` hears how many are done.
pub fn run(
    prepared: &Prepared,
    seeds: Seeds,
    failing: &[(usize, Failing, std::time::Duration)],
    jobs: NonZeroUsize,
    mut watcher: impl FnMut(u64),
) -> Campaign {
    let undisturbed_s = engine::run(prepared, Setup::undisturbed())
        .time
        .as_secs_f64();
    let next = AtomicU64::new(0);
    let mut rows: Vec<Row> = std::thread::scope(|scope| {
        let (sender, receiver) = channel();
        for _ in 0..jobs.get() {
            let (sender, next) = (sender.clone(), &next);
            scope.spawn(move || {
                loop {
                    let place = next.fetch_add(1, Ordering::Relaxed);
                    if place >= seeds.number() {
                        return;
                    }
                    let setup = Setup {
                        failing: failing.to_vec(),
                        ..Setup::seeded(seeds.at(place))
                    };
                    let outcome = engine::run(prepared, setup);
                    let exact = engine::run(prepared, Setup::exact(seeds.at(place)));
                    let exact_s = exact.time.as_secs_f64();
                    let row = Row::new(seeds.at(place), &outcome, exact_s, undisturbed_s);
                    if sender.send(row).is_err() {
                        return;
                    }
                }
            });
        }
        drop(sender);
        let counted = receiver.into_iter().zip(1..).map(|(row, done)| {
            watcher(done);
            row
        });
        counted.collect()
    });
    rows.sort_by_key(|row| row.seed);
    Campaign {
        undisturbed_s,
        rows,
    }
}

/// One line of a summary: name, worst, median, and what is accepted.
pub(crate) type Line = (&'static str, String, String, String);

/// The figures of a campaign: worst and median.
pub(crate) fn lines(campaign: &Campaign) -> Vec<Line> {
    let sorted = |value: fn(&Row) -> f64| {
        let mut values: Vec<f64> = campaign.rows.iter().map(value).collect();
        values.sort_by(f64::total_cmp);
        values
    };
    let line = |name, value: fn(&Row) -> f64, is_low_bad: bool, digits: usize, accepted: &str| {
        let values = sorted(value);
        let worst = if is_low_bad {
            values.first()
        } else {
            values.last()
        };
        let text = |value: Option<f64>| {
            // The median of two counts may be between them.
            let is_between = value.is_some_and(|it| it.fract() > 0.0);
            let digits = digits.max(usize::from(is_between));
            value.map_or_else(String::new, |it| figure(it, digits))
        };
        let (worst, median) = (text(worst.copied()), text(median(&values)));
        (name, worst, median, accepted.to_owned())
    };
    vec![
        line(
            "touches by the drone",
            |row| row.touches[0] as f64,
            false,
            0,
            "0",
        ),
        line(
            "touches by people",
            |row| row.touches[1] as f64,
            false,
            0,
            "",
        ),
        line("clearance m", |row| row.clearance_m, true, 2, "≥ 0.15"),
        line("seen %", |row| row.seen * 100.0, true, 2, "≥ 99"),
        line(
            "times that without noise",
            |row| row.times,
            false,
            2,
            "≤ 1.5",
        ),
        line(
            "times that without noise and people",
            |row| row.times_alone,
            false,
            2,
            "",
        ),
        line("position error p95 m", |row| row.error_p95_m, false, 2, ""),
        line("stops given up", |row| row.given_up as f64, false, 0, ""),
        line(
            "motions into a blind sector",
            |row| row.blind_motions as f64,
            false,
            0,
            "0",
        ),
    ]
}

/// A campaign as a table for a terminal, with the patrols that failed.
#[must_use]
pub fn table(campaign: &Campaign) -> String {
    let mut table = Table::new();
    table.force_no_tty().load_style(TABLE_STYLE);
    table.set_header(["", "worst", "median", "accepted"]);
    for (name, worst, median, accepted) in lines(campaign) {
        table.add_row([name.to_owned(), worst, median, accepted]);
    }
    for column in 1..4 {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    let mut text = format!(
        " {}; without noise and people: {} s\n{table}\n",
        plural(campaign.rows.len(), "patrol"),
        figure(campaign.undisturbed_s, 1)
    );
    let failed: Vec<&Row> = failed(campaign).collect();
    let complete = campaign.rows.len() - failed.len();
    text.push_str(&format!(
        " {} complete without a touch by the drone\n",
        plural(complete, "patrol")
    ));
    for row in failed.iter().take(LISTED_MAX) {
        text.push_str(&format!(
            "   seed {}: touches {}, blind {}, seen {:.2} %, {:.2} times, {}\n",
            row.seed,
            row.touches[0],
            row.blind_motions,
            row.seen * 100.0,
            row.times,
            row.end(),
        ));
    }
    if failed.len() > LISTED_MAX {
        text.push_str(&format!("   … and {} more\n", failed.len() - LISTED_MAX));
    }
    text
}

/// The patrols that broke a rule or are incomplete.
pub(crate) fn failed(campaign: &Campaign) -> impl Iterator<Item = &Row> {
    let rows = campaign.rows.iter();
    rows.filter(|row| row.broke_rule() || !row.is_complete())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(seed: u64) -> Row {
        Row {
            seed,
            is_done: true,
            time_s: 100.0,
            times: 1.2,
            times_alone: 1.3,
            seen: 1.0,
            clearance_m: 0.2,
            touches: [0, 0],
            landed: None,
            given_up: 0,
            error_p95_m: 0.05,
            blind_motions: 0,
        }
    }

    #[test]
    fn failed_patrol_has_a_reason_and_no_other_has_one() {
        let good = row(1);
        assert!(good.reasons().is_empty() && good.is_complete());
        let seen = Row {
            seen: 0.98999,
            ..row(2)
        };
        assert_eq!(seen.reasons(), ["saw 98.99 %"]);
        let touches = [2, 1];
        let touching = Row {
            touches,
            times: 1.501,
            ..row(3)
        };
        let expected = [
            "touched something 2 times",
            "took 1.51 times as long as without noise",
        ];
        assert_eq!(touching.reasons(), expected);
        let lost = Row {
            is_done: false,
            blind_motions: 1,
            ..row(4)
        };
        assert_eq!(
            lost.reasons(),
            ["moved once where no sonar looks", "did not end"]
        );
        let landed = |cause| Row {
            landed: Some(cause),
            ..row(5)
        };
        let silent = landed(EarlyLanding::NoSonar);
        let astray = landed(EarlyLanding::PoseLost);
        let dark = landed(EarlyLanding::NoOdometry);
        assert_eq!(silent.reasons(), ["landed early, as no sonar worked"]);
        assert_eq!(astray.reasons(), ["landed early, as its pose was lost"]);
        assert_eq!(dark.reasons(), ["landed early, as no odometry came"]);
        for row in [seen, touching, lost, silent, astray, dark] {
            assert!(row.broke_rule() || !row.is_complete());
        }
    }

    #[test]
    fn median_of_two_patrols_is_in_their_middle() {
        let clear = |seed, clearance_m| Row {
            clearance_m,
            ..row(seed)
        };
        let campaign = Campaign {
            undisturbed_s: 80.0,
            rows: vec![clear(1, 0.2), clear(2, 0.4)],
        };
        let lines = lines(&campaign);
        let clearance = lines.iter().find(|line| line.0 == "clearance m").unwrap();
        assert_eq!((&*clearance.1, &*clearance.2), ("0.20", "0.30"));
    }

    #[test]
    fn table_counts_one_patrol_as_one() {
        let campaign = Campaign {
            undisturbed_s: 80.0,
            rows: vec![row(1)],
        };
        let text = table(&campaign);
        assert!(text.starts_with(" 1 patrol; without noise"), "{text}");
        assert!(text.contains(" 1 patrol complete without"), "{text}");
    }
}
