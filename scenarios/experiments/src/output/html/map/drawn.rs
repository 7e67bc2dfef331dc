//! Drawing of one drone on the map.

use std::cmp::Reverse;
use std::collections::BTreeMap;

use maud::{Markup, html};
use muster_machines::geometry::Ned;
use muster_machines::time::Timestamp;
use muster_runtime::text::figure_or_dash;
use muster_scenarios::report::{DroneReport, Flight, FlightOfDrone, History, Report};

use super::frame::Frame;
use super::{mark, track};
use crate::output::figures::{Kind, final_state};

/// Above this many drones, lines and marks are smaller.
const MANY: usize = 40;

/// A drone with what the map shows of it.
pub(super) struct DroneDrawing<'a> {
    pub(super) report: &'a DroneReport,
    pub(super) flight: &'a FlightOfDrone,
    /// Position when the master first reached a waypoint.
    pub(super) formed: Option<Ned>,
    /// Whether it led the swarm then.
    pub(super) led: bool,
    /// Size of its mark, in pixels.
    pub(super) size_px: f64,
}

/// An end of a track.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum End {
    /// Position before the flight.
    Start,
    /// Last position.
    Landing,
}

impl End {
    pub(super) const fn letter(self) -> &'static str {
        match self {
            Self::Start => "A",
            Self::Landing => "B",
        }
    }

    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Landing => "landing",
        }
    }

    pub(super) fn mark(self, point_px: (f64, f64), size_px: f64) -> Markup {
        match self {
            Self::Start => mark::start(point_px, size_px),
            Self::Landing => mark::landing(point_px, size_px),
        }
    }
}

/// The drone that most of the nodes `of` a swarm follow as their leader at a time; of several, the one with the lowest id.
/// `None` if nobody follows one.
fn leader_at(history: &History, at: Timestamp, of: impl Fn(u32) -> bool) -> Option<u32> {
    let mut followers: BTreeMap<u32, usize> = BTreeMap::new();
    let nodes = history.nodes.iter().filter(|node| of(node.id));
    for epoch in nodes.filter_map(|node| node.epoch_at(at)) {
        *followers.entry(history.epochs[epoch].master).or_default() += 1;
    }
    let most = followers
        .into_iter()
        .max_by_key(|&(id, number)| (number, Reverse(id)));
    most.map(|(id, _)| id)
}

impl<'a> DroneDrawing<'a> {
    /// All drones of a swarm; the master is last, so that it is drawn on top.
    pub(super) fn swarm(report: &'a Report, flight: &'a Flight) -> Vec<Self> {
        let pairs = || report.drones.iter().zip(&flight.drones);
        let masters = pairs().filter(|(drone, _)| Kind::of(drone) == Kind::Master);
        let formed_at = masters
            .chain(pairs())
            .find_map(|(_, drone)| drone.first_waypoint_at());
        let leader = formed_at.and_then(|at| {
            leader_at(&flight.history, at, |id| {
                report.drones.iter().any(|it| it.id == id)
            })
        });
        let size_px = if report.drones.len() > MANY { 5.0 } else { 9.0 };
        let mut swarm: Vec<_> = pairs()
            .map(|(report, flight)| {
                let formed = formed_at.and_then(|at| flight.position_at(at));
                let led = match leader {
                    Some(leader) => report.id == leader,
                    None => Kind::of(report) == Kind::Master,
                };
                Self {
                    report,
                    flight,
                    formed,
                    led,
                    size_px,
                }
            })
            .collect();
        swarm.sort_by_key(|drone| Kind::of(drone.report) == Kind::Master);
        swarm
    }

    /// First or last position of its track.
    pub(super) fn end(&self, end: End) -> Option<Ned> {
        let point = match end {
            End::Start => self.flight.track.first(),
            End::Landing => self.flight.track.last(),
        };
        point.map(|&(_, place)| place)
    }

    /// Its track, and its mark in the formation.
    pub(super) fn track(&self, frame: &Frame) -> Markup {
        let track = self
            .flight
            .track
            .iter()
            .map(|&(_, place)| frame.point_px(place));
        let points: Vec<_> = track.collect();
        let kind = Kind::of(self.report);
        html! {
            g.drone.{ "k-" (kind.name()) }.many[self.size_px < 9.0] {
                title { (self.about()) }
                path.track d=(track::path(&points, frame.paper_px())) {}
                @if let Some(place) = self.formed {
                    (mark::drone(kind, frame.point_px(place), self.size_px))
                }
            }
        }
    }

    /// Mark at an end of its track.
    pub(super) fn end_mark(&self, frame: &Frame, end: End) -> Markup {
        html! {
            @if let Some(place) = self.end(end) {
                g.{ "k-" (Kind::of(self.report).name()) } {
                    title { (self.about()) }
                    (end.mark(frame.point_px(place), self.size_px))
                }
            }
        }
    }

    /// Tooltip.
    fn about(&self) -> String {
        let drone = self.report;
        let kind = Kind::of(drone).name();
        let route = match (Kind::of(drone), drone.hops) {
            (Kind::Master, _) => String::new(),
            (_, None) => ", no route to the master".to_owned(),
            (_, Some(1)) => ", 1 hop to the master".to_owned(),
            (_, Some(hops)) => format!(", {hops} hops to the master"),
        };
        let flown = figure_or_dash(drone.flight_time_s, 1);
        format!(
            "drone {} ({kind}{route}): flight time {flown} s, {}",
            drone.id,
            final_state(drone)
        )
    }
}
