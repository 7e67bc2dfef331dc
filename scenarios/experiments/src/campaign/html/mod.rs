//! The HTML page of a campaign.

mod plot;
#[cfg(test)]
mod tests;

use maud::{Markup, html};
use muster_runtime::text::{NO_VALUE, figure, plural};
use muster_scenarios::report::count;

use super::figures::Figure;
use super::plan::Campaign;
use super::publish::{RUNS_CSV, RUNS_JSONL, SUMMARY_CSV};
use super::shard::Shard;
use super::summary::{self, BrokenRun, Summary, shown};
use super::table::{interval, interval_of, number, p99, unsettled, value};
use crate::output::html::document;

const STYLE: &str = include_str!("campaign.css");

/// Maximum number of plotted combinations.
const DRAWN_MAX: usize = 200;
/// Maximum number of listed combinations.
const LISTED_MAX: usize = 1_000;

/// The page of a campaign as HTML. All texts of the campaign are escaped.
pub(super) fn page(campaign: &Campaign, summaries: &[Summary], broken: &[BrokenRun]) -> String {
    let title = format!("{}, campaign", campaign.name());
    let content = html! {
        (head(campaign, summaries))
        @if !broken.is_empty() { (rules(summaries, broken)) }
        section {
            h2 { "Medians" }
            p.about {
                "Large dot: median of a combination's runs. Bar: its 95\u{a0}% interval. Small dots: single runs (of many runs, an "
                "evenly ranked selection). The axes do not start at 0."
            }
            @if summaries.len() <= DRAWN_MAX { (plot::plots(campaign, summaries)) }
            @else { p.none { "Too many combinations to plot; all are in " (SUMMARY_CSV) "." } }
        }
        section {
            h2 { "Combinations" }
            p.about {
                "Median; below it the 95\u{a0}% interval, from 100 runs the 99th percentile (≤), and the number n of runs that "
                "have the figure, if not all have it."
            }
            (table(campaign, summaries))
        }
        @if summaries.iter().any(|it| !it.observed.is_empty()) { (observed(campaign, summaries)) }
        (method())
        section {
            h2 { "Repeat the campaign" }
            pre { code { (campaign.command()) } }
            p.about {
                "The same program version writes the same files. Runs: " a href=(RUNS_CSV) { (RUNS_CSV) } " and "
                a href=(RUNS_JSONL) { (RUNS_JSONL) } ". Table: " a href=(SUMMARY_CSV) { (SUMMARY_CSV) } "."
            }
        }
    };
    document(&title, STYLE, &content)
}

fn head(campaign: &Campaign, summaries: &[Summary]) -> Markup {
    let broken: u64 = summaries.iter().map(|summary| summary.broken).sum();
    let never_injected: u64 = summaries.iter().map(|it| it.never_injected).sum();
    let incomplete: u64 = summaries.iter().map(|summary| summary.incomplete).sum();
    html! {
        header {
            p.kind { "muster · campaign of simulated runs" }
            h1 { (campaign.name()) }
            dl.facts {
                div { dt { "Scenario" } dd { (campaign.scenario) } }
                @for variation in &campaign.vary {
                    div { dt { (variation.key()) } dd { (values(variation.values())) } }
                }
                div { dt { "Seeds" } dd { (campaign.seeds) } }
                div { dt { "Engine" } dd { (campaign.engine) } }
                @for change in &campaign.set { div { dt { (change.key()) } dd { (change.value()) } } }
                @if campaign.shard != Shard::WHOLE { div { dt { "Shard" } dd { (campaign.shard) } } }
            }
        }
        div.cards {
            div.card { p { "Runs" } p.value { (figure(count(campaign.shard_runs()), 0)) } }
            div.card { p { "Combinations" } p.value { (figure(count(summaries.len() as u64), 0)) } }
            div.card.{ @if broken == 0 { "good" } @else { "bad" } } {
                p { "Rules broken" }
                p.value {
                    @if broken == 0 { span.sign { "✓" } " none" }
                    @else { span.sign { "✕" } " in " (runs(broken)) }
                }
            }
            div.card.{ @if incomplete == 0 { "good" } @else { "bad" } } {
                p { "Missions incomplete" }
                p.value {
                    @if incomplete == 0 { span.sign { "✓" } " none" }
                    @else { span.sign { "✕" } " in " (runs(incomplete)) }
                }
            }
            @if never_injected > 0 {
                div.card.bad { p { "Faults never injected" } p.value { span.sign { "✕" } " in " (runs(never_injected)) } }
            }
        }
    }
}

fn values(values: &[muster_scenarios::scenario::Override]) -> String {
    let values: Vec<_> = values.iter().map(|change| change.value()).collect();
    values.join(", ")
}

fn runs(number: u64) -> String {
    plural(usize::try_from(number).unwrap_or(usize::MAX), "run")
}

fn rules(summaries: &[Summary], broken: &[BrokenRun]) -> Markup {
    let all: u64 = summaries.iter().map(|summary| summary.broken).sum();
    html! {
        section.bad {
            h2 { "Runs that broke a rule" }
            p.about {
                (runs(all)) @if all > broken.len() as u64 { "; the first " (broken.len()) " are listed" } ". "
                "Such a run stops at the violation and is excluded from the medians. Commands that repeat the runs:"
            }
            pre {
                code {
                    @for run in broken {
                        "# run " (run.run) ": " @if let Some(rule) = run.rule { "rule " (rule) ", " } (run.what) "\n"
                        (run.command) "\n"
                    }
                }
            }
        }
    }
}

fn table(campaign: &Campaign, summaries: &[Summary]) -> Markup {
    let shown = shown(summaries);
    html! {
        div.scroll {
            table.medians {
                thead {
                    tr {
                        @for variation in &campaign.vary { th.n { (variation.key()) } }
                        th.n { "Runs" }
                        th.n { "Broken" }
                        th.n { "Incomplete" }
                        th.n { "Elections" }
                        @for (_, figure) in &shown {
                            th.n { (figure.name) @if !figure.unit.is_empty() { ",\u{a0}" (figure.unit) } }
                        }
                    }
                }
                tbody { @for summary in summaries.iter().take(LISTED_MAX) { (row(summary, &shown)) } }
            }
        }
        @if summaries.len() > LISTED_MAX {
            p.none { "The first " (LISTED_MAX) " of " (summaries.len()) "; all are in " (SUMMARY_CSV) "." }
        }
    }
}

fn row(summary: &Summary, shown: &[(usize, &Figure)]) -> Markup {
    html! {
        tr {
            @for value in &summary.values { td.n { (value) } }
            td.n { (figure(count(summary.runs), 0)) }
            td.n.broken[summary.broken > 0] { (figure(count(summary.broken), 0)) }
            td.n.incomplete[summary.incomplete > 0] { (figure(count(summary.incomplete), 0)) }
            td.n {
                (figure(count(summary.elections), 0))
                @if let Some(unsettled) = unsettled(summary) { span.low-high { (unsettled) } }
            }
            @for (place, of) in shown {
                td.n {
                    @match &summary.estimates[*place] {
                        Some(estimate) => {
                            (figure(estimate.median, of.digits))
                            span.low-high { (interval(of, estimate).unwrap_or_default()) }
                            span.low-high { (p99(of, estimate).unwrap_or_default()) }
                            span.low-high { (number(summary, estimate).unwrap_or_default()) }
                        }
                        None => (NO_VALUE),
                    }
                }
            }
        }
    }
}

/// What agents observed.
fn observed(campaign: &Campaign, summaries: &[Summary]) -> Markup {
    let names = summary::observed(summaries);
    html! {
        section {
            h2 { "What agents observed" }
            p.about {
                "The last value of each name in a run: its median, and below it the 95\u{a0}% interval, and the number n of runs "
                "that have the value, if not all have it."
                @if summaries.len() > LISTED_MAX { " The first " (LISTED_MAX) " combinations; all are in " (SUMMARY_CSV) "." }
            }
            div.scroll {
                table.observed {
                    thead {
                        tr {
                            @for variation in &campaign.vary { th.n { (variation.key()) } }
                            @for name in &names { th.n { (name) } }
                        }
                    }
                    tbody {
                        @for summary in summaries.iter().take(LISTED_MAX) {
                            tr {
                                @for value in &summary.values { td.n { (value) } }
                                @for name in &names {
                                    td.n {
                                        @match summary.observed.get(*name) {
                                            Some(estimate) => {
                                                (value(estimate.median))
                                                span.low-high { (interval_of(estimate).unwrap_or_default()) }
                                                span.low-high { (number(summary, estimate).unwrap_or_default()) }
                                            }
                                            None => (NO_VALUE),
                                        }
                                    }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

fn method() -> Markup {
    html! {
        section {
            h2 { "Method" }
            p.about {
                "The median of a combination is taken over its runs without violations; that of a flight time over those of them "
                "that completed their missions, since a drone that lands early has a short one. The interval reaches from the j-th "
                "smallest to the j-th largest value, with the highest j such that "
                "2\u{a0}P(B\u{a0}<\u{a0}j)\u{a0}≤\u{a0}0.05 for B binomial of the number of values and ½. It has at least "
                "95\u{a0}% confidence for any distribution. Fewer than six values have no interval."
            }
        }
    }
}
