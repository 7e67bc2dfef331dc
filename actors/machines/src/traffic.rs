//! Drones near each other: where each says that it is and goes, and who gives way to whom.
//!
//! Nobody begins a way that comes too near to another's. Two that begin at the same moment do not know of each other yet:
//! once they do, one of them stops. Both find the same one: it is the other that goes on if that stands still or flies
//! straight up or down, and of two that do the same the one with the lower number.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::formation::{Separation, Way};
use crate::geometry::Ned;
use crate::identity::NodeId;
use crate::time::Timestamp;

/// For how long a drone may be silent that is thought to be in the air where it said: as ArduPilot's `FS_GCS_TIMEOUT`, after
/// which a flight controller comes down that hears nothing of its computer.
const SILENT_AFTER: Duration = Duration::from_secs(5);
/// For how long a silent drone is thought to be on its way down: 120 m at 1 m/s.
const FORGOTTEN_AFTER: Duration = Duration::from_secs(125);
/// Two ways of which one is the other elsewhere, for their lengths and directions differ by no more than this, in metres.
const ALIKE_M: f64 = 1.0;
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
    pub(crate) fn is_free(&mut self, now: Timestamp, way: Way) -> bool {
        self.forget(now);
        self.near(now, way).next().is_none()
    }

    /// Whether the rest of a way that is being flown is another's to fly first.
    pub(crate) fn gives_way(&self, now: Timestamp, way: Way) -> bool {
        let own = (Manner::of(way), self.own);
        let mut near = self.near(now, way);
        near.any(|(id, other)| (Manner::of(other), id) < own)
    }

    /// Who is too near a way, or on one that comes too near it. Nobody who flies the same way elsewhere, for it stays as far;
    /// and nobody who is too near where the way begins, for to wait there would not help.
    fn near(&self, now: Timestamp, way: Way) -> impl Iterator<Item = (NodeId, Way)> {
        let here = Way {
            from: way.from,
            to: way.from,
        };
        self.others.iter().filter_map(move |(id, (said, at))| {
            let is_silent = now.since(*at) > SILENT_AFTER;
            let other = if is_silent {
                Way {
                    from: said.to,
                    to: said.to.at_altitude(said.to.altitude_m().min(0.0)),
                }
            } else {
                *said
            };
            let flies_alike = !is_silent
                && Manner::of(other) == Manner::FliesOn
                && ((way.to - way.from).0 - (other.to - other.from).0).norm() < ALIKE_M;
            let is_in_the_way = !flies_alike
                && way.comes_near(other, self.separation)
                && !here.comes_near(other, self.separation);
            is_in_the_way.then_some((*id, other))
        })
    }

    fn forget(&mut self, now: Timestamp) {
        self.others
            .retain(|_, (_, at)| now.since(*at) <= FORGOTTEN_AFTER);
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
        let mut known = traffic(&[(2, way(there, there))]);
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
    fn below_one_that_has_fallen_silent_nobody_passes_until_it_must_be_down() {
        let there = at(60.0, 0.0, 30.0);
        let mut known = traffic(&[(2, way(there, there))]);
        let below = way(at(0.0, 0.0, 12.0), at(160.0, 0.0, 12.0));
        let above = way(at(0.0, 0.0, 36.0), at(160.0, 0.0, 36.0));
        assert!(known.is_free(seconds(4.0), below));
        assert!(!known.is_free(seconds(6.0), below) && known.is_free(seconds(6.0), above));
        assert!(known.is_free(seconds(126.0), below));
    }
}
