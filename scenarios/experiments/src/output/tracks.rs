//! Positions of all drones as CSV.

use muster_machines::geometry::Ned;
use muster_machines::mission::State;
use muster_machines::time::Timestamp;
use muster_scenarios::report::{Flight, Report};

/// The columns of `tracks.csv`, and what they mean.
pub const TRACK_COLUMNS: [(&str, &str); 6] = [
    (
        "time_s",
        "Time, in simulated seconds from the start of the run.",
    ),
    ("drone", "Drone id."),
    ("north_m", "Metres north of home."),
    ("east_m", "Metres east of home."),
    ("altitude_m", "Metres above home."),
    ("state", "Mission state at this time."),
];

/// All track points as CSV with a header, one row per point, ordered by time and drone.
///
/// Times are in simulated seconds, positions in metres from home, both with three decimals.
#[must_use]
pub fn tracks(report: &Report, flight: &Flight) -> Vec<u8> {
    let swarms = report.swarms().zip(flight.swarms());
    let drones = swarms.flat_map(|(report, flight)| report.drones.iter().zip(&flight.drones));
    let mut points: Vec<(Timestamp, u32, Ned, State)> = drones
        .map(|(report, drone)| (report.id, drone))
        .flat_map(|(id, drone)| {
            let point = move |&(at, place)| (at, id, place, drone.state_at(at));
            drone.track.iter().map(point)
        })
        .collect();
    points.sort_by_key(|&(at, id, ..)| (at, id));

    let mut rows = csv::Writer::from_writer(Vec::new());
    let memory = "writing to a vector never fails";
    let names = TRACK_COLUMNS.map(|(name, _)| name);
    rows.write_record(names).expect(memory);
    for (at, id, place, state) in points {
        rows.write_record([
            decimal(at.as_secs_f64()),
            id.to_string(),
            decimal(place.north_m()),
            decimal(place.east_m()),
            decimal(place.altitude_m()),
            state.to_string(),
        ])
        .expect(memory);
    }
    rows.into_inner().expect(memory)
}

/// `value` with three decimals; never a negative zero.
fn decimal(value: f64) -> String {
    format!("{:.3}", (value * 1e3).round() / 1e3 + 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::sample;

    #[test]
    fn points_are_rows_ordered_by_time_and_drone() {
        let (report, flight) = sample::swarm(3);
        let bytes = tracks(&report, &flight);
        let mut reader = csv::Reader::from_reader(bytes.as_slice());
        let names = TRACK_COLUMNS.map(|(name, _)| name);
        assert_eq!(reader.headers().unwrap(), names.as_slice());
        let keys: Vec<(f64, u32)> = reader
            .records()
            .map(|row| row.unwrap())
            .map(|row| (row[0].parse().unwrap(), row[1].parse().unwrap()))
            .collect();
        assert!(keys.is_sorted());
        let points: usize = flight.drones.iter().map(|drone| drone.track.len()).sum();
        assert_eq!(keys.len(), points);
    }

    #[test]
    fn row_holds_the_state_of_the_drone() {
        let (report, flight) = sample::swarm(1);
        let text = String::from_utf8(tracks(&report, &flight)).unwrap();
        assert_eq!(text.lines().nth(1), Some("0.000,0,0.000,0.000,0.000,start"));
        assert!(text.lines().last().unwrap().ends_with(",finished"));
    }

    #[test]
    fn zero_is_never_negative() {
        assert_eq!(decimal(-0.0001), "0.000");
        assert_eq!(decimal(-1.5), "-1.500");
    }
}
