//! A picture that moves: SVG with SMIL, which browsers play wherever a picture may stand, without scripts.

mod clock;
mod drawn;
mod keys;
mod time_line;

use maud::{Markup, PreEscaped, html};
use muster_machines::geometry::Ned;
use muster_runtime::text::plural;
use muster_scenarios::report::{Flight, Report};

use self::clock::Clock;
use self::drawn::DrawnDrone;
use crate::output::html::axis::px;

const WIDTH_PX: f64 = 880.0;
const MARGIN_PX: f64 = 56.0;
/// Height of the map, at least and at most.
const MAP_PX: (f64, f64) = (180.0, 340.0);
const TOP_PX: f64 = 62.0;
const BOTTOM_PX: f64 = 96.0;

/// Colours, in light and dark.
const STYLE: &str = include_str!("style.css");

/// The run, or its part around the first death, as an animated picture that starts again at its end.
pub(super) fn svg(report: &Report, flight: &Flight) -> String {
    let clock = Clock::of(report, flight);
    let drones = DrawnDrone::all(report, flight);
    let map = Map::around(&drones, flight, &clock);
    let height = TOP_PX + map.height_px + BOTTOM_PX;
    let name = format!("{}: {}", report.name(), plural(drones.len(), "drone"));
    html! {
        svg xmlns="http://www.w3.org/2000/svg" viewBox={ "0 0 " (WIDTH_PX) " " (px(height)) }
            width=(WIDTH_PX) height=(px(height)) role="img" aria-label=(name)
        {
            title { (name) }
            style { (PreEscaped(STYLE)) }
            rect.page width=(WIDTH_PX) height=(px(height)) rx="12" {}
            text.name x="24" y="30" { (name) }
            text.tick x=(WIDTH_PX - 24.0) y="29" text-anchor="end" {
                "diamond: leader · colour: who follows which leader · line: to the parent"
            }
            g transform={ "translate(0 " (TOP_PX) ")" } {
                (waypoints(&map, flight))
                @for drone in &drones { (drone.link(&map, &clock, &drones)) }
                @for drone in &drones { (drone.drone(&map, &clock)) }
            }
            (time_line::captions(flight, &clock))
            g transform={ "translate(0 " (px(TOP_PX + map.height_px + 30.0)) ")" } {
                (time_line::time_line(flight, &clock))
            }
        }
    }
    .into_string()
}

/// From places to the picture: north up.
struct Map {
    north_m: f64,
    west_m: f64,
    px_per_m: f64,
    left_px: f64,
    height_px: f64,
}

impl Map {
    /// Around what is seen of the drones while the clock runs, and the waypoints.
    fn around(drones: &[DrawnDrone<'_>], flight: &Flight, clock: &Clock) -> Self {
        let seen = drones.iter().flat_map(|drone| drone.places(clock));
        let waypoints = flight
            .swarms()
            .flat_map(|swarm| swarm.waypoints.iter().copied());
        let places: Vec<Ned> = seen.map(|(_, place)| place).chain(waypoints).collect();
        let bounds = |axis: fn(Ned) -> f64| {
            let values = || {
                places
                    .iter()
                    .map(|place| axis(*place))
                    .filter(|it| it.is_finite())
            };
            (
                values().fold(f64::MAX, f64::min),
                values().fold(f64::MIN, f64::max),
            )
        };
        let ((south_m, north_m), (west_m, east_m)) = if places.is_empty() {
            ((0.0, 1.0), (0.0, 1.0))
        } else {
            (bounds(Ned::north_m), bounds(Ned::east_m))
        };
        let (width_m, tall_m) = ((east_m - west_m).max(30.0), (north_m - south_m).max(30.0));
        let px_per_m = ((WIDTH_PX - 2.0 * MARGIN_PX) / width_m).min(MAP_PX.1 / tall_m);
        let height_px = (tall_m * px_per_m).max(MAP_PX.0);
        let spare_m = (height_px / px_per_m - (north_m - south_m)) / 2.0;
        Self {
            north_m: north_m + spare_m,
            west_m,
            px_per_m,
            left_px: (WIDTH_PX - (east_m - west_m) * px_per_m) / 2.0,
            height_px,
        }
    }

    fn point_px(&self, place: Ned) -> (f64, f64) {
        let x = self.left_px + (place.east_m() - self.west_m) * self.px_per_m;
        let y = (self.north_m - place.north_m()) * self.px_per_m;
        (px(x), px(y))
    }
}

fn waypoints(map: &Map, flight: &Flight) -> Markup {
    html! {
        @for swarm in flight.swarms() {
            @let points: Vec<_> = swarm.waypoints.iter().map(|it| map.point_px(*it)).collect();
            polyline.path points=(points.iter().map(|(x, y)| format!("{x},{y}")).collect::<Vec<_>>().join(" ")) {}
            @for (index, (x, y)) in points.iter().enumerate() {
                // A place that is visited again has one mark, with the last number.
                @let again = points.iter().skip(index + 1).any(|later| later == &(*x, *y));
                @if !again {
                    circle.waypoint cx=(x) cy=(y) r="3" {}
                    text.number x=(px(x + 13.0)) y=(px(y + 20.0)) { (index) }
                }
            }
        }
    }
}
