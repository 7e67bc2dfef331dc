//! Marks on the map. Shapes distinguish the kinds without colour.

use maud::{Markup, html};

use super::super::axis::px;
use crate::output::figures::Kind;

/// Mark of a flying drone, `size_px` wide: diamond for the master, square for a relay, disc for a leaf.
pub(super) fn drone(kind: Kind, (x, y): (f64, f64), size_px: f64) -> Markup {
    let half = size_px / 2.0;
    html! {
        @match kind {
            Kind::Master => {
                @let half = half * 1.35;
                path.mark d={
                    "M" (px(x)) " " (px(y - half)) "L" (px(x + half)) " " (px(y))
                    "L" (px(x)) " " (px(y + half)) "L" (px(x - half)) " " (px(y)) "Z"
                } {}
            }
            Kind::Relay => {
                rect.mark x=(px(x - half)) y=(px(y - half)) width=(px(size_px)) height=(px(size_px)) {}
            }
            Kind::Leaf => circle.mark cx=(px(x)) cy=(px(y)) r=(px(half * 1.1)) {},
        }
    }
}

/// Mark of a start position.
pub(super) fn start((x, y): (f64, f64), size_px: f64) -> Markup {
    html! { circle.ring cx=(px(x)) cy=(px(y)) r=(px(size_px / 2.0)) {} }
}

/// Mark of a last position.
pub(super) fn landing((x, y): (f64, f64), size_px: f64) -> Markup {
    let half = size_px / 2.0;
    html! {
        path.cross d={
            "M" (px(x - half)) " " (px(y - half)) "L" (px(x + half)) " " (px(y + half))
            "M" (px(x - half)) " " (px(y + half)) "L" (px(x + half)) " " (px(y - half))
        } {}
    }
}

/// Pin above a waypoint, with the waypoint's number.
pub(super) fn pin((x, y): (f64, f64), number: &str) -> Markup {
    let half = 5.0 + 3.8 * number.chars().count().max(1) as f64;
    html! {
        circle.pin cx=(px(x)) cy=(px(y)) r="2.5" {}
        path.pin d={ "M" (px(x)) " " (px(y - 8.0)) "l-5 -7h10z" } {}
        rect.pin x=(px(x - half)) y=(px(y - 32.0)) width=(px(2.0 * half)) height="18" rx="9" {}
        text.pin-number x=(px(x)) y=(px(y - 23.0)) dy="0.36em" text-anchor="middle" { (number) }
    }
}

/// One mark as a picture for a legend.
pub(super) fn swatch(class: &str, mark: &Markup) -> Markup {
    html! {
        svg.swatch.(class) viewBox="-9 -9 18 18" aria-hidden="true" { (mark) }
    }
}
