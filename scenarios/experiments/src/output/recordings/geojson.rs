//! GeoJSON (RFC 7946): a line of each drone with its times, a point for each mark.

use muster_machines::geodetic::Geodetic;
use muster_machines::geometry::Ned;
use muster_machines::time::Timestamp;
use muster_scenarios::report::{DroneReport, Flight, FlightOfDrone, Mark, Report};
use serde_json::{Value, json};

use super::place::{Place, home, marks, place, rounded};

/// The run as a collection of features, with a final line feed.
pub(super) fn geojson(report: &Report, flight: &Flight) -> Vec<u8> {
    let home = home(flight);
    let swarms = report.swarms().zip(flight.swarms());
    let drones = swarms.flat_map(|(report, flight)| report.drones.iter().zip(&flight.drones));
    let drones = drones.map(|(drone, flown)| line(home, drone, flown));
    let points = marks(report, flight).map(|(mark, at)| point(home, mark, at));
    let features: Vec<Value> = drones.chain(points).collect();
    let collection = json!({
        "type": "FeatureCollection",
        "features": features,
        "scenario": report.scenario,
        "seed": report.seed,
    });
    let mut bytes = serde_json::to_vec(&collection).expect("a tree of JSON is JSON");
    bytes.push(b'\n');
    bytes
}

/// The track of a drone.
fn line(home: Geodetic, drone: &DroneReport, flown: &FlightOfDrone) -> Value {
    let positions = flown.track.iter().map(|(_, at)| position(home, *at));
    let positions: Vec<Value> = positions.collect();
    let times = flown.track.iter().map(|(at, _)| seconds(*at));
    let times: Vec<f64> = times.collect();
    // A line has two positions at least.
    let geometry = match &positions[..] {
        [] => Value::Null,
        [only] => json!({"type": "Point", "coordinates": only}),
        _ => json!({"type": "LineString", "coordinates": positions}),
    };
    json!({
        "type": "Feature",
        "id": format!("drone-{}", drone.id),
        "geometry": geometry,
        "properties": {
            "kind": "drone",
            "drone": drone.id,
            "role": drone.role,
            "state": drone.state,
            "flight_time_s": drone.flight_time_s,
            "times_s": times,
        },
    })
}

/// A mark, at its place.
fn point(home: Geodetic, mark: &Mark, at: Ned) -> Value {
    json!({
        "type": "Feature",
        "geometry": {"type": "Point", "coordinates": position(home, at)},
        "properties": {
            "kind": mark.kind.name(),
            "time_s": seconds(mark.at),
            "until_s": mark.until.map(seconds),
            "drones": mark.nodes,
            "text": mark.text,
        },
    })
}

fn position(home: Geodetic, at: Ned) -> Value {
    let Place {
        latitude_deg,
        longitude_deg,
        altitude_m,
    } = place(home, at);
    json!([longitude_deg, latitude_deg, altitude_m])
}

fn seconds(at: Timestamp) -> f64 {
    rounded(at.as_secs_f64(), 1e3)
}
