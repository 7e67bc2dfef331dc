//! Page of `cargo bench`: simulation cost per drone by swarm size.

use maud::{Markup, html};

use super::axis::{Axis, px, scale};
use super::document;
use muster_runtime::text::figure;

const STYLE: &str = include_str!("../../campaign/html/campaign.css");

const WIDTH_PX: f64 = 540.0;
const HEIGHT_PX: f64 = 260.0;
const LEFT_PX: f64 = 76.0;
const RIGHT_PX: f64 = 30.0;
const TOP_PX: f64 = 12.0;
const BOTTOM_PX: f64 = 46.0;

/// Simulation cost of one swarm size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scaling {
    /// Number of drones.
    pub drones: u32,
    /// Processor time per simulated drone-second, in microseconds.
    pub cpu_us: f64,
    /// Peak memory per drone, in KiB.
    pub memory_kib: f64,
}

/// Plots and a table of the simulation cost by swarm size, as HTML.
#[must_use]
pub fn scaling(points: &[Scaling]) -> String {
    let content = html! {
        header {
            p.kind { "muster · cargo bench" }
            h1 { "Simulation cost per drone" }
        }
        section {
            p.about { "One core, engine " code { "events" } ", rule checks off." }
            div.plots {
                (plot("Time", "Processor time per simulated drone-second, in µs", points, |it| it.cpu_us))
                (plot("Memory", "Peak memory per drone, in KiB", points, |it| it.memory_kib))
            }
        }
        section {
            div.scroll {
                table {
                    thead { tr { th.n { "Drones" } th.n { "µs per drone-second" } th.n { "KiB per drone" } } }
                    tbody {
                        @for point in points {
                            tr {
                                td.n { (point.drones) }
                                td.n { (figure(point.cpu_us, 1)) }
                                td.n { (figure(point.memory_kib, 1)) }
                            }
                        }
                    }
                }
            }
        }
    };
    document("Simulation cost per drone", STYLE, &content)
}

/// Plot of one quantity over the swarm size, on a logarithmic axis.
fn plot(name: &str, about: &str, points: &[Scaling], of: impl Fn(&Scaling) -> f64) -> Markup {
    let sizes = || points.iter().map(|point| f64::from(point.drones).log10());
    let (low, high) = sizes().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), size| {
        (low.min(size), high.max(size))
    });
    let base = HEIGHT_PX - BOTTOM_PX;
    let x = Axis::new((low, high), (LEFT_PX + 20.0, WIDTH_PX - RIGHT_PX));
    let most = points.iter().map(&of).fold(0.0, f64::max) * 1.05;
    let y = Axis::new((0.0, most), (base, TOP_PX));
    let places: Vec<_> = sizes().map(|size| x.px(size)).zip(points).collect();
    let line: Vec<_> = places
        .iter()
        .map(|(at, point)| format!("{},{}", px(*at), px(y.px(of(point)))))
        .collect();
    html! {
        figure {
            figcaption { (name) span { (about) } }
            svg role="img" aria-label=(name) viewBox={ "0 0 " (WIDTH_PX) " " (HEIGHT_PX) } {
                (scale(&y, (0.0, most), 5.0, (LEFT_PX, WIDTH_PX - RIGHT_PX)))
                line.baseline x1=(LEFT_PX) x2=(WIDTH_PX - RIGHT_PX) y1=(base) y2=(base) {}
                g.s0 {
                    polyline.through points=(line.join(" ")) {}
                    @for (at, point) in &places {
                        circle.median cx=(px(*at)) cy=(px(y.px(of(point)))) r="4.6" {
                            title { (point.drones) " drones: " (figure(of(point), 1)) }
                        }
                    }
                }
                @for (at, point) in &places {
                    text.tick x=(px(*at)) y=(base + 17.0) text-anchor="middle" { (point.drones) }
                }
                text.axis-name x=(px(f64::midpoint(LEFT_PX, WIDTH_PX - RIGHT_PX))) y=(HEIGHT_PX - 6.0)
                    text-anchor="middle" { "drones" }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn page_has_two_marks_for_each_size() {
        let points = [10, 1_000, 10_000].map(|drones| Scaling {
            drones,
            cpu_us: 7.5,
            memory_kib: 20.0,
        });
        let page = scaling(&points);
        assert_eq!(page.matches("<circle").count(), 2 * points.len());
        assert!(page.contains("10000 drones: 7.5"), "{page}");
    }
}
