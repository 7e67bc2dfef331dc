//! Pages with maps: a path, tours, a patrol.

mod drawing;

use maud::{Markup, html};
use muster_experiments::output::document;
use muster_indoor::coverage::{Places, Tour};
use muster_indoor::frames::MapXy;
use muster_indoor::map::Map;
use muster_runtime::text::{figure, plural, rounded_down};

use self::drawing::Drawing;
use crate::campaign::{self, Campaign};
use crate::world::{Outcome, Prepared};

const STYLE: &str = include_str!("page/indoor.css");
/// Number of colours of drones.
const COLOURS: usize = 5;

/// The page of a path.
#[must_use]
pub fn path(name: &str, map: &Map, radius_m: f64, path: &[MapXy]) -> String {
    let length_m: f64 = path.windows(2).map(|leg| leg[0].distance_m(leg[1])).sum();
    let drawing = Drawing::new(map);
    let content = html! {
        header {
            p.kind { "muster · path" }
            h1 { (name) }
        }
        div.cards {
            (card("Length", &figure(length_m, 1), "m"))
            (card("Straight legs", &figure(path.len().saturating_sub(1) as f64, 0), ""))
            (card("Kept from walls", &figure(radius_m, 2), "m"))
        }
        section {
            h2 { "Map" }
            (drawing.svg(&html! {
                (drawing.line(path, "path s0"))
                @for corner in path { (drawing.dot(*corner, 3.0, "s0")) }
                (drawing.ends(path))
            }))
            ul.legend { li { span.chip.s0 {} "path" } li { span.chip.wall {} "wall or unknown" } }
        }
    };
    document(&format!("{name}, path"), STYLE, &content)
}

/// The page of tours that see a map.
#[must_use]
pub fn cover(
    name: &str,
    map: &Map,
    tours: &[Tour],
    paths: &[Vec<MapXy>],
    places: &Places,
) -> String {
    let drawing = Drawing::new(map);
    let all = places.targets().len();
    let idle = tours.iter().filter(|tour| tour.stops.is_empty()).count();
    let hidden = (0..all).filter(|target| !places.visible().contains(*target));
    let content = html! {
        header {
            p.kind { "muster · coverage" }
            h1 { (name) }
        }
        div.cards {
            (card("Drones", &figure(tours.len() as f64, 0), ""))
            (card("Can be seen", &figure(100.0 * places.visible().len() as f64 / all.max(1) as f64, 1), "%"))
            (card("Longest tour", &figure(tours.iter().map(|it| it.length_m).fold(0.0, f64::max), 1), "m"))
        }
        section {
            h2 { "Tours" }
            p.about {
                "A drone looks round once at each numbered stop."
                @if idle > 0 { " " (plural(idle, "drone")) " without a stop: fewer are enough." }
            }
            (drawing.svg(&html! {
                (drawing.squares(hidden.map(|target| places.targets().centre(target)), "hidden"))
                @for (drone, path) in paths.iter().enumerate() { (drawing.line(path, &format!("path s{}", drone % COLOURS))) }
                @for (drone, tour) in tours.iter().enumerate() {
                    @for (number, stop) in (1..).zip(&tour.stops) { (drawing.stop(*stop, number, drone % COLOURS)) }
                }
            }))
            ul.legend {
                @for drone in 0..tours.len() { li { span.chip.{ "s" (drone % COLOURS) } {} "drone " (drone) } }
                li { span.chip.hidden {} "can't be seen" }
            }
            div.scroll { table {
                thead { tr { th.n { "Drone" } th.n { "Stops" } th.n { "Path, m" } } }
                tbody { @for (drone, tour) in tours.iter().enumerate() {
                    tr { td.n { (drone) } td.n { (tour.stops.len()) } td.n { (figure(tour.length_m, 1)) } }
                } }
            } }
        }
    };
    document(&format!("{name}, coverage"), STYLE, &content)
}

/// The page of a campaign of patrols, with the patrol of the first seed.
#[must_use]
pub fn patrol(prepared: &Prepared, campaign: &Campaign, first: &Outcome, command: &str) -> String {
    let failed = campaign::failed(campaign).count();
    let content = html! {
        header {
            p.kind { "muster · patrols of a flat" }
            h1 { (prepared.flat.name) }
            p.about { (prepared.flat.about) }
        }
        div.cards {
            (card("Patrols", &figure(campaign.rows.len() as f64, 0), ""))
            (card("Without noise and people", &figure(campaign.undisturbed_s, 1), "s"))
            div.card.{ @if failed == 0 { "good" } @else { "bad" } } {
                p { "Touched, blind or incomplete" }
                p.value { @if failed == 0 { "✓ none" } @else { "✕ " (figure(failed as f64, 0)) } }
            }
        }
        @if failed > 0 { (failures(campaign)) }
        (track(prepared, campaign, first))
        section {
            h2 { "All patrols" }
            div.scroll { table {
                thead { tr { th { "" } th.n { "Worst" } th.n { "Median" } th.n { "Accepted" } } }
                tbody { @for (name, worst, median, accepted) in campaign::lines(campaign) {
                    tr { td { (name) } td.n { (worst) } td.n { (median) } td.n { (accepted) } }
                } }
            } }
        }
        section { h2 { "Repeat it" } pre { code { (command) } } }
    };
    document(&format!("{}, patrols", prepared.flat.name), STYLE, &content)
}

/// The patrols that failed, with their seeds and reasons.
fn failures(campaign: &Campaign) -> Markup {
    let failed: Vec<_> = campaign::failed(campaign).collect();
    html! {
        section.bad {
            h2 { "Patrols that failed" }
            div.scroll { table {
                thead { tr { th.n { "Seed" } th.n { "Seen, %" } th.n { "Time, s" } th { "Why" } } }
                tbody { @for row in failed.iter().take(campaign::LISTED_MAX) {
                    tr {
                        td.n { (row.seed) }
                        td.n.short[row.seen < campaign::SEEN_MIN] { (rounded_down(100.0 * row.seen, 2)) }
                        td.n { (figure(row.time_s, 1)) }
                        td { (row.reasons().join("; ")) }
                    }
                } }
            } }
            @if failed.len() > campaign::LISTED_MAX {
                p.about { "… and " (failed.len() - campaign::LISTED_MAX) " more." }
            }
        }
    }
}

/// How near a drone comes to a stop from which it looks round, in metres.
const AT_STOP_M: f64 = 0.5;

/// The share that a patrol saw, marked if it is too little.
fn seen(share: f64) -> Markup {
    let percent = rounded_down(100.0 * share, 2);
    html! {
        @if share < campaign::SEEN_MIN {
            b.short { (percent) " %, less than " (figure(100.0 * campaign::SEEN_MIN, 0)) " %," }
        } @else { (percent) " %" }
    }
}

fn track(prepared: &Prepared, campaign: &Campaign, first: &Outcome) -> Markup {
    let drawing = Drawing::new(&prepared.flat.map);
    let seed = campaign.rows.first().map_or(0, |row| row.seed);
    let samples = first.track.samples();
    let track: Vec<MapXy> = samples.iter().map(|sample| sample.pose.at).collect();
    let believed: Vec<MapXy> = samples.iter().map(|sample| sample.believed.at).collect();
    let people = samples.first().map_or(0, |sample| sample.people.len());
    let walks = (0..people).map(|person| {
        let at = samples.iter().map(|sample| sample.people[person]);
        at.collect::<Vec<_>>()
    });
    let touches = first.clearance.touches();
    let targets = prepared.config.places.targets();
    let unseen = first
        .unseen_targets
        .iter()
        .map(|target| targets.centre(*target));
    let was_there = |stop: MapXy| track.iter().any(|at| at.distance_m(stop) < AT_STOP_M);
    let stops = &prepared.config.stops;
    let has_left_out = !stops.iter().all(|stop| was_there(*stop));
    html! {
        section {
            h2 { "Seed " (seed) }
            p.about {
                "It took " (figure(first.time.as_secs_f64(), 1)) " s, saw " (seen(first.seen())) " of what can be seen, "
                "and kept " (figure(first.clearance.least_m(), 2)) " m from walls and people. "
                (plural(touches.len(), "touch").replace("touchs", "touches")) "."
            }
            (drawing.svg(&html! {
                (drawing.squares(unseen, "unseen"))
                @for walk in walks { (drawing.line(&walk, "walk")) }
                (drawing.line(&believed, "believed"))
                (drawing.line(&track, "path s0"))
                @for (number, stop) in (1..).zip(stops) {
                    g.left-out[!was_there(*stop)] { (drawing.stop(*stop, number, 0)) }
                }
                @for touch in touches { (drawing.dot(touch.place, 7.0, "touch")) }
                (drawing.ends(&track))
            }))
            ul.legend {
                li { span.chip.s0 {} "drone, and its stops in order" }
                @if has_left_out { li { span.chip.s0.left-out {} "stop that was left out: what it is for had been seen, or it was given up" } }
                li { span.chip.believed {} "where it took itself to be" }
                li { span.chip.walk {} "people" }
                li { span.chip.unseen {} "not seen" }
                @if !touches.is_empty() { li { span.chip.touch {} "touch" } }
            }
        }
    }
}

fn card(name: &str, value: &str, unit: &str) -> Markup {
    html! {
        div.card {
            p { (name) }
            p.value { (value) @if !unit.is_empty() { " " span.unit { (unit) } } }
        }
    }
}
