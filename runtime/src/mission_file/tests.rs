mod fence;
mod formats;
mod home;
mod kml;
mod order;
mod properties;
mod refusals;
mod route;

use std::fmt::Write as _;

use super::*;
use crate::diagnostic::tests::rendered;

const ALBUFERA: &str = include_str!("../../../scenarios/missions/albufera.plan");

const RIVER: &str = include_str!("../../../scenarios/missions/river.waypoints");

/// A waypoints file with a take-off and two waypoints.
const SHORT: &str = "\
QGC WPL 110
0 1 0 16 0 0 0 0 39.333 -0.3085 2 1
1 0 3 22 0 0 0 0 0 0 25 1
2 0 3 16 0 0 0 0 39.336 -0.3085 25 1
3 0 3 16 0 0 0 0 39.339 -0.3085 30 1
";

const PLAN: &str = r#"{
  "fileType": "Plan",
  "mission": {
    "items": [
      {"autoContinue":true,"command":22,"frame":3,"params":[0,0,0,null,39.333,-0.3085,25],"type":"SimpleItem"},
      {"autoContinue":true,"command":16,"frame":3,"params":[0,0,0,null,39.336,-0.3085,25],"type":"SimpleItem"},
      {"autoContinue":true,"command":16,"frame":3,"params":[0,0,0,null,39.339,-0.3085,25],"type":"SimpleItem"},
      {"autoContinue":true,"command":20,"frame":2,"params":[0,0,0,0,0,0,0],"type":"SimpleItem"}
    ],
    "plannedHomePosition": [39.333, -0.3085, 2],
    "version": 2
  },
  "version": 1
}
"#;

const KML: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<kml xmlns="http://www.opengis.net/kml/2.2"><Document><Placemark>
  <LineString>
    <altitudeMode>relativeToGround</altitudeMode>
    <coordinates>
      -0.3085,39.333,25 -0.3085,39.336,25
      -0.3085,39.339,30
    </coordinates>
  </LineString>
</Placemark></Document></kml>
"#;

/// A plan with a fence: an exclusion circle 1 km east of home, and a concave inclusion polygon.
const FENCED: &str = r#"{
  "fileType": "Plan",
  "geoFence": {
    "circles": [
      {"circle": {"center": [39.333, -0.2969], "radius": 50}, "inclusion": false, "version": 1}
    ],
    "polygons": [
      {"inclusion": true, "polygon": [
        [39.328, -0.3143],
        [39.344, -0.3143],
        [39.344, -0.3027],
        [39.336, -0.3073],
        [39.328, -0.3027]
      ], "version": 1}
    ],
    "version": 2
  },
  "mission": {
    "items": [
      {"autoContinue":true,"command":22,"frame":3,"params":[0,0,0,null,39.333,-0.3085,25],"type":"SimpleItem"},
      {"autoContinue":true,"command":16,"frame":3,"params":[0,0,0,null,39.339,-0.3085,25],"type":"SimpleItem"},
      {"autoContinue":true,"command":20,"frame":2,"params":[0,0,0,0,0,0,0],"type":"SimpleItem"}
    ],
    "plannedHomePosition": [39.333, -0.3085, 2],
    "version": 2
  },
  "version": 1
}
"#;

fn mission(text: &str) -> Mission {
    parse(Path::new("given"), text).unwrap_or_else(|error| panic!("{}", rendered(&error)))
}

fn short_with(lines: &str) -> Mission {
    mission(&format!("{SHORT}{lines}"))
}

fn heights(mission: &Mission) -> Vec<f64> {
    mission
        .waypoints()
        .iter()
        .map(|point| point.altitude_m())
        .collect()
}

/// Waypoints with a hold, and its seconds.
fn holds_s(mission: &Mission) -> Vec<(u16, f64)> {
    let holds = mission.holds().iter();
    holds.map(|(at, hold)| (at, hold.as_secs_f64())).collect()
}

fn notes(mission: &Mission) -> Vec<String> {
    mission.notes().iter().map(Note::to_string).collect()
}

/// Converts a plan to a waypoints file, without this crate's reader.
fn as_waypoints(plan: &str) -> String {
    let plan: serde_json::Value = serde_json::from_str(plan).unwrap();
    let mission = &plan["mission"];
    let home = &mission["plannedHomePosition"];
    let mut text = format!(
        "QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t{}\t{}\t{}\t1\n",
        home[0], home[1], home[2]
    );
    for (index, item) in mission["items"].as_array().unwrap().iter().enumerate() {
        write!(
            text,
            "{}\t0\t{}\t{}",
            index + 1,
            item["frame"],
            item["command"]
        )
        .unwrap();
        for parameter in item["params"].as_array().unwrap() {
            match parameter {
                serde_json::Value::Null => text.push_str("\tnan"),
                number => write!(text, "\t{number}").unwrap(),
            }
        }
        text.push_str("\t1\n");
    }
    text
}

/// Each leg's horizontal length in metres and its heading in degrees east of north.
fn legs(mission: &Mission) -> Vec<(f64, f64)> {
    mission
        .waypoints()
        .windows(2)
        .map(|pair| {
            let leg = pair[1] - pair[0];
            let heading = libm::atan2(leg.east_m(), leg.north_m()).to_degrees();
            (pair[1].horizontal_distance_m(pair[0]), heading)
        })
        .collect()
}
