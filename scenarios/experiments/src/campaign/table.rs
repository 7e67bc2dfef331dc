//! The table of a campaign for a terminal.

use comfy_table::{Attribute, Cell, CellAlignment, Table};
use muster_runtime::text::{NO_VALUE, figure, plural};
use muster_scenarios::report::{Colour, TABLE_STYLE};

use super::figures::Figure;
use super::publish::{Published, SUMMARY_CSV};
use super::statistics::Estimate;
use super::summary::{Summary, shown};
use crate::output::table::{GREEN, RED, painted};

/// Maximum number of listed combinations.
const LISTED_MAX: usize = 50;

/// The results of a campaign as text, with a final line feed.
#[must_use]
pub fn table(published: &Published, colour: Colour) -> String {
    let mut text = medians(published, colour);
    if let Some(more) = published.summaries.len().checked_sub(LISTED_MAX + 1) {
        text.push_str(&format!(
            " … and {}, in {SUMMARY_CSV}\n",
            plural(more + 1, "combination")
        ));
    }
    text.push_str(
        "\n Medians, 95 % intervals and, from 100 runs, 99th percentiles (≤), over the runs without violations; flight times over the\n complete ones of them.\n \
         n: number of runs that have the figure, if not all have it.\n\n",
    );
    text.push_str(&runs(published));
    text.push_str(&observed(published));
    text.push_str(&rules(published, colour));
    text
}

/// Number of runs, combinations, seeds and engine.
fn runs(published: &Published) -> String {
    let campaign = &published.campaign;
    let runs = campaign.shard_runs();
    let shard = if runs == campaign.runs() {
        String::new()
    } else {
        format!(", shard {} of {}", campaign.shard, campaign.runs())
    };
    format!(
        " runs   {runs}{shard}: {}, seeds {}, engine {}\n",
        plural(published.summaries.len(), "combination"),
        campaign.seeds,
        campaign.engine
    )
}

/// What agents observed: the last values of the runs, in the first combinations.
fn observed(published: &Published) -> String {
    let listed = published.summaries.iter().take(LISTED_MAX);
    let lines = listed.flat_map(|summary| {
        let varied = published.campaign.varied(summary.combination);
        let varied: Vec<_> = varied.iter().map(ToString::to_string).collect();
        let of = match varied.is_empty() {
            true => String::new(),
            false => format!(" with {}", varied.join(", ")),
        };
        let line = move |(name, estimate): (&String, &Estimate)| {
            let figures = [
                Some(value(estimate.median)),
                interval_of(estimate),
                number(summary, estimate),
            ];
            let figures: Vec<_> = figures.into_iter().flatten().collect();
            format!(" value  {name}{of}: {}\n", figures.join(", "))
        };
        summary.observed.iter().map(line)
    });
    lines.collect()
}

/// What agents observed, as text: to a hundredth, or three digits if it is less.
pub(super) fn value(value: f64) -> String {
    match value.abs() {
        _ if value.fract() == 0.0 => figure(value, 0),
        ..0.01 => format!("{value:.2e}"),
        _ => figure(value, 2),
    }
}

/// The interval of what agents observed, as text.
pub(super) fn interval_of(estimate: &Estimate) -> Option<String> {
    let (low, high) = estimate.interval?;
    Some(format!("{}–{}", value(low), value(high)))
}

/// Broken rules, incomplete missions and faults that never happened, with the commands that repeat the first broken runs.
fn rules(published: &Published, colour: Colour) -> String {
    let number = |runs: u64| plural(usize::try_from(runs).unwrap_or(usize::MAX), "run");
    let broken_runs = published.broken_runs();
    let (paint, result) = match broken_runs {
        0 => (GREEN, "none broken".to_owned()),
        runs => (RED, format!("broken in {}", number(runs))),
    };
    let mut text = format!(" rules  {}\n", painted(&result, paint, colour));
    match published.incomplete_runs() {
        0 => {}
        runs => {
            let result = format!("incomplete in {}", number(runs));
            let result = painted(&result, RED, colour);
            text.push_str(&format!(" missions  {result}\n"));
        }
    }
    match published.never_injected_runs() {
        0 => {}
        runs => text.push_str(&format!(" faults  never injected in {}\n", number(runs))),
    }
    for run in &published.broken {
        let rule = run
            .rule
            .map_or_else(String::new, |rule| format!("rule {rule}, "));
        let what = format!("run {}: {rule}{}", run.run, run.what);
        text.push_str(&format!(
            "   {}\n     {}\n",
            painted(&what, paint, colour),
            run.command
        ));
    }
    let listed = published.broken.len() as u64;
    if broken_runs > listed {
        text.push_str(&format!("   … and {} more\n", broken_runs - listed));
    }
    text
}

fn medians(published: &Published, colour: Colour) -> String {
    let mut table = Table::new();
    table.force_no_tty().load_style(TABLE_STYLE);
    if colour == Colour::Always {
        table.enforce_styling();
    }
    let keys = published.campaign.vary.iter();
    let keys = keys.map(|it| it.key().replacen('.', ".\n", 1));
    let counts = ["\nruns", "\nbroken", "\nincomplete", "\nelections"].map(str::to_owned);
    let shown = shown(&published.summaries);
    let figures = shown.iter().map(|(_, figure)| figure.short.to_owned());
    let header = keys.chain(counts).chain(figures);
    table.set_header(header.map(|name| Cell::new(name).add_attribute(Attribute::Bold)));
    for summary in published.summaries.iter().take(LISTED_MAX) {
        table.add_row(row(summary, &shown));
    }
    for column in table.column_iter_mut() {
        column
            .set_padding((1, 0))
            .set_cell_alignment(CellAlignment::Right);
    }
    table
        .lines()
        .map(|line| format!("{}\n", line.trim_end()))
        .collect()
}

fn row(summary: &Summary, shown: &[(usize, &Figure)]) -> Vec<String> {
    let estimates = shown
        .iter()
        .map(|(place, figure)| estimate_lines(summary, figure, summary.estimates[*place].as_ref()));
    let counts = [summary.runs, summary.broken, summary.incomplete].map(|it| it.to_string());
    let elections = std::iter::once(summary.elections.to_string()).chain(unsettled(summary));
    let elections = elections.collect::<Vec<_>>().join("\n");
    let values = summary.values.iter().cloned().chain(counts);
    values.chain([elections]).chain(estimates).collect()
}

/// The number of elections that did not end, as text; `None` if all ended.
pub(super) fn unsettled(summary: &Summary) -> Option<String> {
    let unsettled = summary.elections_unsettled;
    (unsettled > 0).then(|| format!("{unsettled} unsettled"))
}

fn estimate_lines(summary: &Summary, figure: &Figure, estimate: Option<&Estimate>) -> String {
    let Some(estimate) = estimate else {
        return NO_VALUE.to_owned();
    };
    let median = self::figure(estimate.median, figure.digits);
    let lines = [
        Some(median),
        interval(figure, estimate),
        p99(figure, estimate),
        number(summary, estimate),
    ];
    lines.into_iter().flatten().collect::<Vec<_>>().join("\n")
}

/// A 99th percentile as text.
pub(super) fn p99(of: &Figure, estimate: &Estimate) -> Option<String> {
    let p99 = estimate.p99?;
    Some(format!("≤{}", figure(p99, of.digits)))
}

/// The number of values as text; `None` if each run of the combination has one.
pub(super) fn number(of: &Summary, estimate: &Estimate) -> Option<String> {
    let n = estimate.n as u64;
    (n < of.runs).then(|| format!("n={n}"))
}

/// An interval as text.
pub(super) fn interval(of: &Figure, estimate: &Estimate) -> Option<String> {
    let (low, high) = estimate.interval?;
    Some(format!(
        "{}–{}",
        figure(low, of.digits),
        figure(high, of.digits)
    ))
}
