//! GeoJSON (RFC 7946): a line of each drone with its times, a point for each mark.

use muster_machines::geometry::Ned;
use serde_json::{Value, json};

use super::place::{Place, home, marks, place, rounded};
use crate::report::{Flight, Report};

/// The run as a collection of features, with a final line feed.
pub(super) fn geojson(report: &Report, flight: &Flight) -> Vec<u8> {
    let home = home(flight);
    let position = |at: Ned| {
        let Place {
            latitude_deg,
            longitude_deg,
            altitude_m,
        } = place(home, at);
        json!([longitude_deg, latitude_deg, altitude_m])
    };
    let swarms = report.swarms().zip(flight.swarms());
    let drones = swarms.flat_map(|(report, flight)| report.drones.iter().zip(&flight.drones));
    let drones = drones.map(|(drone, flown)| {
        let positions: Vec<Value> = flown.track.iter().map(|(_, at)| position(*at)).collect();
        let times: Vec<f64> = flown
            .track
            .iter()
            .map(|(at, _)| rounded(at.as_secs_f64(), 1e3))
            .collect();
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
    });
    let points = marks(report, flight).map(|(mark, at)| {
        json!({
            "type": "Feature",
            "geometry": {"type": "Point", "coordinates": position(at)},
            "properties": {
                "kind": mark.kind.name(),
                "time_s": rounded(mark.at.as_secs_f64(), 1e3),
                "until_s": mark.until.map(|until| rounded(until.as_secs_f64(), 1e3)),
                "drones": mark.nodes,
                "text": mark.text,
            },
        })
    });
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
