//! Traffic near a drone: announced intents and right of way.
//!
//! No drone starts a path that comes too near to an announced one. Two drones that start at the same moment don't know
//! of each other yet; once they do, one of them stops. Both compute the same right of way: a stationary drone goes
//! first, then one that flies vertically, then the lower number. Before all goes a drone that may not hear this one,
//! because it can't give way. A drone blocked by a stationary one flies a detour.

mod intent;
mod occupied;

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};
use std::sync::Arc;
use std::time::Duration;

use nalgebra::{Rotation2, Vector2};

use self::intent::{GROUND_ALTITUDE_M, ROUNDING_M, VERTICAL_M};
use self::occupied::{OccupiedSpace, Precedence};
use crate::formation::{Path, Separation};
use crate::geometry::Ned;
use crate::identity::{NodeId, NodeSet};
use crate::time::Timestamp;
pub use crate::wire::Intent;

/// Largest age of an intent when it arrives: a radio passes on an unchanged intent once a second.
const INTENT_AGE_MAX: Duration = Duration::from_secs(1);
/// Time beyond that of the flight after which a silent drone out of radio range is assumed to be at the end of its path.
const ARRIVED_AFTER: Duration = Duration::from_secs(5);
/// Time beyond that of the flight for which a silent drone is assumed to be at the end of its path.
const FORGET_AFTER: Duration = Duration::from_secs(30);
/// Share of the distance of the farthest drone that is heard, up to which all are heard: at the edge of its range a radio
/// hears some drones and not others.
const SURELY_HEARD: f64 = 0.9;
/// Largest difference of the displacements of two parallel paths, in metres.
const PARALLEL_M: f64 = 1.0;
/// Distances of detour points, as multiples of the horizontal separation.
const DETOUR_DISTANCES: [f64; 2] = [2.2, 4.4];
/// Bearings of detour points, clockwise from the path's own, in radians: ahead first.
const DETOUR_BEARINGS_RAD: [f64; 8] = [
    FRAC_PI_4,
    -FRAC_PI_4,
    FRAC_PI_2,
    -FRAC_PI_2,
    3.0 * FRAC_PI_4,
    -3.0 * FRAC_PI_4,
    PI,
    0.0,
];
/// Configuration of deconfliction.
#[derive(Debug, Clone, PartialEq)]
pub struct Config {
    /// Minimum separation.
    pub separation: Separation,
    /// Time without a frame after which a drone is silent.
    pub time_to_live: Duration,
    /// Time without a command after which a flight controller lands.
    pub controller_timeout: Duration,
    /// Descent rate of that landing, in m/s.
    pub descent_mps: f64,
    /// Ground speed of a leg, in m/s.
    pub speed_mps: f64,
    /// Climb rate, in m/s.
    pub climb_mps: f64,
    /// Additional time for the last metres.
    pub touch_down_margin: Duration,
    /// Whether drones follow a moving master, which flies among them.
    pub has_followers: bool,
    /// Where drones land as planned, by number. `None` if that is not planned.
    pub landing_places: Option<Arc<[Ned]>>,
}

impl Config {
    /// Whether a drone other than `own` lands too near to this place as planned.
    fn is_landing_place_of_another(&self, own: NodeId, place: Ned) -> bool {
        let near_m = self.separation.horizontal_m;
        let planned = self.landing_places.iter().flat_map(|it| it.iter());
        let mut others = (0..).map(NodeId).zip(planned).filter(|(id, _)| *id != own);
        others.any(|(_, it)| it.horizontal_distance_m(place) < near_m)
    }

    /// Age of the last intent at which a drone counts as silent.
    fn silent_after(&self) -> Duration {
        self.time_to_live + INTENT_AGE_MAX
    }

    /// Time of the flight on a path, without its start and end.
    fn flight_time(&self, path: Path) -> Duration {
        let over_ground_s = path.from.horizontal_distance_m(path.to) / self.speed_mps;
        let vertical_mps = self.climb_mps.min(self.descent_mps);
        let vertical_s = path.from.vertical_distance_m(path.to) / vertical_mps;
        Duration::try_from_secs_f64(over_ground_s.max(vertical_s)).unwrap_or(Duration::MAX)
    }

    /// Age of the last intent at which a drone without a process is on the ground, from this altitude in metres.
    fn down_after(&self, altitude_m: f64) -> Duration {
        let descent = Duration::from_secs_f64(altitude_m.max(0.0) / self.descent_mps);
        self.silent_after() + self.controller_timeout + descent + self.touch_down_margin
    }
}

/// What a drone announced last.
#[derive(Debug)]
struct Announced {
    intent: Intent,
    /// Space that it occupies while it is heard.
    space: OccupiedSpace,
    /// Whether it lands.
    lands: bool,
    at: Timestamp,
}

/// Intents of the drones near a drone.
#[derive(Debug)]
pub(crate) struct Traffic {
    own: NodeId,
    config: Config,
    /// Since when it flies in lockstep with the others; `None` if it does not.
    in_lockstep_since: Option<Timestamp>,
    others: BTreeMap<NodeId, Announced>,
    /// Drones that are heard, and that may not hear this one.
    deaf: NodeSet,
}

impl Traffic {
    pub(crate) const fn new(own: NodeId, config: Config) -> Self {
        Self {
            own,
            config,
            in_lockstep_since: None,
            others: BTreeMap::new(),
            deaf: NodeSet::new(),
        }
    }

    /// Sets which drones may not hear this one.
    pub(crate) fn set_deaf(&mut self, deaf: NodeSet) {
        self.deaf = deaf;
    }

    /// Sets whether the drone flies in lockstep with the others from now on.
    pub(crate) fn set_in_lockstep(&mut self, now: Timestamp, in_lockstep: bool) {
        self.in_lockstep_since = in_lockstep.then_some(now);
    }

    /// Whether drones follow a moving master.
    pub(crate) const fn has_followers(&self) -> bool {
        self.config.has_followers
    }

    /// Whether a drone that was heard last at `at` is silent.
    fn is_silent(&self, now: Timestamp, at: Timestamp) -> bool {
        now.since(at) > self.config.silent_after()
    }

    /// Updates or removes the intent of another drone, heard at `at`; returns whether it changed.
    pub(crate) fn update(&mut self, at: Timestamp, id: NodeId, intent: Option<Intent>) -> bool {
        let Some(intent) = intent else {
            return self.others.remove(&id).is_some();
        };
        let announced = Announced {
            intent,
            space: OccupiedSpace::of(intent),
            lands: intent.lands(),
            at,
        };
        let before = self.others.insert(id, announced);
        before.is_none_or(|before| before.intent != intent)
    }

    /// Whether a path may be started: no other drone is near it or on a path that comes near it.
    pub(crate) fn is_clear(&self, now: Timestamp, path: Path) -> bool {
        self.blocking(now, path, path).next().is_none()
    }

    /// Whether to give way to another drone on the remaining part of a path.
    pub(crate) fn must_give_way(&self, now: Timestamp, remaining: Path, whole: Path) -> bool {
        let own = (Precedence::of(whole), self.own);
        let mut blocking = self.blocking(now, remaining, whole);
        blocking.any(|(id, other)| !self.may_hear(now, id) || (other.precedence, id) < own)
    }

    /// Whether another drone may hear this one: it is heard itself, and is not known to be deaf.
    fn may_hear(&self, now: Timestamp, id: NodeId) -> bool {
        let other = self.others.get(&id);
        other.is_some_and(|it| !self.is_silent(now, it.at)) && !self.deaf.contains(id)
    }

    /// A place beside a landing column, at the same altitude, if the path to it and the column below it are clear; if possible
    /// none where another lands as planned, which may not be heard. None is needed if others only pass through the column:
    /// there a drone might land where another is to.
    pub(crate) fn landing_detour(
        &self,
        now: Timestamp,
        column: Path,
        may_fly_to: impl Fn(Ned) -> bool,
    ) -> Option<Ned> {
        let mut near = (self.occupied(now, column.from)).filter(|(_, it)| self.is_near(it, column));
        if near.all(|(_, it)| it.precedence == Precedence::Leg) {
            return None;
        }
        let is_free = |side: &Ned| {
            if !may_fly_to(*side) {
                return false;
            }
            let across = Path {
                from: column.from,
                to: *side,
            };
            let down = Path {
                from: *side,
                to: side.at_altitude(0.0),
            };
            // A drone that is already near does not block the path there, but it blocks a descent.
            self.is_clear(now, across)
                && (self.occupied(now, column.from)).all(|(_, it)| !self.is_near(&it, down))
        };
        let sides = || {
            self.detour_points(column.from, Vector2::x())
                .filter(is_free)
        };
        let is_planned = |side: &Ned| self.config.is_landing_place_of_another(self.own, *side);
        sides()
            .find(|it| !is_planned(it))
            .or_else(|| sides().next())
    }

    /// A place beside this one, if another drone may come down here, and the path there and the place are clear. On the
    /// ground there is none.
    pub(crate) fn room_beside(
        &self,
        now: Timestamp,
        here: Ned,
        may_fly_to: impl Fn(Ned) -> bool,
    ) -> Option<Ned> {
        if !self.is_below_another(now, here) {
            return None;
        }
        self.detour_points(here, Vector2::x()).find(|side| {
            let is_free = |space: &OccupiedSpace| !self.is_near(space, Path::stationary(*side));
            may_fly_to(*side)
                && self.is_clear(now, Path::new(here, *side))
                && self.occupied(now, here).all(|(_, it)| is_free(&it))
        })
    }

    /// Whether another drone may come down on one that is here. On the ground none does.
    pub(crate) fn is_below_another(&self, now: Timestamp, here: Ned) -> bool {
        // One that is heard and doesn't land stays up. That is nearly always so, and this is asked with each telemetry.
        let mut others = self.others.values();
        let all_stay_up = others.all(|it| !it.lands && !self.is_silent(now, it.at));
        if all_stay_up || here.altitude_m() < GROUND_ALTITUDE_M {
            return false;
        }
        self.occupied(now, here).any(|(id, space)| {
            self.comes_down(id, &space) && self.is_near(&space, Path::stationary(here))
        })
    }

    /// Whether a drone lands, or is silent and its aircraft may.
    fn comes_down(&self, id: NodeId, space: &OccupiedSpace) -> bool {
        let lands = space.precedence == Precedence::Priority && self.others[&id].lands;
        lands || space.may_descend && !self.deaf.contains(id)
    }

    /// Whether drone `id` would come down here if it fell silent now.
    pub(crate) fn is_above(&self, id: NodeId, here: Ned) -> bool {
        self.others.get(&id).is_some_and(|other| {
            let space = OccupiedSpace {
                may_descend: true,
                ..other.space
            };
            self.is_near(&space, Path::stationary(here))
        })
    }

    /// Whether any drone would come down here if it fell silent now.
    pub(crate) fn is_any_above(&self, here: Ned) -> bool {
        self.others.keys().any(|id| self.is_above(*id, here))
    }

    /// Candidate points for a detour, nearest and ahead first.
    fn detour_points(&self, from: Ned, ahead: Vector2<f64>) -> impl Iterator<Item = Ned> {
        let horizontal_m = self.config.separation.horizontal_m;
        DETOUR_DISTANCES.iter().flat_map(move |distance| {
            DETOUR_BEARINGS_RAD.iter().map(move |bearing_rad| {
                let offset = Rotation2::new(*bearing_rad) * ahead * (distance * horizontal_m);
                from + Ned::new(offset.x, offset.y, 0.0)
            })
        })
    }

    /// Two corners of a detour, if all blocking drones are stationary and a clear detour exists: aside at the start
    /// altitude, then vertically to the end altitude, then straight on.
    pub(crate) fn detour(
        &self,
        now: Timestamp,
        path: Path,
        may_fly_to: impl Fn(Ned) -> bool,
    ) -> Option<[Ned; 2]> {
        let mut blocking = self.blocking(now, path, path);
        if blocking.any(|(_, other)| other.precedence != Precedence::Stationary) {
            return None;
        }
        let ahead = (path.to - path.from).0.xy();
        let ahead = ahead.try_normalize(VERTICAL_M).unwrap_or_else(Vector2::x);
        let detour_points = self.detour_points(path.from, ahead);
        let mut detours = detour_points.map(|side| [side, side.at_altitude(path.to.altitude_m())]);
        detours.find(|[side, level]| {
            let legs = [(path.from, *side), (*side, *level), (*level, path.to)];
            let mut legs = legs.into_iter().map(|(from, to)| Path { from, to });
            may_fly_to(*side) && may_fly_to(*level) && legs.all(|leg| self.is_clear(now, leg))
        })
    }

    /// Drones too near the remaining path, or on a path that comes too near it.
    ///
    /// Excludes drones on parallel paths, which keep their distance. Excludes drones too near the start, because
    /// waiting there does not help, but for a landing drone above a climb. A drone that flies past is excluded only if it is too near despite rounding, one that
    /// brakes only if it comes to rest there.
    fn blocking(
        &self,
        now: Timestamp,
        remaining: Path,
        whole: Path,
    ) -> impl Iterator<Item = (NodeId, OccupiedSpace)> {
        let here = Path::stationary(remaining.from);
        self.occupied(now, remaining.from)
            .filter(move |(id, space)| {
                // Few are near, which is cheap to tell.
                if !self.is_near(space, remaining) {
                    return false;
                }
                let other = &self.others[id];
                let is_parallel = space.precedence == Precedence::Leg && {
                    let path = other.intent.path();
                    let difference_m = ((whole.to - whole.from).0 - (path.to - path.from).0).norm();
                    difference_m < PARALLEL_M
                };
                let is_in_lockstep = self.in_lockstep_since.is_some()
                    && self.config.has_followers
                    && other.intent.is_following();
                let is_near_here = match space.precedence {
                    Precedence::Priority if climbs_into(remaining, other) => false,
                    Precedence::Leg => space.is_near(here, self.separation_plus(-ROUNDING_M)),
                    Precedence::Priority if self.brakes(*id) => {
                        self.is_near(&OccupiedSpace::at(space.path.to), here)
                    }
                    _ => self.is_near(space, here),
                };
                !is_parallel && !is_in_lockstep && !is_near_here
            })
    }

    /// Whether a drone with priority brakes: it neither lands nor follows a master.
    fn brakes(&self, id: NodeId) -> bool {
        !self.config.has_followers && !self.others[&id].lands
    }

    fn is_near(&self, space: &OccupiedSpace, path: Path) -> bool {
        space.is_near(path, self.separation_plus(ROUNDING_M))
    }

    /// The separation plus some metres.
    fn separation_plus(&self, metres: f64) -> Separation {
        let Separation {
            horizontal_m,
            vertical_m,
        } = self.config.separation;
        Separation {
            horizontal_m: horizontal_m + metres,
            vertical_m: vertical_m + metres,
        }
    }

    /// Space that others may occupy, as seen from `here`.
    fn occupied(&self, now: Timestamp, here: Ned) -> impl Iterator<Item = (NodeId, OccupiedSpace)> {
        let apart_m = move |other: &Announced| here.distance_m(other.space.path.from);
        let is_heard = move |other: &&Announced| !self.is_silent(now, other.at);
        let others = || self.others.values();
        // Asked for only if one is silent, which is seldom.
        let reach_m = if others().all(|it| is_heard(&it)) {
            f64::INFINITY
        } else {
            others().filter(is_heard).map(apart_m).fold(0.0, f64::max)
        };
        self.others.iter().filter_map(move |(id, other)| {
            let space = if is_heard(&other) {
                Some(OccupiedSpace {
                    may_descend: self.deaf.contains(*id),
                    ..other.space
                })
            } else {
                let is_in_reach = apart_m(other) <= reach_m * SURELY_HEARD;
                let intent = self.where_ordered(other);
                self.space_of_silent(now.since(other.at), intent, is_in_reach)
            };
            Some((*id, space?))
        })
    }

    /// The intent of a silent drone, or its arrival, if an order to fly in lockstep came while it was silent: the master
    /// gives such an order when all have arrived.
    fn where_ordered(&self, other: &Announced) -> Intent {
        let silent_from = other.at + self.config.silent_after();
        let has_arrived = self.in_lockstep_since.is_some_and(|it| silent_from <= it);
        if has_arrived && !other.lands {
            other.intent.arrived()
        } else {
            other.intent
        }
    }

    /// Space that a drone may occupy that announced this and has been silent since.
    ///
    /// If another drone at least as far away is heard, the silent drone presumably has no process: its aircraft
    /// descends somewhere on its remaining path. Otherwise it may have flown on, out of range. Once it is down or at
    /// the end of its path, that end is kept clear for a while. A drone that announced a landing stays at the end for
    /// good.
    fn space_of_silent(
        &self,
        silent: Duration,
        intent: Intent,
        is_in_reach: bool,
    ) -> Option<OccupiedSpace> {
        let remaining = intent.remaining();
        let highest_m = remaining.from.altitude_m().max(remaining.to.altitude_m());
        let is_descending = silent <= self.config.down_after(highest_m);
        if intent.lands() {
            Some(if is_descending {
                OccupiedSpace::of(intent)
            } else {
                OccupiedSpace::at(remaining.to)
            })
        } else if is_in_reach && is_descending {
            Some(OccupiedSpace {
                path: remaining,
                may_descend: true,
                precedence: Precedence::Stationary,
            })
        } else {
            let after_flight = silent.saturating_sub(self.config.flight_time(remaining));
            if !is_in_reach && after_flight <= ARRIVED_AFTER {
                Some(OccupiedSpace::of(intent))
            } else {
                (after_flight <= FORGET_AFTER).then(|| OccupiedSpace::at(remaining.to))
            }
        }
    }
}

/// Whether a path climbs towards a drone that lands. One that is too near may be left in any other direction.
fn climbs_into(path: Path, other: &Announced) -> bool {
    let altitude_m = path.from.altitude_m();
    let is_climb = intent::is_vertical(path) && path.to.altitude_m() > altitude_m;
    is_climb && other.lands && other.intent.remaining().from.altitude_m() > altitude_m
}

#[cfg(test)]
mod tests;
