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

use crate::formation::{Separation, Way};
use crate::geometry::Ned;
use crate::identity::NodeId;
use crate::time::Timestamp;

/// For how long a silent drone is thought to be where it said. It may be out of reach, and elsewhere by then; one that is
/// dead is missed before that, and all fly above where it comes down.
const FORGOTTEN_AFTER: Duration = Duration::from_secs(30);
/// After how long a silent drone is thought to be where its way ends: it has flown on, out of reach.
const THERE_AFTER: Duration = Duration::from_secs(5);
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

/// Where a drone is and where it goes: the straight way that it flies, whose ends are the same where it stands still.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Intent {
    /// Where it begins: decimetres north, east and down of the mission's home.
    pub from_dm: [i32; 3],
    /// Where it ends, likewise.
    pub to_dm: [i32; 3],
}

impl Intent {
    /// The nearest to a way that can be said.
    #[must_use]
    pub fn of(way: Way) -> Self {
        // What is farther than 2^31 decimetres is on no mission.
        let decimetres = |place: Ned| <[f64; 3]>::from(place).map(|it| (it * 10.0).round() as i32);
        Self {
            from_dm: decimetres(way.from),
            to_dm: decimetres(way.to),
        }
    }

    /// The way, in metres.
    #[must_use]
    pub fn way(self) -> Way {
        let metres = |place: [i32; 3]| Ned::from(place.map(|it| f64::from(it) / 10.0));
        Way {
            from: metres(self.from_dm),
            to: metres(self.to_dm),
        }
    }
}

/// What a drone does, those first whom others give way to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Manner {
    StandsStill,
    GoesUpOrDown,
    FliesOn,
}

impl Manner {
    fn of(way: Way) -> Self {
        if way.from == way.to {
            Self::StandsStill
        } else if way.from.horizontal_distance_m(way.to) <= UPRIGHT_M {
            Self::GoesUpOrDown
        } else {
            Self::FliesOn
        }
    }
}

/// What the others near a drone say of themselves.
#[derive(Debug)]
pub(crate) struct Traffic {
    own: NodeId,
    separation: Separation,
    others: BTreeMap<NodeId, (Way, Timestamp)>,
}

impl Traffic {
    pub(crate) const fn new(own: NodeId, separation: Separation) -> Self {
        Self {
            own,
            separation,
            others: BTreeMap::new(),
        }
    }

    /// Takes in where another is and goes, or that it does not say so any more; whether that is news.
    pub(crate) fn hears(&mut self, now: Timestamp, id: NodeId, intent: Option<Intent>) -> bool {
        let Some(way) = intent.map(Intent::way) else {
            return self.others.remove(&id).is_some();
        };
        let before = self.others.insert(id, (way, now));
        before.is_none_or(|(before, _)| before != way)
    }

    /// Whether a way may be begun: no other is near it, and none is on a way that comes near it.
    pub(crate) fn is_free(&self, now: Timestamp, way: Way) -> bool {
        self.near(now, way).next().is_none()
    }

    /// Whether the rest of a way that is being flown is another's to fly first.
    pub(crate) fn gives_way(&self, now: Timestamp, way: Way) -> bool {
        let own = (Manner::of(way), self.own);
        let mut near = self.near(now, way);
        near.any(|(id, other)| (Manner::of(other), id) < own)
    }

    /// The two corners of a way round those that are in the way, if all of them stand still and one is free: aside at the height where it begins, then
    /// up or down to the height where it ends, and from there straight on.
    pub(crate) fn way_round(&self, now: Timestamp, way: Way) -> Option<[Ned; 2]> {
        let mut in_the_way = self.near(now, way);
        if in_the_way.any(|(_, other)| Manner::of(other) != Manner::StandsStill) {
            return None;
        }
        let ahead = (way.to - way.from).0.xy();
        let ahead = ahead.try_normalize(UPRIGHT_M).unwrap_or_else(Vector2::x);
        let sides = ASIDE.iter().flat_map(|far| {
            let distance_m = far * self.separation.horizontal_m;
            TURNS_RAD.iter().map(move |turn_rad| {
                let aside = Rotation2::new(*turn_rad) * ahead * distance_m;
                way.from + Ned::new(aside.x, aside.y, 0.0)
            })
        });
        let mut ways_round = sides.map(|side| [side, side.at_altitude(way.to.altitude_m())]);
        ways_round.find(|[side, level]| {
            let legs = [(way.from, *side), (*side, *level), (*level, way.to)];
            let mut legs = legs.into_iter().map(|(from, to)| Way { from, to });
            legs.all(|leg| self.is_free(now, leg))
        })
    }

    /// Who is too near a way, or on one that comes too near it. Nobody who flies the same way elsewhere, for it stays as far;
    /// and nobody who is too near where the way begins, for to wait there would not help.
    fn near(&self, now: Timestamp, way: Way) -> impl Iterator<Item = (NodeId, Way)> {
        let here = Way {
            from: way.from,
            to: way.from,
        };
        self.others.iter().filter_map(move |(id, (said, at))| {
            let silent = now.since(*at);
            let mut other = *said;
            if silent > THERE_AFTER && Manner::of(other) == Manner::FliesOn {
                other.from = other.to;
            }
            let flies_alike = Manner::of(other) == Manner::FliesOn
                && ((way.to - way.from).0 - (other.to - other.from).0).norm() < ALIKE_M;
            let is_in_the_way = silent <= FORGOTTEN_AFTER
                && !flies_alike
                && way.comes_near(other, self.separation)
                && !here.comes_near(other, self.separation);
            is_in_the_way.then_some((*id, other))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SEPARATION: Separation = Separation {
        horizontal_m: 5.0,
        vertical_m: 5.0,
    };

    fn at(north_m: f64, east_m: f64, altitude_m: f64) -> Ned {
        Ned::new(north_m, east_m, -altitude_m)
    }

    fn way(from: Ned, to: Ned) -> Way {
        Way { from, to }
    }

    fn seconds(seconds: f64) -> Timestamp {
        Timestamp::from_secs_f64(seconds)
    }

    /// What drone 5 knows that has heard this of others just now.
    fn traffic(said: &[(u32, Way)]) -> Traffic {
        let mut traffic = Traffic::new(NodeId(5), SEPARATION);
        for (id, way) in said {
            assert!(traffic.hears(seconds(0.0), NodeId(*id), Some(Intent::of(*way))));
        }
        traffic
    }

    #[test]
    fn what_is_said_is_the_way_to_five_centimetres() {
        let flown = way(at(1.04, -2.26, 30.0), at(-1_000.0, 3.0, 12.31));
        let said = Intent::of(flown).way();
        assert!(said.from.distance_m(flown.from) < 0.09 && said.to.distance_m(flown.to) < 0.09);
        let far = at(1e300, f64::NAN, 0.0);
        assert_eq!(Intent::of(way(far, far)).from_dm, [i32::MAX, 0, 0]);
    }

    #[test]
    fn nobody_begins_a_way_through_one_that_stands_still() {
        let there = at(60.0, 0.0, 12.0);
        let mut known = traffic(&[(2, way(there, there))]);
        let leg = way(at(0.0, 0.0, 12.0), at(160.0, 0.0, 12.0));
        assert!(!known.is_free(seconds(1.0), leg));
        assert!(known.is_free(seconds(1.0), way(leg.from, at(50.0, 0.0, 12.0))));
        let above = way(at(0.0, 0.0, 18.0), at(160.0, 0.0, 18.0));
        assert!(known.is_free(seconds(1.0), above));
        // It has gone on, the same way: whoever is behind it may follow.
        let ahead = way(there, at(220.0, 0.0, 12.0));
        assert!(known.hears(seconds(1.0), NodeId(2), Some(Intent::of(ahead))));
        assert!(
            !known.hears(seconds(1.5), NodeId(2), Some(Intent::of(ahead))),
            "no news"
        );
        assert!(known.is_free(seconds(2.0), leg));
        known.hears(seconds(3.0), NodeId(2), Some(Intent::of(way(there, there))));
        assert!(!known.is_free(seconds(3.0), leg));
        assert!(known.hears(seconds(4.0), NodeId(2), None) && known.is_free(seconds(4.0), leg));
    }

    #[test]
    fn whoever_is_too_near_already_does_not_hold_a_drone_there() {
        let there = at(3.0, 0.0, 12.0);
        let known = traffic(&[(2, way(there, there))]);
        let away = way(at(0.0, 0.0, 12.0), at(-50.0, 0.0, 12.0));
        assert!(known.is_free(seconds(1.0), away));
    }

    #[test]
    fn of_two_that_begin_at_once_one_stops() {
        let north = way(at(0.0, 0.0, 12.0), at(100.0, 0.0, 12.0));
        let east = way(at(50.0, -50.0, 12.0), at(50.0, 50.0, 12.0));
        let up = way(at(50.0, 0.0, 5.0), at(50.0, 0.0, 30.0));
        let still = way(up.to, up.to);
        let stops =
            |own: Way, id: u32, other: Way| traffic(&[(id, other)]).gives_way(seconds(0.1), own);
        assert!(stops(north, 4, east) && !stops(north, 6, east));
        assert!(stops(north, 6, up) && !stops(up, 4, north));
        assert!(stops(up, 6, still));
        assert!(!stops(way(at(0.0, 0.0, 40.0), at(100.0, 0.0, 40.0)), 4, up));
    }

    #[test]
    fn round_one_that_stays_leads_a_way_that_is_free() {
        let (below, above) = (at(0.0, 0.0, 12.0), at(0.0, 0.0, 24.0));
        let amid = at(0.0, 0.0, 18.0);
        let known = traffic(&[(2, way(amid, amid))]);
        let [side, level] = known.way_round(seconds(1.0), way(below, above)).unwrap();
        assert_eq!((side.altitude_m(), level.altitude_m()), (12.0, 24.0));
        assert!((side.horizontal_distance_m(below) - 11.0).abs() < 1e-9);
        let climbs = traffic(&[(2, way(amid, above))]);
        assert_eq!(
            climbs.way_round(seconds(1.0), way(below, above)),
            None,
            "it goes"
        );
        // One that stands where the way ends leaves none.
        let there = traffic(&[(2, way(above, above))]);
        assert_eq!(there.way_round(seconds(1.0), way(below, above)), None);
        // On a leg, and with another beside it: on the other side, or farther out.
        let leg = way(at(0.0, 0.0, 12.0), at(100.0, 0.0, 12.0));
        let (ahead, beside) = (at(60.0, 0.0, 12.0), at(10.0, 10.0, 12.0));
        let known = traffic(&[(2, way(ahead, ahead)), (3, way(beside, beside))]);
        let [side, level] = known.way_round(seconds(1.0), leg).unwrap();
        assert_eq!(side, level);
        assert!(side.east_m() < -9.0, "{side:?}");
    }

    #[test]
    fn one_that_has_fallen_silent_is_thought_to_be_there_for_a_while() {
        let there = at(60.0, 0.0, 12.0);
        let known = traffic(&[(2, way(there, there))]);
        let leg = way(at(0.0, 0.0, 12.0), at(160.0, 0.0, 12.0));
        assert!(!known.is_free(seconds(30.0), leg) && known.is_free(seconds(30.1), leg));
        // One that was on its way has arrived, where it can't be heard.
        let known = traffic(&[(2, way(there, at(60.0, 500.0, 12.0)))]);
        assert!(!known.is_free(seconds(5.0), leg) && known.is_free(seconds(5.1), leg));
    }
}
