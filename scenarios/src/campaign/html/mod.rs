//! The page that shows a campaign, in the style of that of a run.

mod plot;
#[cfg(test)]
mod tests;

use maud::{Markup, html};

use super::plan::Campaign;
use super::publish::{RUNS_CSV, RUNS_JSONL, SUMMARY_CSV};
use super::shard::Shard;
use super::summary::{Broken, FIGURES, Summary};
use super::table::{interval, p99};
use crate::report::figures::count;
use crate::report::html::document;
use muster_runtime::text::{NOTHING, figure, plural};

const STYLE: &str = include_str!("campaign.css");

/// The most combinations that are drawn; more than can be told apart.
const DRAWN_MAX: usize = 200;
/// The most combinations that are listed.
const LISTED_MAX: usize = 1_000;

/// The page of a campaign, as HTML; every text that comes from it is escaped.
pub(super) fn page(campaign: &Campaign, summaries: &[Summary], broken: &[Broken]) -> String {
    let title = format!("{}, campaign", campaign.name());
    let content = html! {
        (head(campaign, summaries))
        @if !broken.is_empty() { (rules(summaries, broken)) }
        section {
            h2 { "Medians" }
            p.about {
                "The large dot is the median of a combination's runs, the bar its 95\u{a0}% interval, each small dot "
                "a run (of many runs, some that are evenly ranked). The scales do not begin at 0."
            }
            @if summaries.len() <= DRAWN_MAX { (plot::plots(campaign, summaries)) }
            @else { p.none { "There are too many combinations to be drawn; all are in " (SUMMARY_CSV) "." } }
        }
        section {
            h2 { "Combinations" }
            p.about { "Median, and below it the 95\u{a0}% interval and, from a hundred runs on, the 99th percentile (≤)." }
            (table(campaign, summaries))
        }
        (method())
        section {
            h2 { "Run it again" }
            pre { code { (campaign.command()) } }
            p.about {
                "The same program makes the same files. Every run is in " a href=(RUNS_CSV) { (RUNS_CSV) } " and "
                a href=(RUNS_JSONL) { (RUNS_JSONL) } ", this table in " a href=(SUMMARY_CSV) { (SUMMARY_CSV) } "."
            }
        }
    };
    document(&title, STYLE, &content)
}

fn head(campaign: &Campaign, summaries: &[Summary]) -> Markup {
    let broken: u64 = summaries.iter().map(|summary| summary.broken).sum();
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
            div.card { p { "Runs" } p.value { (figure(count(campaign.runs_at_hand()), 0)) } }
            div.card { p { "Combinations" } p.value { (figure(count(summaries.len() as u64), 0)) } }
            div.card.{ @if broken == 0 { "good" } @else { "bad" } } {
                p { "Rules broken" }
                p.value {
                    @if broken == 0 { span.sign { "✓" } " none" }
                    @else { span.sign { "✕" } " in " (runs(broken)) }
                }
            }
        }
    }
}

fn values(values: &[crate::scenario::Override]) -> String {
    let values: Vec<_> = values.iter().map(|change| change.value()).collect();
    values.join(", ")
}

fn runs(number: u64) -> String {
    plural(usize::try_from(number).unwrap_or(usize::MAX), "run")
}

fn rules(summaries: &[Summary], broken: &[Broken]) -> Markup {
    let all: u64 = summaries.iter().map(|summary| summary.broken).sum();
    html! {
        section.bad {
            h2 { "Runs that broke a rule" }
            p.about {
                (runs(all)) @if all > broken.len() as u64 { ", the first " (broken.len()) " of them below" } ". "
                "They ended there and are left out of the medians. These commands fly them again:"
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
    html! {
        div.scroll {
            table {
                thead {
                    tr {
                        @for variation in &campaign.vary { th.n { (variation.key()) } }
                        th.n { "Runs" }
                        th.n { "Broken" }
                        th.n { "Incomplete" }
                        th.n { "Elections" }
                        @for figure in &FIGURES {
                            th.n { (figure.name) @if !figure.unit.is_empty() { ",\u{a0}" (figure.unit) } }
                        }
                    }
                }
                tbody { @for summary in summaries.iter().take(LISTED_MAX) { (row(summary)) } }
            }
        }
        @if summaries.len() > LISTED_MAX {
            p.none { "The first " (LISTED_MAX) " of " (summaries.len()) "; all are in " (SUMMARY_CSV) "." }
        }
    }
}

fn row(summary: &Summary) -> Markup {
    html! {
        tr {
            @for value in &summary.values { td.n { (value) } }
            td.n { (figure(count(summary.runs), 0)) }
            td.n.broken[summary.broken > 0] { (figure(count(summary.broken), 0)) }
            td.n.incomplete { (figure(count(summary.incomplete), 0)) }
            td.n { (figure(count(summary.elections), 0)) }
            @for (of, estimate) in FIGURES.iter().zip(&summary.estimates) {
                td.n {
                    @match estimate {
                        Some(estimate) => {
                            (figure(estimate.median, of.digits))
                            span.low-high { (interval(of, estimate).unwrap_or_default()) }
                            span.low-high { (p99(of, estimate).unwrap_or_default()) }
                        }
                        None => (NOTHING),
                    }
                }
            }
        }
    }
}

fn method() -> Markup {
    html! {
        section {
            h2 { "How the intervals are made" }
            p.about {
                "A figure is taken from each run, and the median of a combination's runs is estimated from those that "
                "kept the rules. Its interval lies between the j-th smallest and the j-th largest of them, with the "
                "highest j such that 2\u{a0}P(B\u{a0}<\u{a0}j)\u{a0}≤\u{a0}0.05 for B binomial of their number and "
                "½: at least 95\u{a0}% confidence whatever the distribution. Fewer than six runs have no interval."
            }
        }
    }
}
