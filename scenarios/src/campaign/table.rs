//! The table that a campaign ends with on a terminal.

use comfy_table::{Attribute, Cell, CellAlignment, Table};

use super::publish::{Published, SUMMARY_CSV};
use super::statistics::Estimate;
use super::summary::{FIGURES, Figure, Summary};
use crate::report::Colour;
use crate::report::table::{GREEN, RED, STYLE, painted};
use muster_runtime::text::{NOTHING, figure, plural};

/// The most combinations that are listed.
const LISTED_MAX: usize = 50;

/// What a campaign came to, as text; it ends with a line feed.
#[must_use]
pub fn table(published: &Published, colour: Colour) -> String {
    let Published {
        campaign,
        summaries,
        broken,
        ..
    } = published;
    let mut text = medians(published, colour);
    if let Some(more) = summaries.len().checked_sub(LISTED_MAX + 1) {
        text.push_str(&format!(
            " … and {}, in {SUMMARY_CSV}\n",
            plural(more + 1, "combination")
        ));
    }
    let (runs, broken_runs) = (campaign.runs_at_hand(), published.broken_runs());
    let shard = if runs == campaign.runs() {
        String::new()
    } else {
        format!(", shard {} of {}", campaign.shard, campaign.runs())
    };
    text.push_str(
        "\n Medians, below them their 95 % intervals and, from a hundred runs on, 99th percentiles (≤) of the runs that \
         kept the rules.\n\n",
    );
    text.push_str(&format!(
        " runs   {runs}{shard}: {}, seeds {}, engine {}\n",
        plural(summaries.len(), "combination"),
        campaign.seeds,
        campaign.engine
    ));
    let (paint, verdict) = match broken_runs {
        0 => (GREEN, "none broken".to_owned()),
        runs => (
            RED,
            format!(
                "broken in {}",
                plural(usize::try_from(runs).unwrap_or(usize::MAX), "run")
            ),
        ),
    };
    text.push_str(&format!(" rules  {}\n", painted(&verdict, paint, colour)));
    match published.incomplete_runs() {
        0 => {}
        runs => {
            let runs = plural(usize::try_from(runs).unwrap_or(usize::MAX), "run");
            let verdict = format!("not flown to the end in {runs}");
            let verdict = painted(&verdict, RED, colour);
            text.push_str(&format!(" missions  {verdict}\n"));
        }
    }
    for run in broken {
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
    let told = broken.len() as u64;
    if broken_runs > told {
        text.push_str(&format!("   … and {} more\n", broken_runs - told));
    }
    text
}

fn medians(published: &Published, colour: Colour) -> String {
    let mut table = Table::new();
    table.force_no_tty().load_style(STYLE);
    if colour == Colour::Always {
        table.enforce_styling();
    }
    let keys = published.campaign.vary.iter();
    let keys = keys.map(|it| it.key().replacen('.', ".\n", 1));
    let counts = ["\nruns", "\nbroken", "\nelections"].map(str::to_owned);
    let figures = FIGURES.iter().map(|figure| figure.short.to_owned());
    let header = keys.chain(counts).chain(figures);
    table.set_header(header.map(|name| Cell::new(name).add_attribute(Attribute::Bold)));
    for summary in published.summaries.iter().take(LISTED_MAX) {
        table.add_row(row(summary));
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

fn row(summary: &Summary) -> Vec<String> {
    let figures = FIGURES.iter().zip(&summary.estimates);
    let estimates = figures.map(|(figure, estimate)| in_two_lines(figure, estimate.as_ref()));
    let counts = [summary.runs, summary.broken, summary.elections].map(|count| count.to_string());
    let values = summary.values.iter().cloned();
    values.chain(counts).chain(estimates).collect()
}

fn in_two_lines(figure: &Figure, estimate: Option<&Estimate>) -> String {
    let Some(estimate) = estimate else {
        return NOTHING.to_owned();
    };
    let median = self::figure(estimate.median, figure.digits);
    let lines = [
        Some(median),
        interval(figure, estimate),
        p99(figure, estimate),
    ];
    lines.into_iter().flatten().collect::<Vec<_>>().join("\n")
}

/// A 99th percentile as a person reads it.
pub(super) fn p99(of: &Figure, estimate: &Estimate) -> Option<String> {
    let p99 = estimate.p99?;
    Some(format!("≤{}", figure(p99, of.digits)))
}

/// An interval as a person reads it.
pub(super) fn interval(of: &Figure, estimate: &Estimate) -> Option<String> {
    let (low, high) = estimate.interval?;
    Some(format!(
        "{}–{}",
        figure(low, of.digits),
        figure(high, of.digits)
    ))
}
