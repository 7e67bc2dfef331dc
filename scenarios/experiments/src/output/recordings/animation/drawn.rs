//! Drones and the links to their parents.

use std::collections::BTreeSet;

use maud::{Markup, html};
use muster_machines::geometry::Ned;
use muster_machines::time::Timestamp;
use muster_scenarios::report::{Condition, Epoch, Flight, FlightOfDrone, NodeHistory, Report};

use super::Map;
use super::clock::Clock;
use super::keys::{Keys, duration, jumping, moving, moving_place};
use crate::output::simplify::simplified;

/// Seconds of the picture that the ring around a drone that dies takes.
const RIPPLE_S: f64 = 1.4;

/// A drone of any swarm.
pub(super) struct DrawnDrone<'a> {
    id: u32,
    flown: &'a FlightOfDrone,
    history: &'a NodeHistory,
    epochs: &'a [Epoch],
    first_epoch: usize,
}

impl<'a> DrawnDrone<'a> {
    pub(super) fn all(report: &'a Report, flight: &'a Flight) -> Vec<Self> {
        let mut first_epoch = 0;
        let mut drones = Vec::new();
        for (report, flight) in report.swarms().zip(flight.swarms()) {
            let history = &flight.history;
            let pairs = report.drones.iter().zip(&flight.drones);
            drones.extend(pairs.filter_map(|(report, flown)| {
                Some(DrawnDrone {
                    id: report.id,
                    flown,
                    history: history.nodes.iter().find(|node| node.id == report.id)?,
                    epochs: &history.epochs,
                    first_epoch,
                })
            }));
            first_epoch += history.epochs.len();
        }
        drones
    }

    /// Its places while the clock runs, with times in seconds of the flight.
    pub(super) fn places(&self, clock: &Clock) -> Vec<(f64, Ned)> {
        let points = simplified(&self.flown.track);
        let times = points.iter().map(|(at, _)| at.as_secs_f64());
        let mut times: Vec<f64> = times
            .filter(|at_s| clock.shows(*at_s))
            .chain(clock.knots_s())
            .collect();
        times.sort_by(f64::total_cmp);
        times.dedup();
        let place = |at_s: f64| self.flown.position_at(Timestamp::from_secs_f64(at_s));
        times
            .into_iter()
            .filter_map(|at_s| Some((at_s, place(at_s)?)))
            .collect()
    }

    /// Times at which something about it changes while the clock runs, in seconds, the first included.
    fn changes_s(&self, clock: &Clock) -> Vec<f64> {
        let history = self.history;
        let epochs = history.epochs.iter().map(|(at, _)| *at);
        let conditions = history.conditions.iter().map(|(at, _)| *at);
        let routes = history.routes.iter().map(|(at, _)| *at);
        let landed = history.airborne.and_then(|(_, to)| to);
        let times = epochs.chain(conditions).chain(routes).chain(landed);
        let times = times.map(Timestamp::as_secs_f64);
        let (from_s, _) = clock.span_s();
        let mut times: Vec<f64> = times
            .filter(|at_s| clock.shows(*at_s))
            .chain([from_s])
            .collect();
        times.sort_by(f64::total_cmp);
        times.dedup();
        times
    }

    fn is_dead(&self, at: Timestamp) -> bool {
        !matches!(
            self.history.condition_at(at),
            Condition::Runs | Condition::Hangs
        )
    }

    fn has_landed(&self, at: Timestamp) -> bool {
        let landed = self.history.airborne.and_then(|(_, to)| to);
        landed.is_some_and(|landed| landed <= at)
    }

    fn epoch(&self, at: Timestamp) -> Option<usize> {
        self.history.epoch_at(at)
    }

    fn leads(&self, at: Timestamp) -> bool {
        let epoch = self.epoch(at).map(|index| self.epochs[index]);
        epoch.is_some_and(|epoch| epoch.master == self.id)
            && !self.is_dead(at)
            && !self.has_landed(at)
    }

    /// The class that gives its colour.
    fn colour(&self, at: Timestamp) -> String {
        match self.epoch(at) {
            Some(index) if !self.has_landed(at) => format!("e{}", (self.first_epoch + index) % 8),
            _ => "no-leader".to_owned(),
        }
    }

    /// All colours that it has while the clock runs.
    fn colours(&self, clock: &Clock) -> BTreeSet<String> {
        let changes = self.changes_s(clock).into_iter();
        changes
            .map(|at_s| self.colour(Timestamp::from_secs_f64(at_s)))
            .collect()
    }

    /// A value of each change, by the share of the picture.
    fn keys(&self, clock: &Clock, value: impl Fn(Timestamp) -> String) -> Keys {
        let changes = self.changes_s(clock).into_iter();
        let mut keys: Keys = changes
            .map(|at_s| (clock.share(at_s), value(Timestamp::from_secs_f64(at_s))))
            .collect();
        if let Some(first) = keys.first_mut() {
            first.0 = 0.0;
        }
        keys
    }

    /// Its mark: disc, diamond while it leads, cross once it is dead.
    pub(super) fn drone(&self, map: &Map, clock: &Clock) -> Markup {
        let places = self.places(clock).into_iter();
        let places: Vec<_> = places
            .map(|(at_s, place)| (clock.share(at_s), map.point_px(place)))
            .collect();
        let Some(&(_, (x, y))) = places.last() else {
            return html! {};
        };
        let shown = |is: bool| if is { "1" } else { "0" }.to_owned();
        let end = Timestamp::from_secs_f64(clock.span_s().1);
        let is_disc = |at| !self.leads(at) && !self.is_dead(at);
        html! {
            g transform={ "translate(" (x) " " (y) ")" } {
                (moving_place(clock, &places))
                (self.ripples(clock))
                // One shape for each colour, for no browser need animate classes.
                @for colour in self.colours(clock) {
                    @let disc = |at| shown(is_disc(at) && self.colour(at) == colour);
                    circle.shape.(colour) r="8" opacity=(disc(end)) { (jumping(clock, "opacity", self.keys(clock, disc))) }
                    @let diamond = |at| shown(self.leads(at) && self.colour(at) == colour);
                    @if self.keys(clock, diamond).iter().any(|(_, is)| is == "1") {
                        path.shape.(colour) d="M0 -14L14 0L0 14L-14 0Z" opacity=(diamond(end)) {
                            (jumping(clock, "opacity", self.keys(clock, diamond)))
                        }
                    }
                }
                path.cross d="M-11 0a11 11 0 1 0 22 0a11 11 0 1 0 -22 0M-5 -5L5 5M5 -5L-5 5" opacity=(shown(self.is_dead(end))) {
                    (jumping(clock, "opacity", self.keys(clock, |at| shown(self.is_dead(at)))))
                }
                text.id y="-20" { (self.id) }
            }
        }
    }

    /// Rings that grow around it when it dies.
    fn ripples(&self, clock: &Clock) -> Markup {
        let changes = self.history.conditions.iter();
        let deaths = changes.filter(|(at, _)| self.is_dead(*at) && clock.shows(at.as_secs_f64()));
        html! {
            @for (at, _) in deaths {
                @let from = clock.share(at.as_secs_f64());
                @let to = (from + clock.share_of_played(RIPPLE_S)).min(1.0);
                @let times = format!("0;{from:.5};{from:.5};{to:.5};1");
                circle.ripple r="0" opacity="0" {
                    animate attributeName="r" dur=(duration(clock)) repeatCount="indefinite"
                        keyTimes=(times) values="0;0;12;52;52" {}
                    animate attributeName="opacity" dur=(duration(clock)) repeatCount="indefinite"
                        keyTimes=(times) values="0;0;1;0;0" {}
                }
            }
        }
    }

    /// Its parent, if it takes part in the swarm.
    fn parent<'b>(
        &self,
        at: Timestamp,
        drones: &'b [DrawnDrone<'a>],
    ) -> Option<&'b DrawnDrone<'a>> {
        if self.is_dead(at) || self.has_landed(at) || self.leads(at) {
            return None;
        }
        let parent = NodeHistory::at(&self.history.routes, at)?.parent?;
        drones.iter().find(|drone| drone.id == parent)
    }

    /// The link to its parent.
    pub(super) fn link(&self, map: &Map, clock: &Clock, drones: &[DrawnDrone<'a>]) -> Markup {
        let mut ends = Keys4::default();
        let mut shown: Keys = Vec::new();
        let (_, end_s) = clock.span_s();
        let changes_s = self.changes_s(clock);
        let untils_s = changes_s.iter().copied().skip(1).chain([end_s]);
        for (from_s, until_s) in changes_s.iter().copied().zip(untils_s) {
            let parent = self.parent(Timestamp::from_secs_f64(from_s), drones);
            let share = if shown.is_empty() {
                0.0
            } else {
                clock.share(from_s)
            };
            shown.push((share, if parent.is_some() { "1" } else { "0" }.to_owned()));
            let Some(parent) = parent else {
                continue;
            };
            let places = self.places(clock).into_iter().chain(parent.places(clock));
            let times = places
                .map(|(at_s, _)| at_s)
                .filter(|at_s| (from_s..=until_s).contains(at_s));
            let mut times: Vec<f64> = times.chain([from_s, until_s]).collect();
            times.sort_by(f64::total_cmp);
            times.dedup();
            for at_s in times {
                let at = Timestamp::from_secs_f64(at_s);
                if let Some((from, to)) =
                    self.flown.position_at(at).zip(parent.flown.position_at(at))
                {
                    ends.push(clock.share(at_s), map.point_px(from), map.point_px(to));
                }
            }
        }
        if ends.0[0].is_empty() {
            return html! {};
        }
        html! {
            line.link opacity="0" {
                (jumping(clock, "opacity", shown))
                @for (attribute, keys) in ["x1", "y1", "x2", "y2"].into_iter().zip(ends.0) {
                    (moving(clock, attribute, keys))
                }
            }
        }
    }
}

/// The two ends of a line over time: x1, y1, x2, y2.
#[derive(Default)]
struct Keys4([Keys; 4]);

impl Keys4 {
    fn push(&mut self, share: f64, from: (f64, f64), to: (f64, f64)) {
        for (keys, value) in self.0.iter_mut().zip([from.0, from.1, to.0, to.1]) {
            if keys.is_empty() {
                // Nothing is seen before.
                keys.push((0.0, value.to_string()));
            }
            keys.push((share, value.to_string()));
        }
    }
}
