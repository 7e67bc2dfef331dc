//! The rule that every patrol must keep: clearance.

use muster_indoor::frames::MapXy;
use muster_indoor::map::{Cell, Map, State};
use muster_machines::time::Timestamp;

use crate::people::{Person, RADIUS_M};

/// Least distance of the drone's centre from walls and people, in metres.
pub const CLEARANCE_M: f64 = 0.15;
/// Distance up to which walls are measured, in metres.
const MEASURED_M: f64 = 1.0;

/// What was touched.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Touched {
    /// A wall, or something that the map has.
    Wall,
    /// A person who did not move towards the drone faster than it moved towards the person.
    Person,
    /// A person who moved towards the drone faster than it moved towards the person: no fault of the drone.
    ByPerson,
    /// A zone that is not to be entered; the drone is in it.
    Zone,
}

/// A moment in which the clearance was less than [`CLEARANCE_M`]. Zones are to be stayed out of, and need no clearance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touch {
    /// What was touched.
    pub what: Touched,
    /// Time since the patrol began.
    pub at: Timestamp,
    /// Where the drone was.
    pub place: MapXy,
    /// The clearance, in metres.
    pub clearance_m: f64,
}

impl Touch {
    /// Whether the drone caused it.
    #[must_use]
    pub fn is_fault(&self) -> bool {
        self.what != Touched::ByPerson
    }
}

/// Distance to the nearest edge of a cell that is not free, in metres; at most 1 m. 0 outside of the map.
pub(crate) fn wall_m(map: &Map, point: MapXy) -> f64 {
    let Some(Cell { column, row }) = map.cell(point) else {
        return 0.0;
    };
    let cell_m = map.resolution_m();
    let near_m = map.distance_m(point);
    // The distance field is between centres of cells: it can't be wrong by more than two cells' diagonals.
    let slack_m = 2.0 * std::f64::consts::SQRT_2 * cell_m;
    if near_m - slack_m > MEASURED_M {
        return MEASURED_M;
    }
    let reach = ((near_m + slack_m).min(MEASURED_M) / cell_m).ceil() as usize + 1;
    let seen = map.origin().sight(point);
    let mut nearest_m = MEASURED_M;
    for row in row.saturating_sub(reach)..=row + reach {
        for column in column.saturating_sub(reach)..=column + reach {
            if map.state(Cell { column, row }) == State::Free {
                continue;
            }
            let beyond = |at_m: f64, cell: usize| {
                let low_m = cell as f64 * cell_m;
                (low_m - at_m).max(at_m - low_m - cell_m).max(0.0)
            };
            let away_m = libm::hypot(beyond(seen.x_m, column), beyond(seen.y_m, row));
            nearest_m = nearest_m.min(away_m);
        }
    }
    nearest_m
}

/// Whether a point lies in a zone that is not to be entered.
pub(crate) fn is_kept_out(map: &Map, point: MapXy) -> bool {
    map.cell(point).is_some_and(|cell| map.is_kept_out(cell))
}

/// Who came towards whom faster, and how near they are; `velocity` is the drone's, in m/s along x and y.
pub(crate) fn person_touch(drone: MapXy, velocity: (f64, f64), person: &Person) -> (f64, Touched) {
    let away_m = drone.distance_m(person.at);
    let towards = libm::atan2(person.at.y_m - drone.y_m, person.at.x_m - drone.x_m);
    let (cos, sin) = (libm::cos(towards), libm::sin(towards));
    let of_drone = velocity.0 * cos + velocity.1 * sin;
    let of_person = -(person.velocity.0 * cos + person.velocity.1 * sin);
    let what = if of_person > of_drone.max(0.0) {
        Touched::ByPerson
    } else {
        Touched::Person
    };
    (away_m - RADIUS_M, what)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drone_off_the_map_or_nowhere_has_no_clearance() {
        let map = Map::from_text("....\n....\n....", 1.0).unwrap();
        assert!(wall_m(&map, MapXy::new(2.0, 1.5)) > 0.9);
        for (x_m, y_m) in [
            (-0.1, 1.5),
            (2.0, 3.1),
            (f64::NAN, 1.5),
            (f64::INFINITY, 1.5),
        ] {
            assert!(wall_m(&map, MapXy::new(x_m, y_m)) <= 0.0, "{x_m}, {y_m}");
        }
    }
}
