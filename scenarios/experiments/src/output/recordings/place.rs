//! Where things are on the Earth, and at which time of day.

use muster_machines::geodetic::{Geodetic, latitude_longitude_altitude};
use muster_machines::geometry::Ned;
use muster_machines::time::Timestamp;
use muster_scenarios::report::{Flight, Mark, MarkKind, Report};

/// A place on the Earth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Place {
    pub(super) latitude_deg: f64,
    pub(super) longitude_deg: f64,
    /// Above sea level.
    pub(super) altitude_m: f64,
}

/// The place on the Earth of a position in the world's frame.
pub(super) fn place(home: Geodetic, position: Ned) -> Place {
    let [latitude_deg, longitude_deg, altitude_m] = latitude_longitude_altitude(home, position);
    // 1e-8 degrees are a millimetre.
    Place {
        latitude_deg: rounded(latitude_deg, 1e8),
        longitude_deg: rounded(longitude_deg, 1e8),
        altitude_m: rounded(altitude_m, 1e2),
    }
}

/// A value rounded to a fraction; never a negative zero.
pub(super) fn rounded(value: f64, per_unit: f64) -> f64 {
    (value * per_unit).round() / per_unit + 0.0
}

/// Home of a run; the origin of coordinates if it is not known, as in reports made by hand.
pub(super) fn home(flight: &Flight) -> Geodetic {
    let null_island = || Geodetic::new(0.0, 0.0, 0.0).expect("the origin is on the Earth");
    flight.history.home.unwrap_or_else(null_island)
}

/// A time of a run as a date: runs have none, so they start with 1970.
pub(super) fn date(at: Timestamp) -> String {
    let milliseconds = at.as_nanos() / 1_000_000;
    let (seconds, milliseconds) = (milliseconds / 1_000, milliseconds % 1_000);
    let (days, seconds) = (seconds / 86_400, seconds % 86_400);
    let (hours, minutes, seconds) = (seconds / 3_600, seconds / 60 % 60, seconds % 60);
    // The longest flights are far below a month.
    format!(
        "1970-01-{:02}T{hours:02}:{minutes:02}:{seconds:02}.{milliseconds:03}Z",
        days + 1
    )
}

/// All marks but those of waypoints, of all swarms, each with where it was: at its first node, or amid those that fly.
pub(super) fn marks<'a>(
    report: &'a Report,
    flight: &'a Flight,
) -> impl Iterator<Item = (&'a Mark, Ned)> {
    let swarms = report.swarms().zip(flight.swarms());
    swarms.flat_map(|(report, flight)| {
        let marks = flight.history.marks.iter();
        let marks = marks.filter(|mark| mark.kind != MarkKind::Waypoint);
        marks.filter_map(|mark| Some((mark, where_of(mark, report, flight)?)))
    })
}

fn where_of(mark: &Mark, report: &Report, flight: &Flight) -> Option<Ned> {
    let drones = || report.drones.iter().zip(&flight.drones);
    let first = mark.nodes.first();
    let of_first = first.and_then(|id| drones().find(|(drone, _)| drone.id == *id));
    let relay = first.and_then(|id| report.relays.iter().find(|relay| relay.id == *id));
    if let Some((_, drone)) = of_first {
        return drone.position_at(mark.at);
    }
    if let Some(relay) = relay {
        return Some(Ned::new(relay.north_m, relay.east_m, -relay.altitude_m));
    }
    let places: Vec<_> = drones()
        .filter_map(|(_, drone)| drone.position_at(mark.at))
        .collect();
    let sum = places.iter().copied().reduce(|a, b| a + b)?;
    Some(Ned(sum.0 / places.len() as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_starts_with_1970() {
        assert_eq!(date(Timestamp::ZERO), "1970-01-01T00:00:00.000Z");
        let later = Timestamp::from_secs_f64(90_061.25);
        assert_eq!(date(later), "1970-01-02T01:01:01.250Z");
    }
}
