//! Recordings of a run in which the master is killed at a waypoint.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use muster_scenarios::engine::{self, Engine};
use muster_scenarios::report::{Flight, ObservedValue, Report};
use muster_scenarios::scenario::load;
use serde_json::Value;

use super::{Recording, WriteError, animation, geojson, kml};

fn flown() -> (Report, Flight) {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/..")).join("kill-at-waypoint.toml");
    engine::run(&load(&path, &[]).unwrap(), Engine::Events, None).unwrap()
}

fn bytes(recording: Recording, (report, flight): &(Report, Flight)) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    recording.write(&path, report, flight).unwrap();
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    std::fs::read(path).unwrap()
}

#[test]
fn recordings_of_equal_runs_are_equal() {
    let (first, second) = (flown(), flown());
    for recording in Recording::ALL {
        assert!(
            bytes(recording, &first) == bytes(recording, &second),
            "{recording}"
        );
    }
}

#[test]
fn recording_that_fails_keeps_the_file_before() {
    let run = flown();
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("missing/run.kml");
    let refused = Recording::Kml.write(&missing, &run.0, &run.1).unwrap_err();
    assert!(matches!(refused, WriteError::File { .. }), "{refused:?}");
    let taken = folder.path().join("taken");
    std::fs::create_dir(&taken).unwrap();
    Recording::Kml.write(&taken, &run.0, &run.1).unwrap_err();
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn mcap_is_read_back_with_all_topics_and_valid_messages() {
    let mut run = flown();
    let found = |at_s, value| ObservedValue {
        at_s,
        drone: 3,
        name: "finds".to_owned(),
        value,
    };
    run.0.observed = vec![found(20.5, 1.0), found(21.0, f64::NAN), found(30.0, 2.0)];
    let file = bytes(Recording::Mcap, &run);
    let mut messages: BTreeMap<String, Vec<Value>> = BTreeMap::new();
    let mut schemas = BTreeMap::new();
    for message in ::mcap::MessageStream::new(&file).unwrap() {
        let message = message.unwrap();
        let schema = message.channel.schema.as_ref().unwrap();
        assert_eq!(
            (
                schema.encoding.as_str(),
                message.channel.message_encoding.as_str()
            ),
            ("jsonschema", "json")
        );
        let parsed: Value = serde_json::from_slice(&schema.data).unwrap();
        assert_eq!(parsed["title"], schema.name);
        schemas.insert(message.channel.topic.clone(), schema.name.clone());
        let value = serde_json::from_slice(&message.data).unwrap();
        messages
            .entry(message.channel.topic.clone())
            .or_default()
            .push(value);
    }
    assert_eq!(schemas["/scene"], "foxglove.SceneUpdate");
    assert_eq!(schemas["/log"], "foxglove.Log");
    assert_eq!(schemas["/drones/3/location"], "foxglove.LocationFix");
    assert_eq!(schemas["/drones/3/values"], "muster.Value");
    assert_eq!(schemas.len(), 4 + 2 * 7);
    let values = messages["/drones/3/values"].iter();
    let values: Vec<_> = values.map(|it| (&it["timestamp"], &it["value"])).collect();
    let time = |sec: u32, nsec: u32| serde_json::json!({"sec": sec, "nsec": nsec});
    let (first, second) = (time(20, 500_000_000), time(30, 0));
    assert_eq!(
        values,
        [(&first, &Value::from(1.0)), (&second, &Value::from(2.0))]
    );
    let log: Vec<&str> = messages["/log"]
        .iter()
        .filter_map(|it| it["message"].as_str())
        .collect();
    assert!(
        log.iter()
            .any(|it| it.starts_with("drone 3, a leader, is dead")),
        "{log:?}"
    );
    assert!(
        log.iter().any(|it| it.starts_with("drone 2 leads")),
        "{log:?}"
    );
    let last = messages["/swarm"]
        .iter()
        .rev()
        .find(|it| it["leaders"][0].is_object())
        .unwrap();
    let leaders: BTreeSet<u64> = last["leaders"]
        .as_array()
        .unwrap()
        .iter()
        .filter_map(|it| it["drone"].as_u64())
        .collect();
    assert!(leaders.is_subset(&BTreeSet::from([2, 4])), "{leaders:?}");
    let dead = messages["/drones/3/state"].last().unwrap();
    assert_eq!(
        (dead["condition"].as_str(), dead["airborne"].as_bool()),
        (Some("dead"), Some(false))
    );
}

#[test]
fn kml_has_a_track_of_each_drone_and_a_point_of_each_mark() {
    let (report, flight) = flown();
    let text = kml::kml(&report, &flight);
    let number = |what: &str| text.matches(what).count();
    let points: usize = flight.drones.iter().map(|drone| drone.track.len()).sum();
    assert_eq!(number("<gx:Track>"), 7);
    assert_eq!(
        (
            number("<gx:coord>"),
            number("<when>") - number("<TimeStamp>")
        ),
        (points, points)
    );
    assert!(text.contains("drone 3, a leader, is dead"));
    // The mission's home: 41.765 N, 0.815 W, 245 m above sea level.
    assert!(text.contains("<altitudeMode>absolute</altitudeMode>"));
    assert!(text.contains("<gx:coord>-0.815 41.765 245</gx:coord>"));
}

#[test]
fn geojson_has_a_line_of_each_drone_with_a_time_for_each_position() {
    let (report, flight) = flown();
    let collection: Value = serde_json::from_slice(&geojson::geojson(&report, &flight)).unwrap();
    let features = collection["features"].as_array().unwrap();
    let lines: Vec<_> = features
        .iter()
        .filter(|it| it["geometry"]["type"] == "LineString")
        .collect();
    assert_eq!(lines.len(), 7);
    for line in lines {
        let positions = line["geometry"]["coordinates"].as_array().unwrap();
        assert_eq!(
            positions.len(),
            line["properties"]["times_s"].as_array().unwrap().len()
        );
        let [longitude, latitude] = [0, 1].map(|at| positions[0][at].as_f64().unwrap());
        assert!((longitude + 0.815).abs() < 0.01 && (latitude - 41.765).abs() < 0.01);
    }
    let kinds: BTreeSet<_> = features
        .iter()
        .filter_map(|it| it["properties"]["kind"].as_str())
        .collect();
    for kind in ["fault", "death", "election", "leader", "partition"] {
        assert!(kinds.contains(kind), "{kind}: {kinds:?}");
    }
}

#[test]
fn animation_is_small_plays_the_death_and_loads_nothing() {
    let (report, flight) = flown();
    let svg = animation::svg(&report, &flight);
    assert!(svg.len() < 300_000, "{}", svg.len());
    assert!(
        svg.contains("a leader, is dead")
            && svg.contains("drone 2 leads")
            && svg.contains("slow motion")
    );
    for outside in ["<script", "href", "url(", "@import"] {
        assert!(!svg.contains(outside), "{outside}");
    }
}
