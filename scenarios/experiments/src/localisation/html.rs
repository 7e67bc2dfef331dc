//! The page of a track: the map with it, particles at some moments, plots, a table.

use maud::{Markup, html};
use muster_indoor::frames::MapXy;
use muster_indoor::map::Map;
use muster_runtime::text::{figure, figure_or_dash, plural};

use super::drawing::Drawing;
use super::plot::plot;
use super::{Located, Moment, Track};
use crate::output::html::{card, document};

const STYLE: &str = include_str!("localisation.css");
/// Most rows of the table.
const ROWS_MAX: usize = 1_000;

/// The page of a track as HTML. All texts are escaped.
pub(super) fn page(track: &Track, map: &Map) -> String {
    let drawing = Drawing::new(map);
    let title = format!("{} on {}", track.log, track.map);
    let of = |value: fn(&Located) -> f64| track.scans.iter().map(value).collect::<Vec<f64>>();
    let content = html! {
        (drawing.definition())
        (head(track))
        section {
            h2 { "Track" }
            p.about { "Full line: found. Dashed: the most likely poses while lost. The ring is the last scan's pose." }
            (whole(track, &drawing))
        }
        section {
            h2 { "Particles" }
            p.about { "After the scan that is named, up to 2,000 of them. The ring is the pose." }
            div.moments { @for moment in &track.moments { (cloud(track, moment, &drawing)) } }
        }
        section {
            h2 { "Over the scans" }
            div.figures {
                (plot("Fit", "Share of readings that fit the map at the pose, in %", &of(|it| it.fit * 100.0)))
                (plot("Particles", "Number at the scan", &of(|it| it.particles as f64)))
                (plot("Deviation", "Of the particles' places at the pose, in m", &of(|it| it.deviation_m)))
                @if track.scans.iter().filter(|it| it.error_m.is_some()).count() > 1 {
                    (plot("Error", "Distance to the true place, in m", &of(|it| it.error_m.unwrap_or(0.0))))
                }
            }
        }
        (rows(track))
    };
    document(&title, STYLE, &content)
}

fn head(track: &Track) -> Markup {
    let found = track.found_at();
    let last = track.scans.last();
    html! {
        header {
            p.kind { "muster · localisation" }
            h1 { (track.log) }
            dl.facts {
                div { dt { "Map" } dd { (track.map) } }
                div { dt { "Scans" } dd { (track.scans.len()) } }
                div { dt { "Seed" } dd { (track.seed) } }
            }
        }
        div.cards {
            div.card.{ @if found.is_some() { "good" } @else { "bad" } } {
                p { "At the end" }
                p.value {
                    @if found.is_some() { span.sign { "✓" } " found" } @else { span.sign { "✕" } " lost" }
                }
            }
            (card("Found at scan", found.map(|scan| scan as f64), 0, ""))
            (card("Particles since, mean", track.particles_mean(), 0, ""))
            (card("Fit at the last scan", last.map(|it| it.fit * 100.0), 0, "%"))
            (card("Error at the last scan", last.and_then(|it| it.error_m), 2, "m"))
            (card("Time for a scan, median", track.took_ms_median(), 2, "ms"))
        }
    }
}

fn at(scan: &Located) -> MapXy {
    MapXy::new(scan.x_m, scan.y_m)
}

fn whole(track: &Track, drawing: &Drawing<'_>) -> Markup {
    let found = track.found_at().unwrap_or(track.scans.len());
    // The dashed line goes on to where the full one begins.
    let lost = &track.scans[..(found + 1).min(track.scans.len())];
    drawing.with(
        "Map with the track",
        &html! {
            path.lost d=(drawing.line(lost.iter().map(at))) {}
            path.track d=(drawing.line(track.scans[found..].iter().map(at))) {}
            @if let Some(last) = track.scans.last() { (ring(last, drawing)) }
        },
    )
}

fn cloud(track: &Track, moment: &Moment, drawing: &Drawing<'_>) -> Markup {
    let scan = track.scans.get(moment.scan);
    let particles = scan.map_or(0, |scan| scan.particles);
    html! {
        figure {
            figcaption {
                "Scan " (moment.scan)
                span { (figure(particles as f64, 0)) " particles" @if scan.is_some_and(|it| it.is_lost) { ", lost" } }
            }
            (drawing.with(&format!("Particles after scan {}", moment.scan), &html! {
                path.particles d=(drawing.dots(&moment.particles)) {}
                @if let Some(scan) = scan { (ring(scan, drawing)) }
            }))
        }
    }
}

fn ring(scan: &Located, drawing: &Drawing<'_>) -> Markup {
    html! { path.ring d={ (drawing.line(std::iter::once(at(scan)))) "h0" } {} path.pin d={ (drawing.line(std::iter::once(at(scan)))) "h0" } {} }
}

fn rows(track: &Track) -> Markup {
    let has_truth = track.scans.iter().any(|scan| scan.error_m.is_some());
    html! {
        section {
            h2 { "All scans" }
            @if track.scans.len() > ROWS_MAX { p.about { "The first " (plural(ROWS_MAX, "scan")) "." } }
            div.scroll {
                table {
                    thead { tr {
                        th.n { "Scan" } th.n { "x m" } th.n { "y m" } th.n { "Heading °" } th.n { "Deviation m" }
                        th.n { "Fit %" } th.n { "Particles" } th { "" }
                        @if has_truth { th.n { "Error m" } }
                    } }
                    tbody {
                        @for scan in track.scans.iter().take(ROWS_MAX) {
                            tr {
                                td.n { (scan.scan) } td.n { (figure(scan.x_m, 2)) } td.n { (figure(scan.y_m, 2)) }
                                td.n { (figure(scan.heading_deg, 1)) } td.n { (figure(scan.deviation_m, 2)) }
                                td.n { (figure(scan.fit * 100.0, 0)) } td.n { (figure(scan.particles as f64, 0)) }
                                td { @if scan.is_lost { "lost" } }
                                @if has_truth { td.n { (figure_or_dash(scan.error_m, 2)) } }
                            }
                        }
                    }
                }
            }
        }
    }
}
