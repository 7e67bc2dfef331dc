//! Plots, one per figure: medians, intervals and single runs over the values of one varied field.

use maud::{Markup, html};
use muster_runtime::text::figure;
use muster_scenarios::report::count;

use crate::campaign::figures::{FIGURES, Figure};
use crate::campaign::plan::Campaign;
use crate::campaign::statistics::Estimate;
use crate::campaign::summary::{Summary, shown};
use crate::campaign::table::interval;
use crate::output::html::axis::{Axis, px, scale};

const WIDTH_PX: f64 = 540.0;
const HEIGHT_PX: f64 = 260.0;
const LEFT_PX: f64 = 76.0;
const RIGHT_PX: f64 = 16.0;
const TOP_PX: f64 = 12.0;
const BOTTOM_PX: f64 = 46.0;
/// Margin between the ends of the horizontal axis and the outer values.
const INSET_PX: f64 = 34.0;
/// Width of a letter.
const LETTER_PX: f64 = 7.0;
/// Maximum length of a label below the axis.
const LETTERS_MAX: usize = 16;
/// Above this many combinations, single runs are not drawn.
const WITH_RUNS_MAX: usize = 40;
/// Number of colours.
const COLOURS: usize = 7;

/// Layout of the combinations, common to all plots.
struct PlotLayout<'a> {
    /// Field on the horizontal axis; empty if none is varied.
    key: &'a str,
    /// Its values with their positions.
    places: Vec<(&'a str, f64)>,
    /// Whether the values are numbers; then a line connects the medians.
    is_numeric: bool,
    /// Series: combinations that differ in the field on the axis only, with the name of the other values.
    series: Vec<(String, Vec<(usize, &'a Summary)>)>,
}

/// All plots, with their legend.
pub(super) fn plots(campaign: &Campaign, summaries: &[Summary]) -> Markup {
    let layout = PlotLayout::new(campaign, summaries);
    let shown = shown(summaries);
    let is_absent = |place: &usize| shown.iter().all(|(it, _)| it != place);
    let absent = FIGURES
        .iter()
        .enumerate()
        .filter(|(place, _)| is_absent(place));
    let absent: Vec<_> = absent.map(|(_, figure)| figure.name).collect();
    let (zero, plotted): (Vec<_>, Vec<_>) =
        shown.iter().partition(|(place, _)| layout.is_zero(*place));
    let zero: Vec<_> = zero.iter().map(|(_, figure)| figure.name).collect();
    html! {
        @if layout.series.len() > 1 {
            ul.legend {
                @for (place, (name, _)) in layout.series.iter().enumerate() {
                    li { span.chip.{ "s" (place % COLOURS) } {} (name) }
                }
            }
        }
        div.plots { @for (place, figure) in plotted { (layout.plot(place, figure)) } }
        @if !absent.is_empty() { p.none { "In no run: " (absent.join("; ")) "." } }
        @if !zero.is_empty() { p.none { "Zero in every run, and not plotted: " (zero.join("; ")) "." } }
    }
}

impl<'a> PlotLayout<'a> {
    /// Puts the field with the most values on the axis; the first of several.
    fn new(campaign: &'a Campaign, summaries: &'a [Summary]) -> Self {
        let fields = campaign.vary.iter().enumerate();
        let field = fields
            .rev()
            .max_by_key(|(_, variation)| variation.values().len());
        let (axis, values) = match field {
            Some((axis, variation)) => (Some(axis), variation.values()),
            None => (None, &[][..]),
        };
        let texts: Vec<&str> = values
            .iter()
            .map(muster_scenarios::scenario::Override::value)
            .collect();
        let numbers: Vec<f64> = texts.iter().filter_map(|text| text.parse().ok()).collect();
        let is_numeric = !texts.is_empty()
            && numbers.len() == texts.len()
            && numbers.iter().all(|number: &f64| number.is_finite());
        let mut series: Vec<(String, Vec<(usize, &Summary)>)> = Vec::new();
        for summary in summaries {
            let common: Vec<_> = campaign
                .vary
                .iter()
                .zip(&summary.values)
                .enumerate()
                .filter(|(place, _)| Some(*place) != axis)
                .map(|(_, (variation, value))| format!("{} {value}", variation.key()))
                .collect();
            let common = common.join(", ");
            let value = axis.map_or(0, |axis| {
                let own = summary.values[axis].as_str();
                texts
                    .iter()
                    .position(|text| *text == own)
                    .unwrap_or_default()
            });
            match series.iter_mut().find(|(name, _)| *name == common) {
                Some((_, members)) => members.push((value, summary)),
                None => series.push((common, vec![(value, summary)])),
            }
        }
        if is_numeric {
            for (_, members) in &mut series {
                members.sort_by(|(a, _), (b, _)| numbers[*a].total_cmp(&numbers[*b]));
            }
        }
        let numbers = if is_numeric {
            numbers
        } else {
            (0..texts.len().max(1)).map(|it| count(it as u64)).collect()
        };
        Self {
            key: axis.map_or("", |axis| campaign.vary[axis].key()),
            places: positions(&numbers, &texts),
            is_numeric,
            series,
        }
    }

    /// Distance between two series at one value.
    fn series_offset(&self) -> f64 {
        let mut places: Vec<f64> = self.places.iter().map(|(_, place)| *place).collect();
        places.sort_unstable_by(f64::total_cmp);
        let gaps = places.windows(2).map(|pair| pair[1] - pair[0]);
        let gap = gaps.fold(WIDTH_PX - LEFT_PX - RIGHT_PX, f64::min);
        (gap / count(self.series.len() as u64 + 1)).min(16.0)
    }

    fn estimates(&self, place: usize) -> impl Iterator<Item = &Estimate> {
        let members = self.series.iter().flat_map(|(_, members)| members);
        members.filter_map(move |(_, summary)| summary.estimates[place].as_ref())
    }

    /// Whether a figure is zero in every run that has it, and some have it.
    fn is_zero(&self, place: usize) -> bool {
        let mut values = self.estimates(place).flat_map(|it| &it.drawn).peekable();
        values.peek().is_some() && values.all(|value| value.abs() <= 0.0)
    }

    fn plot(&self, place: usize, figure: &Figure) -> Markup {
        let estimates = || self.estimates(place);
        let values = || estimates().flat_map(|estimate| estimate.drawn.iter().copied());
        let low = values().fold(f64::INFINITY, f64::min);
        let high = values().fold(f64::NEG_INFINITY, f64::max);
        let base = HEIGHT_PX - BOTTOM_PX;
        let with_runs = estimates().count() <= WITH_RUNS_MAX;
        html! {
            figure {
                figcaption { (figure.name) span { (figure.about) } }
                @if low <= high {
                    @let margin = ((high - low) * 0.08).max(high.abs() * 1e-4).max(1e-3);
                    @let (low, high) = (low - margin, high + margin);
                    @let y = Axis::new((low, high), (base, TOP_PX));
                    svg role="img" aria-label=(figure.name) viewBox={ "0 0 " (WIDTH_PX) " " (HEIGHT_PX) } {
                        (scale(&y, (low, high), 5.0, (LEFT_PX, WIDTH_PX - RIGHT_PX)))
                        line.baseline x1=(LEFT_PX) x2=(WIDTH_PX - RIGHT_PX) y1=(base) y2=(base) {}
                        (self.labels(base))
                        @for (at, (_, members)) in self.series.iter().enumerate() {
                            @let shift = (count(at as u64) - (count(self.series.len() as u64) - 1.0) / 2.0) * self.series_offset();
                            g.{ "s" (at % COLOURS) } {
                                @if self.is_numeric { (median_line(members, place, |value| self.places[value].1 + shift, &y)) }
                                @for (value, summary) in members {
                                    @if let Some(estimate) = &summary.estimates[place] {
                                        g.estimate {
                                            title { (self.title(summary, figure, estimate)) }
                                            (marks(estimate, self.places[*value].1 + shift, &y, with_runs))
                                        }
                                    }
                                }
                            }
                        }
                        text.axis-name transform={ "translate(13 " (px(f64::midpoint(base, TOP_PX))) ") rotate(-90)" }
                            text-anchor="middle" {
                            @if figure.unit.is_empty() { "count" } @else { (figure.unit) }
                        }
                        text.axis-name x=(px(f64::midpoint(LEFT_PX, WIDTH_PX - RIGHT_PX))) y=(HEIGHT_PX - 6.0)
                            text-anchor="middle" { (self.key) }
                    }
                } @else {
                    p.none { "No run has this figure." }
                }
            }
        }
    }

    /// Labels below the axis; some are left out if there is no room.
    fn labels(&self, base: f64) -> Markup {
        let mut sorted: Vec<_> = self
            .places
            .iter()
            .filter(|(text, _)| !text.is_empty())
            .collect();
        sorted.sort_by(|(_, a), (_, b)| a.total_cmp(b));
        let mut end = f64::NEG_INFINITY;
        let mut shown = Vec::new();
        for (text, at) in sorted {
            let text = shortened(text);
            let half = count(text.chars().count() as u64) * LETTER_PX / 2.0;
            if at - half > end + 4.0 {
                end = at + half;
                shown.push((text, *at));
            }
        }
        html! {
            @for (text, at) in shown {
                line.baseline x1=(px(at)) x2=(px(at)) y1=(base) y2=(base + 4.0) {}
                text.tick x=(px(at)) y=(base + 17.0) text-anchor="middle" { (text) }
            }
        }
    }

    fn title(&self, summary: &Summary, of: &Figure, estimate: &Estimate) -> String {
        let values = if summary.values.is_empty() {
            "all runs".to_owned()
        } else {
            summary.values.join(", ")
        };
        let interval =
            interval(of, estimate).map_or_else(String::new, |it| format!(", 95 % interval {it}"));
        format!(
            "{values}: median {}{interval} {}",
            figure(estimate.median, of.digits),
            of.unit
        )
    }
}

/// Positions of the values on the axis.
fn positions<'a>(numbers: &[f64], texts: &[&'a str]) -> Vec<(&'a str, f64)> {
    let (left, right) = (LEFT_PX + INSET_PX, WIDTH_PX - RIGHT_PX - INSET_PX);
    let low = numbers.iter().copied().fold(f64::INFINITY, f64::min);
    let high = numbers.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let x = Axis::new((low, high), (left, right));
    let texts = texts.iter().copied().chain(std::iter::repeat(""));
    let place = |number: f64| {
        if high > low {
            x.px(number)
        } else {
            f64::midpoint(left, right)
        }
    };
    texts
        .zip(numbers)
        .map(|(text, number)| (text, place(*number)))
        .collect()
}

/// Shortens a long value to its end, which distinguishes paths.
fn shortened(text: &str) -> String {
    let letters = text.chars().count();
    if letters <= LETTERS_MAX {
        return text.to_owned();
    }
    let end: String = text.chars().skip(letters - LETTERS_MAX + 1).collect();
    format!("…{end}")
}

/// A line through the medians of a series.
fn median_line(
    members: &[(usize, &Summary)],
    place: usize,
    x: impl Fn(usize) -> f64,
    y: &Axis,
) -> Markup {
    let points: Vec<_> = members
        .iter()
        .filter_map(|(value, summary)| Some((x(*value), summary.estimates[place].as_ref()?)))
        .map(|(x, estimate)| format!("{},{}", px(x), px(y.px(estimate.median))))
        .collect();
    html! { polyline.through points=(points.join(" ")) {} }
}

/// The runs, the interval and the median at `x`.
fn marks(estimate: &Estimate, x: f64, y: &Axis, with_runs: bool) -> Markup {
    html! {
        @if with_runs {
            @for (place, value) in estimate.drawn.iter().enumerate() {
                // In three columns, so that equal values stay visible.
                circle.run cx=(px(x + 3.2 * (count(place as u64 % 3) - 1.0))) cy=(px(y.px(*value))) r="2" {}
            }
        }
        @if let Some((low, high)) = estimate.interval {
            @let (top, bottom) = (px(y.px(high)), px(y.px(low)));
            path.interval d={
                "M" (px(x - 5.0)) " " (top) "h10M" (px(x - 5.0)) " " (bottom) "h10M" (px(x)) " " (top) "V" (bottom)
            } {}
        }
        circle.median cx=(px(x)) cy=(px(y.px(estimate.median))) r="4.6" {}
    }
}
