//! Which stop is next, the path there, and what to do when it is blocked.

use std::collections::VecDeque;
use std::time::Duration;

use muster_machines::time::Timestamp;

use super::config::Config;
use super::legs::{along, length_from, point_at};
use super::place::Place;
use crate::coverage::Seen;
use crate::frames::{MapPose, MapXy};
use crate::path::{Floor, Found, Obstacles, Search};

/// Cells that a step's search expands at most: below a millisecond.
const CELLS_A_STEP: usize = 4_000;
/// A stop is reached within this distance, in metres.
const ARRIVED_M: f64 = 0.2;
/// Distance along the path of the point that is flown to, in metres.
const AHEAD_M: f64 = 0.7;
/// The same where the straight line there leads too near to a wall: shorter by steps, in metres.
const AHEAD_STEP_M: f64 = 0.1;
const AHEAD_STEPS: u32 = 5;
/// A drone that gets no nearer to its stop for so long is blocked.
const BLOCKED_AFTER: Duration = Duration::from_secs(4);
/// Progress that counts, in metres.
const PROGRESS_M: f64 = 0.15;
/// Where the path is taken to be blocked: so far ahead, and so wide, in metres.
const BLOCK_AHEAD_M: f64 = 0.7;
const BLOCK_RADIUS_M: f64 = 0.4;
/// Blocked places are tried again after this time.
const FORGET_AFTER: Duration = Duration::from_secs(8);
/// Times that a stop is tried before it is given up, and after which others come first: people mostly walk on.
const TRIES_MAX: u32 = 9;
const TRIES_BEFORE_OTHERS: u32 = 3;
/// Time to wait where there is no path at all.
const PATIENCE: Duration = Duration::from_secs(2);
/// A drone that makes room flies back until it is so far from where its path is blocked, in metres.
const ROOM_M: f64 = 1.6;
/// After so many waits at one place, it makes room before each.
const WAITS_BEFORE_ROOM: u32 = 2;
/// Distance between the noted places of its way here, and how many are noted: three times as far as it must get from a block.
const NOTED_EVERY_M: f64 = 0.3;
const NOTED_MAX: usize = 16;
/// Stops that may be added at the end for what is still unseen.
const EXTRA_MAX: usize = 40;
/// Steps to look round in at most, each time: a full turn takes 7 s. A drone that does not turn is blocked.
const LOOK_STEPS_MAX: u32 = 210;
/// Distance from the path at which it is planned anew, in metres.
const ASTRAY_M: f64 = 0.8;
/// Distance within which a path may begin beside the drone, in metres.
const BESIDE_M: f64 = 0.6;

/// What the drone is to do next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Order {
    /// Fly towards a point; the stop is `left_m` metres away.
    Fly { to: MapXy, left_m: f64 },
    /// Turn on the spot.
    Look,
    /// Turn slowly on the spot: the pose is lost.
    Search,
    /// Hover.
    Wait,
    /// Hover; this stop is given up.
    GiveUp(MapXy),
    /// Hover; all is done.
    Done,
}

#[derive(Debug)]
enum Phase {
    /// Between stops.
    Choosing,
    /// A search for the path; the floor is without the obstacles of its start.
    Searching(Box<(Floor, Search)>),
    Flying(Vec<MapXy>),
    /// Looking round: what is left to turn, in radians, and the steps so far.
    Looking(f64, u32),
    Waiting(Timestamp),
    /// Flying back along a path, to let by who blocks the way.
    MakingRoom(Vec<MapXy>),
    Done,
}

#[derive(Debug)]
struct Stop {
    at: MapXy,
    /// Its place in the tour. What is added on the way takes that of the stop before which it comes.
    turn: usize,
    tries: u32,
    /// Whether it was added for what other stops left unseen.
    is_extra: bool,
}

#[derive(Debug)]
pub(super) struct Route {
    stops: VecDeque<Stop>,
    /// Stops in a row to which there was no path.
    passed_over: usize,
    extra: usize,
    /// What was seen, or tried to be seen from extra stops.
    tried: Seen,
    phase: Phase,
    obstacles: Obstacles,
    /// When the last obstacle was added.
    blocked_at: Timestamp,
    /// The least distance to the stop, and when it was reached; a drone that is pushed off its path and plans anew has come no
    /// nearer.
    nearest: (f64, Timestamp),
    heading_rad: f64,
    blocked_now: bool,
    /// Where the drone came from, the newest place first.
    came_by: VecDeque<MapXy>,
    /// Where its path was blocked last, and how often it has waited there in a row.
    block: Option<(MapXy, u32)>,
}

impl Route {
    pub(super) fn new(config: &Config) -> Self {
        let stops = config.stops.iter().enumerate();
        let stops = stops.map(|(turn, at)| Stop {
            at: *at,
            turn,
            tries: 0,
            is_extra: false,
        });
        Self {
            stops: stops.collect(),
            passed_over: 0,
            extra: 0,
            tried: Seen::none(config.places.targets().len()),
            phase: Phase::Choosing,
            obstacles: Obstacles::default(),
            blocked_at: Timestamp::ZERO,
            nearest: (f64::INFINITY, Timestamp::ZERO),
            heading_rad: config.start.heading_rad,
            blocked_now: false,
            came_by: VecDeque::new(),
            block: None,
        }
    }

    /// Whether the path turned out to be blocked in the last step.
    pub(super) const fn was_blocked(&self) -> bool {
        self.blocked_now
    }

    /// The next order.
    pub(super) fn next(
        &mut self,
        now: Timestamp,
        config: &Config,
        place: &Place,
        seen: &Seen,
    ) -> Order {
        self.blocked_now = false;
        if !self.obstacles.is_empty() && now.since(self.blocked_at) > FORGET_AFTER {
            self.obstacles.clear();
        }
        let pose = place.pose();
        let turned = crate::frames::wrapped_rad(pose.heading_rad - self.heading_rad);
        self.heading_rad = pose.heading_rad;
        self.note(pose.at);
        match &mut self.phase {
            Phase::Done => Order::Done,
            Phase::Choosing => self.choose(now, config, pose, seen),
            Phase::Searching(search) => {
                let (floor, search) = &mut **search;
                match search.advance(floor, CELLS_A_STEP) {
                    Found::NotYet => Order::Wait,
                    Found::Nothing => self.no_path(now, config, pose, true),
                    Found::Path(path) => {
                        self.passed_over = 0;
                        self.phase = Phase::Flying(path);
                        self.fly(now, config, pose, seen)
                    }
                }
            }
            Phase::Flying(_) => self.fly(now, config, pose, seen),
            Phase::Looking(..) => self.look(config, pose, seen, turned),
            Phase::Waiting(until) => {
                if now >= *until {
                    self.phase = Phase::Choosing;
                }
                Order::Wait
            }
            Phase::MakingRoom(_) => self.make_room(now, config, pose),
        }
    }

    /// Notes the place for a flight back. Where the drone has been before, what it flew since leads nowhere and is forgotten.
    fn note(&mut self, at: MapXy) {
        let is_here = |it: &MapXy| it.distance_m(at) <= NOTED_EVERY_M;
        if let Some(before) = self.came_by.iter().rposition(is_here) {
            self.came_by.drain(..before);
        } else {
            self.came_by.push_front(at);
            self.came_by.truncate(NOTED_MAX);
        }
    }

    /// Waits where it is. If it has waited at this block before, it first flies back the way it came, so that who blocks the
    /// path can pass.
    fn wait(&mut self, now: Timestamp, config: &Config, pose: MapPose) -> Order {
        self.phase = Phase::Waiting(now + PATIENCE);
        let Some((block, waited)) = &mut self.block else {
            return Order::Wait;
        };
        *waited += 1;
        let (block, waited) = (*block, *waited);
        let is_free = |it: &MapXy| it.distance_m(block) >= ROOM_M;
        let end = self.came_by.iter().position(is_free);
        let (Some(end), true) = (end, waited >= WAITS_BEFORE_ROOM) else {
            return Order::Wait;
        };
        let back = self.came_by.iter().take(end + 1).copied();
        let path = std::iter::once(pose.at).chain(back).collect();
        self.nearest = (f64::INFINITY, now);
        self.phase = Phase::MakingRoom(path);
        self.make_room(now, config, pose)
    }

    /// Flies back; waits at the end, or where it gets no farther.
    fn make_room(&mut self, now: Timestamp, config: &Config, pose: MapPose) -> Order {
        let Phase::MakingRoom(path) = &self.phase else {
            return Order::Wait;
        };
        let (_, at) = along(path, pose.at);
        let left_m = length_from(path, at);
        if left_m < self.nearest.0 - PROGRESS_M {
            self.nearest = (left_m, now);
        }
        if left_m < ARRIVED_M || now.since(self.nearest.1) > BLOCKED_AFTER {
            self.phase = Phase::Waiting(now + PATIENCE);
            return Order::Wait;
        }
        Order::Fly {
            to: aim(config, path, at, pose.at),
            left_m,
        }
    }

    /// Begins with the next stop that shows something new, or with what the stops before left unseen if that is nearer. Nobody has
    /// to come back for it at the end.
    fn choose(&mut self, now: Timestamp, config: &Config, pose: MapPose, seen: &Seen) -> Order {
        while let Some(stop) = self.stops.front() {
            if adds(config, stop.at, seen) > 0 {
                break;
            }
            self.stops.pop_front();
        }
        if let Some(place) = self.left_behind(config, pose, seen) {
            self.extra += 1;
            self.stops.push_front(Stop {
                at: place,
                turn: self.stops.front().map_or(0, |next| next.turn),
                tries: 0,
                is_extra: true,
            });
        }
        if self.stops.is_empty() {
            self.phase = Phase::Done;
            return Order::Done;
        }
        self.nearest = (f64::INFINITY, now);
        self.search(now, config, pose)
    }

    /// The place that sees most targets that no remaining stop sees. `None` if the next stop is nearer.
    fn left_behind(&mut self, config: &Config, pose: MapPose, seen: &Seen) -> Option<MapXy> {
        self.tried.add(seen);
        let mut planned = self.tried.clone();
        let (map, places) = (config.floor.map(), &config.places);
        for stop in &self.stops {
            places.look_round(map, stop.at, &mut planned);
        }
        let next_m = self.stops.front().map(|stop| stop.at.distance_m(pose.at));
        let (place, _) = places.best(&planned, pose.at)?;
        let is_near = next_m.is_none_or(|next_m| place.distance_m(pose.at) < next_m);
        (is_near && self.extra < EXTRA_MAX).then_some(place)
    }

    /// Takes the present stop from the tour. Those that were passed over come next again: who was in the way may have gone, and
    /// they are nearer now than after the rest of the tour.
    fn leave(&mut self) -> Option<Stop> {
        let stop = self.stops.pop_front();
        self.stops.make_contiguous().sort_by_key(|stop| stop.turn);
        stop
    }

    fn search(&mut self, now: Timestamp, config: &Config, pose: MapPose) -> Order {
        let Some(stop) = self.stops.front() else {
            return Order::Wait;
        };
        let floor = config.floor.without(&self.obstacles);
        let start = floor.nearest_free(pose.at, BESIDE_M);
        let goal = floor.nearest_free(stop.at, BESIDE_M);
        let (Some(start), Some(goal)) = (start, goal) else {
            return self.no_path(now, config, pose, start.is_some());
        };
        let search = Search::new(&floor, start, goal);
        self.phase = Phase::Searching(Box::new((floor, search)));
        Order::Wait
    }

    fn fly(&mut self, now: Timestamp, config: &Config, pose: MapPose, seen: &Seen) -> Order {
        let (Some(stop), Phase::Flying(path)) = (self.stops.front(), &self.phase) else {
            return Order::Wait;
        };
        let (astray_m, at) = along(path, pose.at);
        let left_m = length_from(path, at);
        if left_m < ARRIVED_M && astray_m < ARRIVED_M {
            self.phase = Phase::Looking(config.look_rad(), 0);
            return Order::Look;
        }
        if adds(config, stop.at, seen) == 0 {
            self.leave();
            self.phase = Phase::Choosing;
            return Order::Wait;
        }
        if astray_m > ASTRAY_M {
            return self.search(now, config, pose);
        }
        // Beside the end of the path none of it is left.
        let end_m = path.last().map_or(0.0, |end| end.distance_m(pose.at));
        let left_m = left_m.max(end_m);
        if left_m < self.nearest.0 - PROGRESS_M {
            self.nearest = (left_m, now);
        } else if now.since(self.nearest.1) > BLOCKED_AFTER {
            let ahead = point_at(path, at, BLOCK_AHEAD_M);
            return self.blocked(now, config, pose, ahead);
        }
        Order::Fly {
            to: aim(config, path, at, pose.at),
            left_m,
        }
    }

    /// Looks round until it has turned, or nothing new is to be seen. A look that takes too long counts as a try.
    fn look(&mut self, config: &Config, pose: MapPose, seen: &Seen, turned_rad: f64) -> Order {
        let Phase::Looking(left_rad, steps) = &mut self.phase else {
            return Order::Wait;
        };
        *left_rad -= turned_rad.abs();
        *steps += 1;
        let (has_turned, is_late) = (*left_rad <= 0.0, *steps > LOOK_STEPS_MAX);
        if has_turned || adds(config, pose.at, seen) == 0 {
            // What isn't seen from here is not tried again. The drone is a little beside its stop: what only that shows is tried from
            // one extra stop more.
            if let Some(stop) = self.leave() {
                let from = if stop.is_extra { stop.at } else { pose.at };
                let map = config.floor.map();
                config.places.look_round(map, from, &mut self.tried);
            }
            self.phase = Phase::Choosing;
        } else if is_late {
            self.phase = Phase::Choosing;
            return self.tried(config).map_or(Order::Wait, Order::GiveUp);
        }
        Order::Look
    }

    /// The path is blocked ahead: another path is tried, then other stops first.
    fn blocked(&mut self, now: Timestamp, config: &Config, pose: MapPose, ahead: MapXy) -> Order {
        self.blocked_now = true;
        self.obstacles.add(ahead, BLOCK_RADIUS_M);
        let waited = self
            .block
            .filter(|(block, _)| block.distance_m(ahead) < ROOM_M);
        self.block = Some((ahead, waited.map_or(0, |(_, times)| times)));
        self.blocked_at = now;
        self.nearest = (f64::INFINITY, now);
        match self.tried(config) {
            Some(stop) => Order::GiveUp(stop),
            None => self.search(now, config, pose),
        }
    }

    /// There is no path to the present stop: those come first to which there is one, so that who blocks the path can walk on. If
    /// there is none to any, or the drone can't leave where it is, it waits.
    fn no_path(
        &mut self,
        now: Timestamp,
        config: &Config,
        pose: MapPose,
        can_leave: bool,
    ) -> Order {
        // What blocks the path was counted when it was met.
        if self.obstacles.is_empty() {
            self.phase = Phase::Waiting(now + PATIENCE);
            return self.tried(config).map_or(Order::Wait, Order::GiveUp);
        }
        if can_leave {
            self.stops.rotate_left(1);
            self.passed_over += 1;
            if self.passed_over < self.stops.len() {
                return self.search(now, config, pose);
            }
        }
        self.passed_over = 0;
        self.obstacles.clear();
        self.wait(now, config, pose)
    }

    /// Counts a try of the present stop; after some, the next stop comes first. The stop, if it is given up: what it shows is
    /// not looked for again.
    fn tried(&mut self, config: &Config) -> Option<MapXy> {
        let stop = self.stops.front_mut()?;
        stop.tries += 1;
        if stop.tries < TRIES_MAX {
            if stop.tries.is_multiple_of(TRIES_BEFORE_OTHERS) && self.stops.len() > 1 {
                self.stops.swap(0, 1);
            }
            return None;
        }
        self.phase = Phase::Choosing;
        let given_up = self.stops.pop_front()?.at;
        let map = config.floor.map();
        config.places.look_round(map, given_up, &mut self.tried);
        Some(given_up)
    }
}

impl Config {
    /// How far the drone turns to see all round, in radians.
    fn look_rad(&self) -> f64 {
        std::f64::consts::TAU + 0.2
    }
}

/// The point to fly to: as far ahead on the path as the straight line there stays clear of walls. A drone that was pushed too near
/// to one has no such line; it flies to the nearest of these points.
fn aim(config: &Config, path: &[MapXy], at: (usize, f64), from: MapXy) -> MapXy {
    let ahead = |step: u32| point_at(path, at, AHEAD_M - AHEAD_STEP_M * f64::from(step));
    let points = (0..AHEAD_STEPS).map(ahead);
    let mut clear = points.filter(|to| config.floor.is_clear(from, *to));
    clear.next().unwrap_or_else(|| ahead(AHEAD_STEPS))
}

/// How many targets a full turn at a point would add.
fn adds(config: &Config, at: MapXy, seen: &Seen) -> usize {
    config.places.added_from(config.floor.map(), at, seen)
}

#[cfg(test)]
mod tests;
