//! The map of a run: all tracks, and enlargements of crowded areas.

mod drawn;
mod frame;
mod label;
mod mark;
mod track;

use drawn::{DroneDrawing, End};
use frame::{Axes, Extent, Frame};
use maud::{Markup, html};
use muster_machines::geometry::Ned;
use muster_runtime::text::figure;
use muster_scenarios::report::{Flight, Report};

use super::axis::px;
use crate::output::figures::Kind;

/// Range of the ratio of width to height of the map.
const PROPORTIONS: (f64, f64) = (0.62, 3.0);
/// Range of the ratio of width to height of an enlargement.
const PROPORTIONS_ENLARGED: (f64, f64) = (1.4, 2.2);
/// An area that is smaller than the map by more than this factor is enlarged.
const ENLARGED_FROM: f64 = 7.0;
/// A radio range above this multiple of the flown extent does not enlarge the map.
const RANGE_SHOWN_TO: f64 = 1.5;
/// Minimum side of a map, in metres.
const LEAST_M: f64 = 30.0;

/// The map with its legend, or a note if there are no positions.
pub(super) fn map(report: &Report, flight: &Flight) -> Markup {
    let swarms = report.swarms().zip(flight.swarms());
    let swarm: Vec<_> = swarms
        .flat_map(|(report, flight)| DroneDrawing::swarm(report, flight))
        .collect();
    let master = swarm.iter().find(|drone| drone.led);
    let master = master.and_then(|drone| Some((drone.report.id, drone.formed?)));
    let Some(whole) = whole(&swarm, flight, master.map(|(_, place)| place)) else {
        return html! { p.none { "No positions were recorded." } };
    };
    let is_beyond = flight.range_m > whole.longest_m();
    let ends = [End::Start, End::Landing].map(|end| (end, crowded(&swarm, whole, end)));
    let content = |frame: &Frame| {
        html! {
            (range(frame, master, flight.range_m))
            (links(frame, &swarm))
            @for drone in &swarm { (drone.track(frame)) }
            @for (end, crowded) in ends {
                @match crowded {
                    Some(extent) => (outline(frame, extent, end)),
                    None => @for drone in &swarm { (drone.end_mark(frame, end)) },
                }
            }
            (ids(frame, &swarm, |drone| drone.formed))
            @for swarm in flight.swarms() { (label::pins(frame, &swarm.waypoints)) }
            (north_arrow(frame.paper_px().0))
        }
    };
    let paper_px = if is_wide(whole) {
        (1010.0, 700.0)
    } else {
        (700.0, 700.0)
    };
    let frame = Frame::fit(whole.with_margin(LEAST_M, PROPORTIONS), paper_px);
    html! {
        div.map {
            div.main.wide[is_wide(whole)] {
                (frame.picture("Map of the tracks of all drones, north up", Axes::Named, &content(&frame)))
            }
            div.beside {
                (legend((flight.range_m, is_beyond), ends.iter().any(|(_, crowded)| crowded.is_none())))
                @for (end, crowded) in ends {
                    @if let Some(extent) = crowded { (enlarged(&swarm, extent, end)) }
                }
            }
        }
    }
}

/// Extent of everything drawn.
fn whole(swarm: &[DroneDrawing<'_>], flight: &Flight, master: Option<Ned>) -> Option<Extent> {
    let tracks = swarm
        .iter()
        .flat_map(|drone| drone.flight.track.iter().map(|&(_, place)| place));
    let waypoints = flight.swarms().flat_map(|swarm| &swarm.waypoints);
    let flown = Extent::around(tracks.chain(waypoints.copied()))?;
    Some(match master {
        Some(centre) if flight.range_m <= RANGE_SHOWN_TO * flown.longest_m() => {
            flown.joined(Extent::of_circle(centre, flight.range_m))
        }
        _ => flown,
    })
}

/// Extent around one end of all tracks, if it is too small on the map of `whole`.
fn crowded(swarm: &[DroneDrawing<'_>], whole: Extent, end: End) -> Option<Extent> {
    let extent = Extent::around(swarm.iter().filter_map(|drone| drone.end(end)))?;
    let too_small = swarm.len() > 1 && extent.longest_m() * ENLARGED_FROM < whole.longest_m();
    too_small.then(|| extent.with_margin(LEAST_M, PROPORTIONS_ENLARGED))
}

/// Whether the map takes the full width of the page.
fn is_wide(whole: Extent) -> bool {
    let (east_m, north_m) = whole.size_m();
    east_m > 1.4 * north_m
}

/// The circle around the drone that led when the marks were drawn.
fn range(frame: &Frame, master: Option<(u32, Ned)>, range_m: f64) -> Markup {
    let Some((id, centre)) = master else {
        return html! {};
    };
    let ((x, y), radius) = (frame.point_px(centre), frame.length_px(range_m));
    html! {
        g.range {
            title { "radio range of drone " (id) ", the master then: " (figure(range_m, 0)) " m" }
            circle cx=(px(x)) cy=(px(y)) r=(px(radius)) {}
            @if radius > 50.0 {
                text.halo x=(px(x)) y=(px(y + radius - 10.0)) text-anchor="middle" {
                    (figure(range_m, 0)) " m radio range"
                }
            }
        }
    }
}

/// Lines from each drone to its parent.
fn links(frame: &Frame, swarm: &[DroneDrawing<'_>]) -> Markup {
    let place_of = |id: u32| swarm.iter().find(|drone| drone.report.id == id)?.formed;
    html! {
        @for drone in swarm {
            @if let Some((from, to)) = drone.formed.zip(drone.report.parent.and_then(place_of)) {
                @let ((x1, y1), (x2, y2)) = (frame.point_px(from), frame.point_px(to));
                line.link x1=(px(x1)) y1=(px(y1)) x2=(px(x2)) y2=(px(y2)) {}
            }
        }
    }
}

/// Ids of the drones at the given places; the master's is always shown.
fn ids<'a>(
    frame: &Frame,
    swarm: &[DroneDrawing<'a>],
    place: impl Fn(&DroneDrawing<'a>) -> Option<Ned>,
) -> Markup {
    let placed = |drone: &DroneDrawing<'a>| Some((drone.report.id, frame.point_px(place(drone)?)));
    let points: Vec<_> = swarm.iter().rev().filter_map(placed).collect();
    label::ids(&points, swarm.first().map_or(0.0, |drone| drone.size_px))
}

/// Outline of an area that is enlarged elsewhere.
fn outline(frame: &Frame, extent: Extent, end: End) -> Markup {
    let [x, y, width, height] = frame.rectangle_px(extent);
    html! {
        rect.outline x=(px(x)) y=(px(y)) width=(px(width)) height=(px(height)) rx="2" {}
        text.outline-name.halo x=(px(x + width + 4.0)) y=(px(y)) dy="0.5em" { (end.letter()) }
    }
}

fn north_arrow(width_px: f64) -> Markup {
    html! {
        g.north transform={ "translate(" (px(width_px - 20.0)) " 34)" } {
            path d="M0 -24L6 -6L0 -10L-6 -6Z" {}
            text y="8" text-anchor="middle" { "N" }
        }
    }
}

fn enlarged(swarm: &[DroneDrawing<'_>], extent: Extent, end: End) -> Markup {
    let frame = Frame::fit(extent, (290.0, 200.0));
    let content = html! {
        @for drone in swarm { (drone.track(&frame)) }
        @for drone in swarm { (drone.end_mark(&frame, end)) }
        (ids(&frame, swarm, |drone| drone.end(end)))
    };
    html! {
        figure.enlarged {
            figcaption { span.letter { (end.letter()) } " " (end.name()) ", enlarged, in metres from home" }
            (frame.picture(&format!("Map of the {}, enlarged", end.name()), Axes::Unnamed, &content))
        }
    }
}

fn legend((range_m, is_beyond): (f64, bool), with_ends: bool) -> Markup {
    let origin = (0.0, 0.0);
    html! {
        ul.legend {
            (kinds())
            li { (mark::swatch("", &html! { circle.pin r="7" {} })) "waypoint of the formation's centre" }
            li { (mark::swatch("", &html! { line.link x1="-9" x2="9" {} })) "route to the master" }
            li {
                (mark::swatch("range", &html! { circle r="8" {} })) (figure(range_m, 0)) " m radio range"
                @if is_beyond { ", beyond the map" }
            }
            @if with_ends {
                li { (mark::swatch("", &End::Start.mark(origin, 9.0))) "start" }
                li { (mark::swatch("", &End::Landing.mark(origin, 9.0))) "last position" }
            }
        }
    }
}

/// Legend entries of the kinds of drones.
pub(crate) fn kinds() -> Markup {
    html! {
        @for kind in Kind::ALL {
            li { (swatch(kind)) (kind.name()) }
        }
    }
}

/// Symbol of a kind of drone, for legends and tables.
pub(super) fn swatch(kind: Kind) -> Markup {
    mark::swatch(
        &format!("k-{}", kind.name()),
        &mark::drone(kind, (0.0, 0.0), 10.0),
    )
}
