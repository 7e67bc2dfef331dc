//! Drones near each other: where each says that it is and goes, and who gives way to whom.
//!
//! Nobody begins a way that comes too near to another's. Two that begin at the same moment do not know of each other yet:
//! once they do, one of them stops. Both find the same one: it is the other that goes on if that stands still or flies
//! straight up or down, and of two that do the same the one with the lower number. Who waits for one that does not go flies
//! round it.

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};
use std::time::Duration;

use nalgebra::{Rotation2, Vector2};
use serde::{Deserialize, Serialize};

use crate::formation::{Path, Separation};
use crate::geometry::Ned;
use crate::identity::NodeId;
use crate::time::Timestamp;

/// How much older what is known of a drone may be than what it said last: its radio passes on what is no news once a second.
const KNOWN_LATE: Duration = Duration::from_secs(1);
/// After how long a silent drone that has flown out of reach is thought to be where its way ends.
const THERE_AFTER: Duration = Duration::from_secs(5);
/// For how long a drone that fell silent in the air is thought to be where its way ends, at the least.
const FORGOTTEN_AFTER: Duration = Duration::from_secs(30);
/// Below which height a way ends on the ground, in metres.
const GROUND_M: f64 = 1.0;
/// Two ways of which one is the other elsewhere, for their lengths and directions differ by no more than this, in metres.
const ALIKE_M: f64 = 1.0;
/// How far aside a way round is looked for, counted in how far from others drones keep over ground.
const ASIDE: [f64; 2] = [2.2, 4.4];
/// In which directions, clockwise from the way's own, in radians: half ahead first.
const TURNS_RAD: [f64; 8] = [
    FRAC_PI_4,
    -FRAC_PI_4,
    FRAC_PI_2,
    -FRAC_PI_2,
    3.0 * FRAC_PI_4,
    -3.0 * FRAC_PI_4,
    PI,
    0.0,
];
/// A way is flown straight up or down if it leads no farther over ground, in metres.
const UPRIGHT_M: f64 = 1.0;

/// How a drone keeps clear of others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Config {
    /// How far.
    pub separation: Separation,
    /// After how long without a word of it a drone is silent.
    pub time_to_live: Duration,
    /// After how long without a word of its drone's a flight controller brings an aircraft down.
    pub controller: Duration,
    /// How fast it does, in m/s.
    pub descent_mps: f64,
    /// How much longer than at that speed the last metres take.
    pub touch_down: Duration,
}

impl Config {
    /// How old what is known of a drone is at the most as long as that counts as heard.
    fn silent_after(&self) -> Duration {
        self.time_to_live + KNOWN_LATE
    }

    /// How long after it was heard last a drone at that height, in metres, is on the ground if its process has ended.
    fn down_after(&self, altitude_m: f64) -> Duration {
        let descent = Duration::from_secs_f64(altitude_m.max(0.0) / self.descent_mps);
        self.silent_after() + self.controller + descent + self.touch_down
    }
}

/// How much nearer than what it says of its way a drone may be, in metres, for that is rounded to decimetres on each axis.
const ROUNDED_M: f64 = 0.1;

/// Into how many parts a way is divided to say how much of it is flown.
const PARTS: f64 = 128.0;

/// Where a drone is and where it goes: the straight way that it flies, whose ends are the same where it stands still.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Intent {
    /// Where it begins: decimetres north, east and down of the mission's home.
    pub from_dm: [i32; 3],
    /// Where it ends, likewise.
    pub to_dm: [i32; 3],
    /// How much of the way is behind it at the least, in 128ths of it: 0 to 127.
    pub flown: u8,
    /// Whether it gives way to nobody: it lands, or follows a master.
    pub is_heedless: bool,
}

impl Intent {
    /// The nearest to a way that can be said, of which so large a share is flown.
    #[must_use]
    pub fn of(path: Path, share: f64, is_heedless: bool) -> Self {
        // What is farther than 2^31 decimetres is on no mission.
        let decimetres = |place: Ned| <[f64; 3]>::from(place).map(|it| (it * 10.0).round() as i32);
        Self {
            from_dm: decimetres(path.from),
            to_dm: decimetres(path.to),
            flown: (share * PARTS).clamp(0.0, PARTS - 1.0) as u8,
            is_heedless,
        }
    }

    /// The way, in metres.
    #[must_use]
    pub fn path(self) -> Path {
        let metres = |place: [i32; 3]| Ned::from(place.map(|it| f64::from(it) / 10.0));
        Path {
            from: metres(self.from_dm),
            to: metres(self.to_dm),
        }
    }

    /// Whether it is a way that leads to the ground.
    fn comes_down(self) -> bool {
        let path = self.path();
        is_upright(path) && path.to.altitude_m() < GROUND_M
    }

    /// Whether it follows a master.
    fn follows(self) -> bool {
        self.is_heedless && !self.comes_down()
    }

    /// What of the way is left, in metres.
    fn rest(self) -> Path {
        let Path { from, to } = self.path();
        let from = Ned(from.0.lerp(&to.0, f64::from(self.flown) / PARTS));
        Path { from, to }
    }
}

/// What a drone does, those first whom others give way to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Manner {
    Heedless,
    StandsStill,
    GoesUpOrDown,
    FliesOn,
}

impl Manner {
    fn of(path: Path) -> Self {
        if path.from == path.to {
            Self::StandsStill
        } else if is_upright(path) {
            Self::GoesUpOrDown
        } else {
            Self::FliesOn
        }
    }
}

fn is_upright(path: Path) -> bool {
    path.from.horizontal_distance_m(path.to) <= UPRIGHT_M
}

/// Where another may be.
#[derive(Debug, Clone, Copy)]
struct Room {
    path: Path,
    /// Whether it may come down from there.
    sinks: bool,
    manner: Manner,
}

impl Room {
    /// Of one that is heard.
    fn of(said: Intent) -> Self {
        Self {
            path: said.rest(),
            sinks: false,
            manner: if said.is_heedless {
                Manner::Heedless
            } else {
                Manner::of(said.path())
            },
        }
    }

    fn at(place: Ned) -> Self {
        Self {
            path: Path {
                from: place,
                to: place,
            },
            sinks: false,
            manner: Manner::StandsStill,
        }
    }

    fn is_near(&self, path: Path, separation: Separation) -> bool {
        if self.sinks {
            path.comes_near_below(self.path, separation)
        } else {
            path.comes_near(self.path, separation)
        }
    }
}

/// What the others near a drone say of themselves.
#[derive(Debug)]
pub(crate) struct Traffic {
    own: NodeId,
    config: Config,
    /// Whether it flies in step with those that follow its master.
    in_step: bool,
    others: BTreeMap<NodeId, (Intent, Timestamp)>,
}

impl Traffic {
    pub(crate) const fn new(own: NodeId, config: Config) -> Self {
        Self {
            own,
            config,
            in_step: false,
            others: BTreeMap::new(),
        }
    }

    /// The drone flies in step with those that follow its master from now on, or does not any more.
    pub(crate) const fn flies_in_step(&mut self, in_step: bool) {
        self.in_step = in_step;
    }

    /// Takes in where another is and goes, or that it does not say so any more; whether that is news.
    pub(crate) fn hears(&mut self, now: Timestamp, id: NodeId, intent: Option<Intent>) -> bool {
        let Some(intent) = intent else {
            return self.others.remove(&id).is_some();
        };
        let before = self.others.insert(id, (intent, now));
        before.is_none_or(|(before, _)| before != intent)
    }

    /// Whether a way may be begun: no other is near it, and none is on a way that comes near it.
    pub(crate) fn is_free(&self, now: Timestamp, path: Path) -> bool {
        self.near(now, path, path).next().is_none()
    }

    /// Whether the rest of a way that is being flown is another's to fly first.
    pub(crate) fn gives_way(&self, now: Timestamp, rest: Path, whole: Path) -> bool {
        let own = (Manner::of(whole), self.own);
        let mut near = self.near(now, rest, whole);
        near.any(|(id, other)| (other.manner, id) < own)
    }

    /// A place aside of where a drone would come down, at the same height, and the way there, if both are free.
    pub(crate) fn beside(&self, now: Timestamp, column: Path) -> Option<Ned> {
        self.sides(column.from, Vector2::x()).find(|side| {
            let across = Path {
                from: column.from,
                to: *side,
            };
            let down = Path {
                from: *side,
                to: side.at_altitude(0.0),
            };
            // A drone that is near already is not in the way there, but below a descent.
            self.is_free(now, across)
                && (self.rooms(now, column.from)).all(|(_, it)| !self.is_near(&it, down))
        })
    }

    /// Places around another at which a way round may begin, those before that are nearest ahead first.
    fn sides(&self, from: Ned, ahead: Vector2<f64>) -> impl Iterator<Item = Ned> {
        let horizontal_m = self.config.separation.horizontal_m;
        ASIDE.iter().flat_map(move |far| {
            TURNS_RAD.iter().map(move |turn_rad| {
                let unicasts = Rotation2::new(*turn_rad) * ahead * (far * horizontal_m);
                from + Ned::new(unicasts.x, unicasts.y, 0.0)
            })
        })
    }

    /// The two corners of a way round those that are in the way, if all of them stand still and one is free: aside at the
    /// height where it begins, then up or down to the height where it ends, and from there straight on.
    pub(crate) fn way_round(&self, now: Timestamp, path: Path) -> Option<[Ned; 2]> {
        let mut in_the_way = self.near(now, path, path);
        if in_the_way.any(|(_, other)| other.manner != Manner::StandsStill) {
            return None;
        }
        let ahead = (path.to - path.from).0.xy();
        let ahead = ahead.try_normalize(UPRIGHT_M).unwrap_or_else(Vector2::x);
        let sides = self.sides(path.from, ahead);
        let mut ways_round = sides.map(|side| [side, side.at_altitude(path.to.altitude_m())]);
        ways_round.find(|[side, level]| {
            let legs = [(path.from, *side), (*side, *level), (*level, path.to)];
            let mut legs = legs.into_iter().map(|(from, to)| Path { from, to });
            legs.all(|leg| self.is_free(now, leg))
        })
    }

    /// Who is too near the rest of a way, or on one that comes too near it. Nobody who flies the same way elsewhere, for it
    /// stays as far; and nobody who is too near where the way begins, for to wait there would not help: but for one that
    /// flies by, who may only seem to be, as what it says is rounded.
    fn near(
        &self,
        now: Timestamp,
        rest: Path,
        whole: Path,
    ) -> impl Iterator<Item = (NodeId, Room)> {
        let here = Path {
            from: rest.from,
            to: rest.from,
        };
        self.rooms(now, rest.from).filter(move |(id, room)| {
            let may_fly = room.manner == Manner::FliesOn || room.sinks;
            let flies_alike = may_fly && {
                let other = self.others[id].0.path();
                let differ_m = ((whole.to - whole.from).0 - (other.to - other.from).0).norm();
                differ_m < ALIKE_M && Manner::of(other) == Manner::FliesOn
            };
            let follows_alike = self.in_step && self.others[id].0.follows();
            let is_near_here = match room.manner {
                Manner::FliesOn => room.is_near(here, self.farther_by(-ROUNDED_M)),
                _ => self.is_near(room, here),
            };
            !flies_alike && !follows_alike && self.is_near(room, rest) && !is_near_here
        })
    }

    fn is_near(&self, room: &Room, path: Path) -> bool {
        room.is_near(path, self.farther_by(ROUNDED_M))
    }

    /// How far others are to be, and that many metres more.
    fn farther_by(&self, metres: f64) -> Separation {
        let Separation {
            horizontal_m,
            vertical_m,
        } = self.config.separation;
        Separation {
            horizontal_m: horizontal_m + metres,
            vertical_m: vertical_m + metres,
        }
    }

    /// Where the others may be, as seen from `here`.
    fn rooms(&self, now: Timestamp, here: Ned) -> impl Iterator<Item = (NodeId, Room)> {
        let apart_m = move |said: &Intent| here.distance_m(said.rest().from);
        let heard = self.others.values();
        let heard = heard.filter(move |(_, at)| now.since(*at) <= self.config.silent_after());
        let reach_m = heard.map(|(said, _)| apart_m(said)).fold(0.0, f64::max);
        self.others.iter().filter_map(move |(id, (said, at))| {
            let silent = now.since(*at);
            let room = if silent <= self.config.silent_after() {
                Some(Room::of(*said))
            } else {
                self.silent_room(silent, *said, apart_m(said) <= reach_m)
            };
            Some((*id, room?))
        })
    }

    /// Where one may be that said this, and has been silent for so long.
    ///
    /// One that was no farther away than another that is heard has no process any more, as far as can be known: its aircraft
    /// comes down somewhere on the rest of its way. Any other may have flown on, out of reach. Once it is down or there,
    /// where its way ended is kept clear for a while yet. One that came down where it said lies there for good.
    fn silent_room(&self, silent: Duration, said: Intent, is_in_reach: bool) -> Option<Room> {
        let rest = said.rest();
        let highest_m = rest.from.altitude_m().max(rest.to.altitude_m());
        let may_sink = silent <= self.config.down_after(highest_m);
        if said.comes_down() {
            Some(if may_sink {
                Room::of(said)
            } else {
                Room::at(rest.to)
            })
        } else if is_in_reach && may_sink {
            Some(Room {
                path: rest,
                sinks: true,
                manner: Manner::StandsStill,
            })
        } else if silent <= THERE_AFTER {
            Some(Room::of(said))
        } else {
            (silent <= FORGOTTEN_AFTER).then(|| Room::at(rest.to))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SEPARATION: Separation = Separation {
        horizontal_m: 5.0,
        vertical_m: 5.0,
    };

    /// One is silent after 3 s; an aircraft 30 m high is down 5 s, 10 s and 10 s after that.
    const CONFIG: Config = Config {
        separation: SEPARATION,
        time_to_live: Duration::from_secs(2),
        controller: Duration::from_secs(5),
        descent_mps: 3.0,
        touch_down: Duration::from_secs(10),
    };

    fn at(north_m: f64, east_m: f64, altitude_m: f64) -> Ned {
        Ned::new(north_m, east_m, -altitude_m)
    }

    fn path(from: Ned, to: Ned) -> Path {
        Path { from, to }
    }

    fn says(path: Path) -> Intent {
        Intent::of(path, 0.0, false)
    }

    fn seconds(seconds: f64) -> Timestamp {
        Timestamp::from_secs_f64(seconds)
    }

    /// What drone 5 knows that has heard this of others just now.
    fn traffic(said: &[(u32, Path)]) -> Traffic {
        let mut traffic = Traffic::new(NodeId(5), CONFIG);
        for (id, path) in said {
            assert!(traffic.hears(seconds(0.0), NodeId(*id), Some(says(*path))));
        }
        traffic
    }

    #[test]
    fn what_is_said_is_the_way_to_five_centimetres() {
        let flown = path(at(1.04, -2.26, 30.0), at(-1_000.0, 3.0, 12.31));
        let said = says(flown).path();
        assert!(said.from.distance_m(flown.from) < 0.09 && said.to.distance_m(flown.to) < 0.09);
        let far = at(1e300, f64::NAN, 0.0);
        assert_eq!(says(path(far, far)).from_dm, [i32::MAX, 0, 0]);
    }

    #[test]
    fn nobody_begins_a_way_through_one_that_stands_still() {
        let there = at(60.0, 0.0, 12.0);
        let mut known = traffic(&[(2, path(there, there))]);
        let leg = path(at(0.0, 0.0, 12.0), at(160.0, 0.0, 12.0));
        assert!(!known.is_free(seconds(1.0), leg));
        assert!(known.is_free(seconds(1.0), path(leg.from, at(50.0, 0.0, 12.0))));
        let above = path(at(0.0, 0.0, 18.0), at(160.0, 0.0, 18.0));
        assert!(known.is_free(seconds(1.0), above));
        // It has gone on, the same way: whoever is behind it may follow.
        let ahead = path(there, at(220.0, 0.0, 12.0));
        assert!(known.hears(seconds(1.0), NodeId(2), Some(says(ahead))));
        assert!(
            !known.hears(seconds(1.5), NodeId(2), Some(says(ahead))),
            "no news"
        );
        assert!(known.is_free(seconds(2.0), leg));
        known.hears(seconds(3.0), NodeId(2), Some(says(path(there, there))));
        assert!(!known.is_free(seconds(3.0), leg));
        assert!(known.hears(seconds(4.0), NodeId(2), None) && known.is_free(seconds(4.0), leg));
    }

    #[test]
    fn what_is_rounded_of_a_way_brings_nobody_too_near() {
        // 4.96 m away, and said to be 5 m away.
        let there = at(50.0, 4.96, 12.0);
        let leg = path(at(0.0, 0.0, 12.0), at(100.0, 0.0, 12.0));
        assert!(!traffic(&[(2, path(there, there))]).is_free(seconds(1.0), leg));
        let apart = at(50.0, 5.2, 12.0);
        assert!(traffic(&[(2, path(apart, apart))]).is_free(seconds(1.0), leg));
    }

    #[test]
    fn one_that_flies_by_and_only_seems_too_near_is_waited_for() {
        // It passes at 5.06 m as it says, for 5 m: on the way, it would be beside a drone that begins its own.
        let by = traffic(&[(1, path(at(-60.0, 7.56, 30.0), at(60.0, 2.56, 30.0)))]);
        assert!(!by.is_free(seconds(0.1), path(at(0.0, 0.0, 30.0), at(100.0, 0.0, 30.0))));
        let too_near = traffic(&[(1, path(at(-60.0, 6.5, 30.0), at(60.0, 1.5, 30.0)))]);
        assert!(too_near.is_free(seconds(0.1), path(at(0.0, 0.0, 30.0), at(100.0, 0.0, 30.0))));
    }

    #[test]
    fn whoever_is_too_near_already_does_not_hold_a_drone_there() {
        let there = at(3.0, 0.0, 12.0);
        let known = traffic(&[(2, path(there, there))]);
        let away = path(at(0.0, 0.0, 12.0), at(-50.0, 0.0, 12.0));
        assert!(known.is_free(seconds(1.0), away));
    }

    #[test]
    fn of_two_that_begin_at_once_one_stops() {
        let north = path(at(0.0, 0.0, 12.0), at(100.0, 0.0, 12.0));
        let east = path(at(50.0, -50.0, 12.0), at(50.0, 50.0, 12.0));
        let up = path(at(50.0, 0.0, 5.0), at(50.0, 0.0, 30.0));
        let still = path(up.to, up.to);
        let stops = |own: Path, id: u32, other: Path| {
            traffic(&[(id, other)]).gives_way(seconds(0.1), own, own)
        };
        assert!(stops(north, 4, east) && !stops(north, 6, east));
        assert!(stops(north, 6, up) && !stops(up, 4, north));
        assert!(stops(up, 6, still));
        assert!(!stops(
            path(at(0.0, 0.0, 40.0), at(100.0, 0.0, 40.0)),
            4,
            up
        ));
    }

    #[test]
    fn round_one_that_stays_leads_a_way_that_is_free() {
        let (below, above) = (at(0.0, 0.0, 12.0), at(0.0, 0.0, 24.0));
        let amid = at(0.0, 0.0, 18.0);
        let known = traffic(&[(2, path(amid, amid))]);
        let [side, level] = known.way_round(seconds(1.0), path(below, above)).unwrap();
        assert_eq!((side.altitude_m(), level.altitude_m()), (12.0, 24.0));
        assert!((side.horizontal_distance_m(below) - 11.0).abs() < 1e-9);
        let climbs = traffic(&[(2, path(amid, above))]);
        assert_eq!(
            climbs.way_round(seconds(1.0), path(below, above)),
            None,
            "it goes"
        );
        // One that stands where the way ends leaves none.
        let there = traffic(&[(2, path(above, above))]);
        assert_eq!(there.way_round(seconds(1.0), path(below, above)), None);
        // On a leg, and with another beside it: on the other side, or farther out.
        let leg = path(at(0.0, 0.0, 12.0), at(100.0, 0.0, 12.0));
        let (ahead, beside) = (at(60.0, 0.0, 12.0), at(10.0, 10.0, 12.0));
        let known = traffic(&[(2, path(ahead, ahead)), (3, path(beside, beside))]);
        let [side, level] = known.way_round(seconds(1.0), leg).unwrap();
        assert_eq!(side, level);
        assert!(side.east_m() < -9.0, "{side:?}");
    }

    #[test]
    fn what_is_flown_of_a_way_is_in_nobody_s_way_any_more() {
        let (from, to) = (at(60.0, -100.0, 12.0), at(60.0, 100.0, 12.0));
        let leg = path(at(0.0, 0.0, 12.0), at(160.0, 0.0, 12.0));
        for (share, is_free) in [(0.5, false), (0.54, true), (1.0, true)] {
            let mut known = traffic(&[]);
            known.hears(
                seconds(0.0),
                NodeId(2),
                Some(Intent::of(path(from, to), share, false)),
            );
            assert_eq!(known.is_free(seconds(1.0), leg), is_free, "{share}");
        }
        // Whose way is like the own one still is when half of it is flown.
        let ahead = path(at(60.0, 0.0, 12.0), at(220.0, 0.0, 12.0));
        let mut known = traffic(&[]);
        known.hears(seconds(0.0), NodeId(2), Some(Intent::of(ahead, 0.5, false)));
        assert!(known.is_free(seconds(1.0), leg));
        let rest = path(at(80.0, 0.0, 12.0), leg.to);
        assert!(!known.gives_way(seconds(1.0), rest, leg));
    }

    #[test]
    fn to_one_that_can_t_give_way_all_do() {
        let (low, high) = (at(50.0, 0.0, 5.0), at(50.0, 0.0, 30.0));
        let mut known = traffic(&[]);
        let lands = Intent::of(path(high, at(50.0, 0.0, 15.0)), 0.0, true);
        known.hears(seconds(0.0), NodeId(9), Some(lands));
        assert!(known.gives_way(seconds(0.1), path(low, high), path(low, high)));
    }

    #[test]
    fn one_that_has_flown_out_of_reach_is_thought_to_be_there_for_a_while() {
        let there = at(60.0, 0.0, 12.0);
        let known = traffic(&[(2, path(there, at(60.0, 500.0, 12.0)))]);
        let leg = path(at(0.0, 0.0, 12.0), at(160.0, 0.0, 12.0));
        assert!(!known.is_free(seconds(5.0), leg) && known.is_free(seconds(5.1), leg));
    }

    #[test]
    fn one_in_step_flies_among_those_that_follow_and_no_other_does() {
        let (here, ahead) = (at(60.0, 0.0, 12.0), at(64.0, 0.0, 12.0));
        let leg = path(at(0.0, 0.0, 12.0), at(160.0, 0.0, 12.0));
        let mut known = traffic(&[]);
        let follows = Intent::of(path(here, ahead), 0.0, true);
        known.hears(seconds(0.0), NodeId(9), Some(follows));
        assert!(!known.is_free(seconds(1.0), leg) && known.gives_way(seconds(1.0), leg, leg));
        known.flies_in_step(true);
        assert!(known.is_free(seconds(1.0), leg));
        let lands = Intent::of(path(here, at(60.0, 0.0, 0.0)), 0.0, true);
        known.hears(seconds(1.0), NodeId(9), Some(lands));
        assert!(!known.is_free(seconds(1.0), leg));
    }

    #[test]
    fn nobody_flies_below_one_that_has_fallen_silent_before_it_must_be_down() {
        let leg = path(at(0.0, 0.0, 12.0), at(160.0, 0.0, 12.0));
        let above = path(at(0.0, 0.0, 40.0), at(160.0, 0.0, 40.0));
        let crosses = path(at(60.0, -100.0, 30.0), at(60.0, 100.0, 30.0));
        let there = path(at(60.0, 0.0, 30.0), at(60.0, 0.0, 30.0));
        for said in [there, crosses] {
            for (at_s, waits) in [(3.0, false), (3.1, true), (28.0, true), (28.1, false)] {
                let now = seconds(at_s);
                let mut known = traffic(&[(9, said)]);
                assert!(
                    known.is_free(now, leg),
                    "nobody is heard: it is out of reach"
                );
                // One that is heard is farther away.
                let far = at(-500.0, 0.0, 12.0);
                known.hears(now, NodeId(8), Some(says(path(far, far))));
                assert_eq!(known.is_free(now, leg), !waits, "{said:?} at {at_s}");
                assert_eq!(known.gives_way(now, leg, leg), waits);
                assert!(known.is_free(now, above));
            }
        }
        // Where its way ends it may stay for a while, and where it came down for good.
        let at_its_height = path(at(0.0, 0.0, 30.0), at(160.0, 0.0, 30.0));
        let known = traffic(&[(9, there)]);
        assert!(!known.is_free(seconds(30.0), at_its_height));
        assert!(known.is_free(seconds(30.1), at_its_height));
        let known = traffic(&[(9, path(there.from, at(60.0, 0.0, 0.0)))]);
        assert!(!known.is_free(seconds(28.0), leg) && known.is_free(seconds(28.1), leg));
        let onto_it = path(at(60.0, 2.0, 30.0), at(60.0, 2.0, 0.0));
        assert!(!known.is_free(seconds(900.0), onto_it));
        let side = known.beside(seconds(900.0), onto_it).unwrap();
        assert!(side.horizontal_distance_m(onto_it.to) > 10.0);
    }
}
