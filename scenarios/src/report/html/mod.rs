//! The page that shows a run: one file, without scripts, that opens from disk and asks the network for nothing.

pub(crate) mod axis;
pub(crate) mod bars;
pub(crate) mod map;
mod relays;
pub(crate) mod scaling;
mod tables;
#[cfg(test)]
mod tests;
mod timeline;

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::figures::pace;
use super::table::UNCHECKED;
use super::write::{REPORT_JSON, TRACKS_CSV};
use super::{Flight, Report};
use muster_runtime::text::{figure, figure_or_nothing, plural};

/// What the page's parts look like.
const STYLE: &str = include_str!("page.css");
/// What the browser may load: nothing.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'";

/// The page of a run, as HTML: about 10 kB a drone.
///
/// Every text that comes from the run is escaped.
#[must_use]
pub fn page(report: &Report, flight: &Flight) -> String {
    let title = format!("{}, seed {}", report.name(), report.seed);
    document(
        &title,
        "",
        &html! { (head(report)) (sections(report, flight)) },
    )
}

/// A page in this style, with `style` besides.
pub(crate) fn document(title: &str, style: &str, content: &Markup) -> String {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                meta http-equiv="Content-Security-Policy" content=(POLICY);
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
            p.kind { @if report.engine.is_some() { "muster · simulated run" } @else { "muster · flight of processes" } }
            h1 { (report.name()) }
            dl.facts {
                div { dt { "Scenario" } dd { (report.scenario) } }
                div { dt { "Seed" } dd { (report.seed) } }
                @if let Some(engine) = report.engine { div { dt { "Engine" } dd { (engine) } } }
                div { dt { "Drones" } dd {
                    (report.drones.len())
                    @for other in &report.others { " + " (other.drones.len()) }
                } }
                @if report.engine.is_some() {
                    div { dt { "Simulated" } dd { (figure(report.simulated_s, 1)) " s" } }
                    div {
                        dt { "Took" }
                        dd { (figure(report.wall_s, 2)) " s" @if let Some(pace) = pace(report) { span.aside { (pace) } } }
                    }
                } @else {
                    div { dt { "Took" } dd { (figure(report.simulated_s, 1)) " s " span.aside { "in real time" } } }
                    @if let Some(uncertainty_s) = report.clock_uncertainty_s {
                        div { dt { "Clocks known to" } dd { (figure(uncertainty_s * 1e3, 2)) " ms" } }
                    }
                }
            }
        }
        div.cards {
            (card("Flight time of the master", report.master().and_then(|drone| drone.flight_time_s), 1, "s"))
            (card("Flight time, mean", report.means.flight_time_s, 1, "s"))
            (card("Messages received, mean", Some(report.means.messages_received), 0, "a drone"))
            (card("Wait at a waypoint, mean", report.mean_wait_s(), 2, "s"))
            (card("Closest two drones came", report.min_separation_m, 1, "m"))
            (verdict(report))
        }
    }
}

pub(crate) fn card(name: &str, value: Option<f64>, decimals: usize, unit: &str) -> Markup {
    html! {
        div.card {
            p { (name) }
            p.value {
                (figure_or_nothing(value, decimals))
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
                @if report.unchecked { (UNCHECKED) }
                @else if broken == 0 { span.sign { "✓" } " none" }
                @else { span.sign { "✕" } " " (plural(broken, "time")) }
            }
        }
    }
}

fn sections(report: &Report, flight: &Flight) -> Markup {
    html! {
        @if !report.violations.is_empty() {
            section.bad { h2 { "Rules that were broken" } (tables::violations(report)) }
        }
        section {
            h2 { "Tracks" }
            p.about {
                "Seen from above. Each drone is marked where it was when the master first stood at a waypoint; "
                "the circle is how far the master's radio reached from there."
            }
            (map::map(report, flight))
        }
        @if !report.others.is_empty() { h2.swarm { "The swarm of " (report.scenario) } }
        (of_swarm(report, flight))
        @for (report, flight) in report.others.iter().zip(&flight.others) {
            h2.swarm { "The swarm of " (report.scenario) }
            (of_swarm(report, flight))
        }
        section {
            h2 { "Run it again" }
            pre { code { (report.command) } }
            p.about {
                @if let Some(trace) = &report.trace {
                    "The same program gives the same trace: " code.trace { (trace) } ". "
                }
                "All figures are in " a href=(REPORT_JSON) { (REPORT_JSON) }
                ", all positions in " a href=(TRACKS_CSV) { (TRACKS_CSV) } "."
            }
        }
    }
}

/// What one swarm did.
fn of_swarm(report: &Report, flight: &Flight) -> Markup {
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
                p.about { "Received in full colour, sent in pale; the mean is of those received." }
                ul.legend { (map::kinds()) }
                (bars::messages(report))
            }
        }
        section {
            h2 { "What each drone was doing" }
            p.about { "A number above is where the whole swarm had begun to move on from that waypoint." }
            (timeline::timeline(report, flight))
        }
        (relays::relays(report))
        section {
            h2 { "Waits for the swarm" }
            p.about {
                "From the arrival of the last drone to the departure of the last drone, "
                "with the frames that anyone sent since the first one arrived, keep-alives apart. Waypoint 0 is where the take-off ended."
            }
            (tables::barriers(report))
        }
        @if report.following.is_some() {
            section {
                h2 { "Formation kept" }
                p.about {
                    "How far each drone was from its slot around the master that it followed, ten times a second, in "
                    "metres."
                }
                (tables::following(report))
            }
        }
        @if !report.changes.is_empty() {
            section {
                h2 { "Changes of formation" }
                p.about {
                    "All climb into their altitude sectors, all cross, all descend into their new slots; each step "
                    "begins when all have done the one before."
                }
                (tables::changes(report))
            }
        }
        section { h2 { "Drones" } (tables::swarm(report)) }
    }
}
