//! Maps as SVG.

use std::fmt::Write as _;

use maud::{Markup, html};
use muster_indoor::coverage::TARGET_M;
use muster_indoor::frames::MapXy;
use muster_indoor::map::{Cell, Map, State};

/// Width of a drawing, in its own units; the page scales it.
const WIDTH: f64 = 1_000.0;

/// A map on which things are drawn.
pub(super) struct Drawing<'a> {
    map: &'a Map,
    /// Units a metre.
    scale: f64,
    height: f64,
}

impl<'a> Drawing<'a> {
    pub(super) fn new(map: &'a Map) -> Self {
        let metres = |cells: usize| cells as f64 * map.resolution_m();
        let scale = WIDTH / metres(map.columns());
        Self {
            map,
            scale,
            height: scale * metres(map.rows()),
        }
    }

    /// The map with `content` over it.
    pub(super) fn svg(&self, content: &Markup) -> Markup {
        let bar = 0.5 * self.scale.min(WIDTH / 4.0) * 2.0;
        html! {
            div.scroll {
                svg.floor viewBox=(format!("0 0 {WIDTH} {:.0}", self.height + 30.0)) role="img" {
                    path.wall d=(self.walls()) {}
                    (content)
                    path.scale d=(format!("M4 {y:.1} h{bar:.1}", y = self.height + 12.0)) {}
                    text x=(format!("{:.1}", bar + 10.0)) y=(format!("{:.1}", self.height + 17.0)) { "1 m" }
                }
            }
        }
    }

    /// All cells that are not free, as runs of rows.
    fn walls(&self) -> String {
        let cell = self.scale * self.map.resolution_m();
        let mut d = String::new();
        for row in 0..self.map.rows() {
            let is_wall = |column: usize| {
                column < self.map.columns() && self.map.state(Cell { column, row }) != State::Free
            };
            let y = self.height - (row + 1) as f64 * cell;
            let mut column = 0;
            while column < self.map.columns() {
                let from = column;
                while is_wall(column) {
                    column += 1;
                }
                if column > from {
                    let (x, width) = (from as f64 * cell, (column - from) as f64 * cell);
                    let _ = write!(d, "M{x:.1} {y:.1}h{width:.1}v{cell:.2}h-{width:.1}z");
                }
                column += 1;
            }
        }
        d
    }

    fn at(&self, point: MapXy) -> (f64, f64) {
        let local = self.map.origin().sight(point);
        (local.x_m * self.scale, self.height - local.y_m * self.scale)
    }

    pub(super) fn line(&self, points: &[MapXy], class: &str) -> Markup {
        let mut d = String::new();
        for (index, point) in points.iter().enumerate() {
            let (x, y) = self.at(*point);
            let _ = write!(d, "{}{x:.1} {y:.1}", if index == 0 { 'M' } else { 'L' });
        }
        html! { path.line.(class) d=(d) {} }
    }

    pub(super) fn dot(&self, at: MapXy, radius: f64, class: &str) -> Markup {
        let (x, y) = self.at(at);
        html! { circle.dot.(class) cx=(format!("{x:.1}")) cy=(format!("{y:.1}")) r=(radius) {} }
    }

    /// Begin and end of a path.
    pub(super) fn ends(&self, path: &[MapXy]) -> Markup {
        html! {
            @if let Some(first) = path.first() { (self.label(*first, "start")) }
            @if let Some(last) = path.last() { (self.label(*last, "end")) }
        }
    }

    fn label(&self, at: MapXy, text: &str) -> Markup {
        let (x, y) = self.at(at);
        html! {
            (self.dot(at, 6.0, "end"))
            text.halo x=(format!("{:.1}", x + 10.0)) y=(format!("{:.1}", y - 8.0)) { (text) }
        }
    }

    /// A numbered stop of a drone.
    pub(super) fn stop(&self, at: MapXy, number: usize, colour: usize) -> Markup {
        let (x, y) = self.at(at);
        html! {
            (self.dot(at, 11.0, &format!("stop s{colour}")))
            text.number x=(format!("{x:.1}")) y=(format!("{:.1}", y + 4.0)) { (number) }
        }
    }

    /// Targets as squares.
    pub(super) fn squares(&self, centres: impl Iterator<Item = MapXy>, class: &str) -> Markup {
        let edge = self.scale * TARGET_M;
        let mut d = String::new();
        for centre in centres {
            let (x, y) = self.at(centre);
            let (x, y) = (x - edge / 2.0, y - edge / 2.0);
            let _ = write!(d, "M{x:.1} {y:.1}h{edge:.1}v{edge:.1}h-{edge:.1}z");
        }
        html! { path.(class) d=(d) {} }
    }
}
