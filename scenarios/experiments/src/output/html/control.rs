//! Plots of attitude, throttle stick and RC gaps, for each drone with a flight controller.

use std::fmt::Write as _;

use maud::{Markup, html};
use muster_runtime::text::figure;
use muster_scenarios::report::{
    ControlSeries, Extremes, Flight, Mark, MarkKind, RC_GAP_MAX, Report, Stretch,
};

use super::axis::{Axis, decimals, px, scale, ticks};

const WIDTH_PX: f64 = 1100.0;
const LEFT_PX: f64 = 58.0;
const RIGHT_PX: f64 = 16.0;
const BOTTOM_PX: f64 = 44.0;
/// Room above a panel, for its name.
const NAME_PX: f64 = 26.0;
/// Height of a panel.
const PANEL_PX: f64 = 96.0;
/// The attitude's axis reaches at least so far to both sides.
const LEAN_MIN_DEG: f64 = 5.0;
/// Ends of the throttle stick's axis: those of a receiver's channel.
const THROTTLE_US: (f64, f64) = (1_000.0, 2_000.0);
/// End of the gaps' axis; longer gaps are drawn there.
const GAP_END_MS: f64 = 200.0;

/// A quantity of one or two lines.
struct Panel {
    name: &'static str,
    ends: (f64, f64),
    lines: &'static [Line],
}

/// A CSS class, and what of a stretch it shows.
type Line = (&'static str, fn(&Stretch) -> Option<Extremes>);

/// The section of a swarm; empty if no drone with a controller was armed.
pub(super) fn control(report: &Report, flight: &Flight) -> Markup {
    let drones = report.drones.iter().zip(&flight.drones);
    let flown = drones.filter_map(|(drone, flown)| Some((drone.id, flown.control.as_ref()?)));
    let flown: Vec<_> = flown.filter(|(_, series)| !series.is_empty()).collect();
    if flown.is_empty() {
        return html! {};
    }
    html! {
        section {
            h2 { "Flight controllers" }
            p.about {
                "While armed. A band reaches from the least to the greatest value of each stretch of time. RC gaps are those "
                "between frames that reached the controller; the dashed line is at " (figure(gap_max_ms(), 0)) " ms, and gaps of "
                "more than " (figure(GAP_END_MS, 0)) " ms are drawn at the edge."
                @if report.firmware.is_some() { " The throttle is that of RC frames over MSP, which count unless a pilot has the sticks." }
            }
            ul.legend {
                li { span.chip.c-roll {} "roll, right positive" }
                li { span.chip.c-pitch {} "pitch, nose up positive" }
            }
            @for (place, (id, series)) in flown.into_iter().enumerate() {
                details.control open[place == 0] {
                    summary { "drone " (id) }
                    (plots(report, &flight.history.marks, id, series))
                }
            }
        }
    }
}

fn gap_max_ms() -> f64 {
    RC_GAP_MAX.as_secs_f64() * 1e3
}

/// The panels of a drone, one below the other.
fn plots(report: &Report, marks: &[Mark], id: u32, series: &ControlSeries) -> Markup {
    let runs = series.runs();
    let panels = panels(&runs);
    let pitch = NAME_PX + PANEL_PX;
    let tops: Vec<f64> = (0..)
        .map(|it| f64::from(it) * pitch + NAME_PX)
        .take(panels.len())
        .collect();
    let base = tops.last().map_or(0.0, |top| top + PANEL_PX);
    let x = Axis::new((0.0, report.simulated_s), (LEFT_PX, WIDTH_PX - RIGHT_PX));
    html! {
        div.scroll {
            svg.wide role="img" aria-label={ "Attitude, throttle stick and RC gaps of drone " (id) }
                viewBox={ "0 0 " (WIDTH_PX) " " (px(base + BOTTOM_PX)) }
            {
                @for (panel, top) in panels.iter().zip(tops) {
                    (draw(panel, &runs, &x, top))
                }
                (seconds(report, &x, base))
                (incidents(marks, id, &x, base))
            }
        }
    }
}

/// The panels for which there are values.
fn panels(runs: &[Vec<(f64, Stretch)>]) -> Vec<Panel> {
    let all = || runs.iter().flatten().map(|(_, stretch)| stretch);
    let leans = all().map(|it| it.roll_deg.joined(it.pitch_deg));
    let lean = leans.reduce(Extremes::joined);
    let far = lean
        .map_or(0.0, |it| it.greatest.max(-it.least))
        .max(LEAN_MIN_DEG);
    let mut panels = vec![Panel {
        name: "attitude in degrees",
        ends: (-far, far),
        lines: &[
            ("c-roll", |it| Some(it.roll_deg)),
            ("c-pitch", |it| Some(it.pitch_deg)),
        ],
    }];
    if all().any(|it| it.throttle_us.is_some()) {
        panels.push(Panel {
            name: "throttle stick in µs",
            ends: THROTTLE_US,
            lines: &[("c-throttle", |it| it.throttle_us)],
        });
    }
    if all().any(|it| it.rc_gap_ms.is_some()) {
        panels.push(Panel {
            name: "longest RC gap in ms",
            ends: (0.0, GAP_END_MS),
            lines: &[("c-gap", |it| {
                it.rc_gap_ms.map(|gap| Extremes {
                    least: gap,
                    greatest: gap,
                })
            })],
        });
    }
    panels
}

fn draw(panel: &Panel, runs: &[Vec<(f64, Stretch)>], x: &Axis, top: f64) -> Markup {
    let (low, high) = panel.ends;
    let y = Axis::new(panel.ends, (top + PANEL_PX, top));
    let right = WIDTH_PX - RIGHT_PX;
    html! {
        text.axis-name x=(LEFT_PX) y=(px(top - 8.0)) { (panel.name) }
        (scale(&y, panel.ends, 4.0, (LEFT_PX, right)))
        @if panel.lines.iter().any(|(class, _)| *class == "c-gap") {
            @let at = px(y.px(gap_max_ms()));
            line.mean x1=(LEFT_PX) x2=(right) y1=(at) y2=(at) {}
        }
        @for (class, value) in panel.lines {
            path.band.(class) d=(bands(runs, x, &y, |stretch| {
                let it = value(stretch)?;
                Some((it.least.clamp(low, high), it.greatest.clamp(low, high)))
            })) {}
        }
    }
}

/// A band for each run: along the greatest values, and back along the least.
fn bands(
    runs: &[Vec<(f64, Stretch)>],
    x: &Axis,
    y: &Axis,
    value: impl Fn(&Stretch) -> Option<(f64, f64)>,
) -> String {
    let mut path = String::new();
    for run in runs {
        let points = run
            .iter()
            .filter_map(|(at_s, stretch)| Some((*at_s, value(stretch)?)));
        let points: Vec<_> = points.collect();
        let there = points.iter().map(|(at_s, (_, greatest))| (at_s, greatest));
        let back = points.iter().rev().map(|(at_s, (least, _))| (at_s, least));
        let mut before = None;
        for (at_s, value) in there.chain(back) {
            let (at, height) = (px(x.px(*at_s)), px(y.px(*value)));
            // Steps are shorter than places, and of rounded places they don't drift.
            let written = match before.replace((at, height)) {
                None => write!(path, "M{at} {height}l"),
                Some((x, y)) => write!(path, "{} {} ", px(at - x), px(height - y)),
            };
            written.expect("writing to a string never fails");
        }
    }
    path
}

/// Ticks of the time axis.
fn seconds(report: &Report, x: &Axis, base: f64) -> Markup {
    let times = ticks(0.0, report.simulated_s, 10.0);
    let digits = decimals(&times);
    html! {
        @for time_s in times {
            text.tick x=(px(x.px(time_s))) y=(px(base + 21.0)) text-anchor="middle" { (figure(time_s, digits)) }
        }
        text.axis-name x=(px(f64::midpoint(LEFT_PX, WIDTH_PX - RIGHT_PX))) y=(px(base + 39.0))
            text-anchor="middle" { "time in seconds" }
    }
}

/// Faults of a drone, and the rules that it broke.
fn incidents(marks: &[Mark], id: u32, x: &Axis, base: f64) -> Markup {
    let shown = |it: &&Mark| matches!(it.kind, MarkKind::Fault | MarkKind::Violation);
    html! {
        @for mark in marks.iter().filter(shown).filter(|it| it.nodes.contains(&id)) {
            @let at = px(x.px(mark.at.as_secs_f64()));
            g.broken {
                title { (mark.kind.name()) " at " (figure(mark.at.as_secs_f64(), 1)) " s: " (mark.text) }
                line x1=(at) x2=(at) y1=(NAME_PX) y2=(px(base)) {}
                path d={ "M" (at) " " (px(base)) "l-5 8h10z" } {}
            }
        }
    }
}
