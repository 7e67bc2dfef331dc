//! Mapping from an area on the ground to a picture: north up, equal scale in both directions.

use maud::{Markup, html};
use muster_machines::geometry::Ned;

use super::super::axis::{decimals, px, ticks};
use muster_runtime::text::figure;

const LEFT_PX: f64 = 66.0;
const LEFT_UNNAMED_PX: f64 = 46.0;
const RIGHT_PX: f64 = 14.0;
const TOP_PX: f64 = 10.0;
const BOTTOM_PX: f64 = 50.0;
const BOTTOM_UNNAMED_PX: f64 = 26.0;

/// Whether the axes have names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Axes {
    /// With names and numbers.
    Named,
    /// With numbers only.
    Unnamed,
}

/// A rectangle on the ground, aligned north and east, in metres from home.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Extent {
    north_m: (f64, f64),
    east_m: (f64, f64),
}

impl Extent {
    /// Bounding box of `places`; `None` without finite places.
    pub(super) fn around(places: impl IntoIterator<Item = Ned>) -> Option<Self> {
        let points = places
            .into_iter()
            .map(|place| (place.north_m(), place.east_m()));
        let finite = points.filter(|(north, east)| north.is_finite() && east.is_finite());
        finite
            .map(|(north, east)| Self {
                north_m: (north, north),
                east_m: (east, east),
            })
            .reduce(Self::joined)
    }

    /// Bounding box of a circle.
    pub(super) fn of_circle(centre: Ned, radius_m: f64) -> Self {
        let (north, east) = (centre.north_m(), centre.east_m());
        Self {
            north_m: (north - radius_m, north + radius_m),
            east_m: (east - radius_m, east + radius_m),
        }
    }

    /// Bounding box of both.
    pub(super) fn joined(self, other: Self) -> Self {
        let hull = |a: (f64, f64), b: (f64, f64)| (a.0.min(b.0), a.1.max(b.1));
        Self {
            north_m: hull(self.north_m, other.north_m),
            east_m: hull(self.east_m, other.east_m),
        }
    }

    /// Size to the east and to the north.
    pub(super) fn size_m(self) -> (f64, f64) {
        (
            self.east_m.1 - self.east_m.0,
            self.north_m.1 - self.north_m.0,
        )
    }

    /// Length of the longer side.
    pub(super) fn longest_m(self) -> f64 {
        let (east_m, north_m) = self.size_m();
        east_m.max(north_m)
    }

    /// Adds a margin on every side, so that both sides are at least `least_m` and the ratio of width to height is between
    /// `narrowest` and `widest`.
    pub(super) fn with_margin(self, least_m: f64, (narrowest, widest): (f64, f64)) -> Self {
        let margin_m = self.longest_m() * 0.065;
        let (east_m, north_m) = self.size_m();
        let east_m = (east_m + 2.0 * margin_m).max(least_m);
        let north_m = (north_m + 2.0 * margin_m).max(least_m);
        let east_m = east_m.max(north_m * narrowest);
        let north_m = north_m.max(east_m / widest);
        let about = |(low, high): (f64, f64), size_m: f64| {
            let middle = f64::midpoint(low, high);
            (middle - size_m / 2.0, middle + size_m / 2.0)
        };
        Self {
            north_m: about(self.north_m, north_m),
            east_m: about(self.east_m, east_m),
        }
    }
}

/// An extent with its scale on paper.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    extent: Extent,
    px_per_m: f64,
}

impl Frame {
    /// `extent` at the largest scale that fits into `width_px` by `height_px`.
    pub(super) fn fit(extent: Extent, (width_px, height_px): (f64, f64)) -> Self {
        let (east_m, north_m) = extent.size_m();
        Self {
            extent,
            px_per_m: (width_px / east_m).min(height_px / north_m),
        }
    }

    /// Length of `length_m` on paper.
    pub(super) fn length_px(&self, length_m: f64) -> f64 {
        length_m * self.px_per_m
    }

    /// Position of `place` on paper, from the top left corner.
    pub(super) fn point_px(&self, place: Ned) -> (f64, f64) {
        (self.x_px(place.east_m()), self.y_px(place.north_m()))
    }

    /// North-west corner, width and height of `extent` on paper.
    pub(super) fn rectangle_px(&self, extent: Extent) -> [f64; 4] {
        let (east_m, north_m) = extent.size_m();
        let (x, y) = (self.x_px(extent.east_m.0), self.y_px(extent.north_m.1));
        [x, y, self.length_px(east_m), self.length_px(north_m)]
    }

    fn x_px(&self, east_m: f64) -> f64 {
        self.length_px(east_m - self.extent.east_m.0)
    }

    fn y_px(&self, north_m: f64) -> f64 {
        self.length_px(self.extent.north_m.1 - north_m)
    }

    /// Width and height of the frame on paper.
    pub(super) fn paper_px(&self) -> (f64, f64) {
        let (east_m, north_m) = self.extent.size_m();
        (self.length_px(east_m), self.length_px(north_m))
    }

    /// SVG picture of `content`, given in the frame's pixels, with axes in metres. `about` is the text alternative.
    pub(super) fn picture(&self, about: &str, axes: Axes, content: &Markup) -> Markup {
        let (left, bottom) = match axes {
            Axes::Named => (LEFT_PX, BOTTOM_PX),
            Axes::Unnamed => (LEFT_UNNAMED_PX, BOTTOM_UNNAMED_PX),
        };
        let (width, height) = self.paper_px();
        let (full_width, full_height) = (left + width + RIGHT_PX, TOP_PX + height + bottom);
        html! {
            svg role="img" aria-label=(about)
                viewBox={ "0 0 " (px(full_width)) " " (px(full_height)) }
                style={ "max-width:" (px(full_width)) "px" }
            {
                g transform={ "translate(" (left) " " (TOP_PX) ")" } {
                    rect.ground width=(px(width)) height=(px(height)) {}
                    (self.graticule())
                    svg width=(px(width)) height=(px(height)) { (content) }
                    @if axes == Axes::Named {
                        text.axis-name x=(px(width / 2.0)) y=(px(height + 42.0)) text-anchor="middle" {
                            "metres east of home"
                        }
                        text.axis-name transform={ "translate(-52 " (px(height / 2.0)) ") rotate(-90)" }
                            text-anchor="middle" { "metres north of home" }
                    }
                }
            }
        }
    }

    /// Grid lines at round distances from home, labelled in the margins.
    fn graticule(&self) -> Markup {
        let Extent { north_m, east_m } = self.extent;
        let (width, height) = self.paper_px();
        let easts = ticks(east_m.0, east_m.1, (width / 75.0).max(4.0));
        let norths = ticks(north_m.0, north_m.1, (height / 55.0).max(4.0));
        let (easts_digits, norths_digits) = (decimals(&easts), decimals(&norths));
        html! {
            @for east in easts {
                @let x = px(self.x_px(east));
                line.grid x1=(x) x2=(x) y1="0" y2=(px(height)) {}
                text.tick x=(x) y=(px(height + 20.0)) text-anchor="middle" { (figure(east, easts_digits)) }
            }
            @for north in norths {
                @let y = px(self.y_px(north));
                line.grid x1="0" x2=(px(width)) y1=(y) y2=(y) {}
                text.tick x="-8" y=(y) dy="0.35em" text-anchor="end" { (figure(north, norths_digits)) }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn north_is_up_and_both_axes_have_the_same_scale() {
        let extent = Extent::around([Ned::HOME, Ned::new(1000.0, 250.0, 0.0)]).unwrap();
        let frame = Frame::fit(extent, (500.0, 500.0));
        assert_eq!(frame.point_px(Ned::HOME), (0.0, 500.0));
        assert_eq!(frame.point_px(Ned::new(1000.0, 250.0, 0.0)), (125.0, 0.0));
    }

    #[test]
    fn single_place_gets_a_margin() {
        let extent = Extent::around([Ned::HOME])
            .unwrap()
            .with_margin(50.0, (0.6, 2.0));
        assert_eq!(extent.size_m(), (50.0, 50.0));
        assert_eq!(Extent::around([]), None);
        assert_eq!(Extent::around([Ned::new(f64::NAN, 0.0, 0.0)]), None);
    }

    #[test]
    fn thin_strip_gets_a_margin() {
        let strip = Extent::around([Ned::HOME, Ned::new(0.0, 32_000.0, 0.0)]).unwrap();
        let (east_m, north_m) = strip.with_margin(50.0, (0.6, 2.0)).size_m();
        assert!((east_m / north_m - 2.0).abs() < 1e-9);
    }
}
