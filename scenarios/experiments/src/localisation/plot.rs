//! Plots over the scans of a track.

use maud::{Markup, html};
use muster_runtime::text::figure;

use crate::output::html::axis::{Axis, px, scale, ticks};

const WIDTH_PX: f64 = 540.0;
const HEIGHT_PX: f64 = 200.0;
const LEFT_PX: f64 = 62.0;
const RIGHT_PX: f64 = 12.0;
const TOP_PX: f64 = 12.0;
const BOTTOM_PX: f64 = 40.0;

/// A line over the scans.
pub(super) fn plot(name: &str, about: &str, values: &[f64]) -> Markup {
    let base = HEIGHT_PX - BOTTOM_PX;
    let last = values.len().saturating_sub(1) as f64;
    let x = Axis::new((0.0, last), (LEFT_PX, WIDTH_PX - RIGHT_PX));
    let most = values.iter().copied().fold(0.0, f64::max) * 1.05;
    let y = Axis::new((0.0, most), (base, TOP_PX));
    let places = values.iter().enumerate();
    let places =
        places.map(|(scan, value)| format!("{},{}", px(x.px(scan as f64)), px(y.px(*value))));
    html! {
        figure {
            figcaption { (name) span { (about) } }
            svg role="img" aria-label=(name) viewBox={ "0 0 " (WIDTH_PX) " " (HEIGHT_PX) } {
                (scale(&y, (0.0, most), 4.0, (LEFT_PX, WIDTH_PX - RIGHT_PX)))
                polyline.value-line points=(places.collect::<Vec<_>>().join(" ")) {}
                @for scan in ticks(0.0, last, 8.0) {
                    text.tick x=(px(x.px(scan))) y=(base + 18.0) text-anchor="middle" { (figure(scan, 0)) }
                }
                text.axis-name x=((LEFT_PX + WIDTH_PX - RIGHT_PX) / 2.0) y=(HEIGHT_PX - 6.0) text-anchor="middle" { "scan" }
            }
        }
    }
}
