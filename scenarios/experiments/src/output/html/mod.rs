//! The HTML page of a run: one file without network access. Its script plays the run; all else is there without it.

pub(crate) mod axis;
pub(crate) mod bars;
mod control;
pub(crate) mod map;
mod relays;
mod replay;
pub(crate) mod scaling;
mod tables;
#[cfg(test)]
mod tests;
mod timeline;

use maud::{DOCTYPE, Markup, PreEscaped, html};
use muster_runtime::text::{figure, figure_or_dash, plural};
use muster_scenarios::report::{FirmwareStalls, Flight, Report};

use super::figures::speedup_text;
use super::mission;
use super::table::UNCHECKED;
use super::write::{REPORT_JSON, TRACKS_CSV};

/// Style sheet of all pages.
const STYLE: &str = include_str!("page.css");
/// Content security policy: the browser may load nothing, and run no script.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'";

/// The page of a run as HTML, about 20 kB per drone. All texts of the run are escaped.
#[must_use]
pub fn page(report: &Report, flight: &Flight) -> String {
    let title = format!("{}, seed {}", report.name(), report.seed);
    let content = html! {
        (head(report))
        (replay::section(report))
        (sections(report, flight))
        (replay::script(report, flight))
    };
    let policy = format!("{POLICY}; script-src {}", replay::script_source());
    document_with(&policy, &title, replay::STYLE, &content)
}

/// A page without scripts, with the common style sheet and the additional `style`.
#[must_use]
pub fn document(title: &str, style: &str, content: &Markup) -> String {
    document_with(POLICY, title, style, content)
}

fn document_with(policy: &str, title: &str, style: &str, content: &Markup) -> String {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                meta http-equiv="Content-Security-Policy" content=(policy);
                title { (title) " – muster" }
                style { (PreEscaped(STYLE)) (PreEscaped(style)) }
            }
            body { main { (content) } }
        }
    }
    .into_string()
}

fn head(report: &Report) -> Markup {
    html! {
        header {
            p.kind { @if report.engine.is_some() { "muster · simulated run" } @else { "muster · run with processes" } }
            h1 { (report.name()) }
            dl.facts {
                div { dt { "Scenario" } dd { (report.scenario) } }
                div { dt { "Seed" } dd { (report.seed) } }
                @if let Some(engine) = report.engine { div { dt { "Engine" } dd { (engine) } } }
                div { dt { "Drones" } dd {
                    (report.drones.len())
                    @for other in &report.others { " + " (other.drones.len()) }
                } }
                @if let Some(never) = mission::never_injected(report) { div { dt { "Faults" } dd { (never) } } }
                @if report.engine.is_some() {
                    div { dt { "Simulated" } dd { (figure(report.simulated_s, 1)) " s" } }
                    div {
                        dt { "Wall-clock time" }
                        dd { (figure(report.wall_s, 2)) " s" @if let Some(speedup_text) = speedup_text(report) { span.aside { (speedup_text) } } }
                    }
                } @else {
                    div { dt { "Duration" } dd {
                        (figure(report.simulated_s, 1)) " s "
                        span.aside { "in real time" @if report.interrupted { ", then interrupted" } }
                    } }
                    @if let Some(uncertainty_s) = report.clock_uncertainty_s {
                        div { dt { "Clock error at most" } dd { (figure(uncertainty_s * 1e3, 2)) " ms" } }
                    }
                    @if let Some(stalls) = report.firmware_stalls.and_then(FirmwareStalls::text) {
                        div { dt { "Firmware" } dd { (stalls) } }
                    }
                }
            }
        }
        div.cards {
            (card("Flight time of the master", report.master().and_then(|drone| drone.flight_time_s), 1, "s"))
            (card("Flight time, mean", report.means.flight_time_s, 1, "s"))
            (card("Messages received by a drone, mean", Some(report.means.messages_received), 0, ""))
            (card("Barrier wait, mean", report.mean_wait_s(), 2, "s"))
            (card("Closest approach", report.min_separation_m, 1, "m"))
            (mission_card(report))
            (verdict(report))
        }
    }
}

fn mission_card(report: &Report) -> Markup {
    html! {
        div.card.{ @if report.mission_completed { "good" } @else { "bad" } } {
            p { "Mission completed" }
            p.value {
                @if report.mission_completed { span.sign { "✓" } " yes" }
                @else { span.sign { "✕" } " no" }
            }
            @if let Some(note) = mission::note(report) { p.note { (note) } }
        }
    }
}

pub(crate) fn card(name: &str, value: Option<f64>, decimals: usize, unit: &str) -> Markup {
    html! {
        div.card {
            p { (name) }
            p.value {
                (figure_or_dash(value, decimals))
                @if value.is_some() { " " span.unit { (unit) } }
            }
        }
    }
}

fn verdict(report: &Report) -> Markup {
    let broken = report.violations.len();
    html! {
        div.card.{ @if broken == 0 && !report.unchecked { "good" } @else { "bad" } } {
            p { "Rules broken" }
            p.value {
                @if report.unchecked { "?" }
                @else if broken == 0 { span.sign { "✓" } " none" }
                @else { span.sign { "✕" } " " (plural(broken, "time")) }
            }
            @if report.unchecked { p.note { (UNCHECKED) } }
        }
    }
}

fn sections(report: &Report, flight: &Flight) -> Markup {
    html! {
        @if !report.violations.is_empty() {
            section.bad { h2 { "Broken rules" } (tables::violations(report)) }
        }
        section {
            h2 { "Tracks" }
            p.about {
                "Seen from above. Marks show the drones when the master first reached a waypoint. "
                "The circle is the radio range of the drone that was master then."
            }
            (map::map(report, flight))
        }
        @if !report.others.is_empty() { h2.swarm { "Swarm of " (report.scenario) } }
        (swarm_sections(report, flight))
        @for (report, flight) in report.others.iter().zip(&flight.others) {
            h2.swarm { "Swarm of " (report.scenario) }
            (swarm_sections(report, flight))
        }
        section {
            h2 { "Repeat the run" }
            pre { code { (report.command) } }
            p.about {
                @if let Some(trace) = &report.trace {
                    "The same program version gives the same trace: " code.trace { (trace) } ". "
                }
                "Figures: " a href=(REPORT_JSON) { (REPORT_JSON) }
                ". Positions: " a href=(TRACKS_CSV) { (TRACKS_CSV) } "."
            }
        }
    }
}

/// Sections of one swarm.
fn swarm_sections(report: &Report, flight: &Flight) -> Markup {
    let paired = report.drones.len() <= bars::NARROW_MAX;
    html! {
        div.pair[paired] {
            section {
                h2 { "Flight time" }
                p.about { "From the start of neighbour discovery to the end of the landing." }
                ul.legend { (map::kinds()) }
                (bars::flight_times(report))
            }
            section {
                h2 { "Messages" }
                p.about { "Full colour: received. Pale: sent. The line is the mean received." }
                ul.legend { (map::kinds()) }
                (bars::messages(report))
            }
        }
        section {
            h2 { "Mission states" }
            p.about { "A number above is a waypoint, at the time when the last drone left it." }
            (timeline::timeline(report, flight))
        }
        (control::control(report, flight))
        (relays::relays(report))
        section {
            h2 { "Barriers" }
            p.about {
                "Barrier wait: from the last arrival to the last departure, without planned holds. Transmissions: frames of all "
                "drones from the first arrival to the last departure, without keep-alives. Waypoint 0 is the end of the take-off."
            }
            (tables::barriers(report))
        }
        @if report.following.is_some() {
            section {
                h2 { "Formation error" }
                p.about {
                    "Distance of each following drone from its slot around the master, sampled ten times a second."
                }
                (tables::following(report))
            }
        }
        @if !report.changes.is_empty() {
            section {
                h2 { "Changes of formation" }
                p.about {
                    "All drones climb to their altitude layers, cross, and descend into their new slots. Each step starts "
                    "when all drones have completed the one before."
                }
                (tables::changes(report))
            }
        }
        section { h2 { "Drones" } (tables::swarm(report)) }
    }
}
