//! Bar charts by drone or by experiment, like figures 23 and 24 of the thesis.

use maud::{Markup, html};
use muster_runtime::text::{NO_VALUE, figure};
use muster_scenarios::report::{DroneReport, Report, count};

use super::axis::{Axis, px, scale, stride};
use crate::output::figures::Kind;

/// Up to this many drones, two charts fit side by side.
pub(super) const NARROW_MAX: usize = 24;

const HEIGHT_PX: f64 = 250.0;
const LEFT_PX: f64 = 72.0;
const RIGHT_PX: f64 = 58.0;
const TOP_PX: f64 = 12.0;
const BOTTOM_PX: f64 = 46.0;
/// Width of a digit.
const DIGIT_PX: f64 = 8.0;

/// Contents of a chart.
pub(crate) struct Chart {
    /// Text alternative for screen readers.
    pub(crate) about: String,
    /// Name of the vertical axis.
    pub(crate) axis: &'static str,
    /// Name of the horizontal axis.
    pub(crate) places: &'static str,
    /// Number of decimals.
    pub(crate) digits: usize,
    /// Horizontal lines, at most two.
    pub(crate) levels: Vec<Level>,
    pub(crate) bars: Vec<Bars>,
}

/// A named horizontal line.
pub(crate) struct Level {
    pub(crate) name: &'static str,
    pub(crate) height: f64,
}

/// The bars at one place; the first has full colour.
pub(crate) struct Bars {
    /// Label below the bars.
    pub(crate) label: String,
    /// Colour: the name of a [`Kind`](crate::output::figures::Kind), or `all`.
    pub(crate) colour: &'static str,
    /// Tooltip.
    pub(crate) title: String,
    pub(crate) heights: Vec<Option<f64>>,
}

impl Bars {
    /// The bars of one drone.
    pub(crate) fn of_drone(drone: &DroneReport, about: &str, heights: Vec<Option<f64>>) -> Self {
        let kind = Kind::of(drone);
        Self {
            label: drone.id.to_string(),
            colour: kind.name(),
            title: format!("drone {} ({}): {about}", drone.id, kind.name()),
            heights,
        }
    }
}

/// Chart of the flight times.
pub(super) fn flight_times(report: &Report) -> Markup {
    let bars = report.drones.iter().map(|drone| {
        let about = match drone.flight_time_s {
            Some(flown_s) => format!("{} s", figure(flown_s, 1)),
            None => format!("no flight time, {}", drone.state),
        };
        Bars::of_drone(drone, &about, vec![drone.flight_time_s])
    });
    let mean = report.means.flight_time_s;
    chart(&Chart {
        about: "Flight time of each drone".to_owned(),
        axis: "flight time in seconds",
        places: "drone",
        digits: 1,
        levels: mean.map(Level::mean).into_iter().collect(),
        bars: bars.collect(),
    })
}

/// Chart of the messages received and sent.
pub(super) fn messages(report: &Report) -> Markup {
    let bars = report.drones.iter().map(|drone| {
        let (received, sent) = (count(drone.messages_received), count(drone.messages_sent));
        let [sent_text, received_text] = drone.messages();
        let about = format!("received {received_text}, sent {sent_text}");
        Bars::of_drone(drone, &about, vec![Some(received), Some(sent)])
    });
    chart(&Chart {
        about: "Messages that each drone received and sent".to_owned(),
        axis: "messages",
        places: "drone",
        digits: 0,
        levels: vec![Level::mean(report.means.messages_received)],
        bars: bars.collect(),
    })
}

impl Level {
    fn mean(height: f64) -> Self {
        Self {
            name: "mean",
            height,
        }
    }
}

pub(crate) fn chart(chart: &Chart) -> Markup {
    let wide = chart.bars.len() > NARROW_MAX;
    let width = if wide { 1100.0 } else { 540.0 };
    let heights = chart
        .bars
        .iter()
        .flat_map(|bars| bars.heights.iter().flatten().copied());
    let levels = chart.levels.iter().map(|level| level.height);
    let highest = heights.chain(levels).fold(0.0, f64::max);
    let highest = if highest > 0.0 && highest.is_finite() {
        highest * 1.04
    } else {
        1.0
    };
    let (left, right) = (LEFT_PX, width - RIGHT_PX);
    let base = HEIGHT_PX - BOTTOM_PX;
    let y = Axis::new((0.0, highest), (base, TOP_PX));
    let pitch = (right - left) / count(chart.bars.len().max(1) as u64);
    html! {
        div.scroll[wide] {
            svg role="img" aria-label=(chart.about) .wide[wide] viewBox={ "0 0 " (width) " " (HEIGHT_PX) } {
                (scale(&y, (0.0, highest), 4.0, (left, right)))
                @for (place, bars) in chart.bars.iter().enumerate() {
                    (group(bars, &y, base, left + pitch * count(place as u64), pitch))
                }
                line.baseline x1=(left) x2=(right) y1=(base) y2=(base) {}
                (labels(&chart.bars, left, pitch, base))
                (levels_across(chart, &y, (left, right)))
                text.axis-name transform={ "translate(13 " (px(f64::midpoint(base, TOP_PX))) ") rotate(-90)" }
                    text-anchor="middle" { (chart.axis) }
                text.axis-name x=(px(f64::midpoint(left, right))) y=(HEIGHT_PX - 6.0) text-anchor="middle" {
                    (chart.places)
                }
            }
        }
    }
}

/// The levels with names on the right. Of two, the higher has its name above the line, the lower below.
fn levels_across(chart: &Chart, y: &Axis, (left, right): (f64, f64)) -> Markup {
    let mut levels: Vec<&Level> = chart.levels.iter().collect();
    levels.sort_by(|a, b| b.height.total_cmp(&a.height));
    let beside: &[[&str; 2]] = match levels.len() {
        2 => &[["-1.3em", "-0.2em"], ["0.9em", "2em"]],
        _ => &[["-0.2em", "0.9em"]],
    };
    html! {
        @for (level, [name_dy, figure_dy]) in levels.iter().zip(beside) {
            @let at = px(y.px(level.height));
            line.mean x1=(left) x2=(right) y1=(at) y2=(at) {}
            text.mean-name x=(right + 6.0) y=(at) dy=(name_dy) { (level.name) }
            text.mean-name x=(right + 6.0) y=(at) dy=(figure_dy) { (figure(level.height, chart.digits)) }
        }
    }
}

fn group(bars: &Bars, y: &Axis, base: f64, left: f64, pitch: f64) -> Markup {
    let gap = (pitch * 0.2).clamp(0.4, 14.0);
    let width = ((pitch - gap) / count(bars.heights.len().max(1) as u64)).min(40.0);
    let first = left + (pitch - width * count(bars.heights.len() as u64)) / 2.0;
    html! {
        g.bars.{ "k-" (bars.colour) } {
            title { (bars.title) }
            rect.hit x=(px(left)) y=(TOP_PX) width=(px(pitch)) height=(px(base - TOP_PX)) {}
            @for (place, height) in bars.heights.iter().enumerate() {
                @let x = first + width * count(place as u64);
                @match height {
                    Some(height) => {
                        @let top = y.px(*height);
                        rect.bar.second[place > 0] x=(hundredth(x)) y=(px(top))
                            width=(hundredth(width)) height=(px(base - top)) {}
                    }
                    None => {
                        text.tick x=(px(x + width / 2.0)) y=(px(base - 5.0)) text-anchor="middle" { (NO_VALUE) }
                    }
                }
            }
        }
    }
}

/// Rounds to 1/100 pixel, so that 200 bars look equally wide.
fn hundredth(value: f64) -> f64 {
    (value * 100.0).round() / 100.0
}

/// Labels below the bars; some are left out if there is no room.
fn labels(bars: &[Bars], left: f64, pitch: f64, base: f64) -> Markup {
    let widest = bars.iter().map(|bars| bars.label.chars().count()).max();
    let every = stride(pitch, DIGIT_PX * count(widest.unwrap_or(1) as u64) + 6.0);
    let shown = bars
        .iter()
        .enumerate()
        .filter(|(place, _)| place.is_multiple_of(every));
    html! {
        @for (place, bars) in shown {
            @let middle = left + pitch * (count(place as u64) + 0.5);
            text.tick x=(px(middle)) y=(base + 17.0) text-anchor="middle" { (bars.label) }
        }
    }
}
