use std::path::Path;

use muster_scenarios::engine::{self, Engine};
use muster_scenarios::report::{Flight, ObservedValue, Report};
use muster_scenarios::scenario::load;
use serde_json::Value;

use super::values::{NAMES_MAX, POINTS_MAX};
use crate::output::sample::leaning;
use crate::output::{page, sample};

fn flown(name: &str) -> (Report, Flight) {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/..")).join(name);
    engine::run(&load(&path, &[]).unwrap(), Engine::Events, None).unwrap()
}

fn record((report, flight): &(Report, Flight)) -> Value {
    serde_json::to_value(super::record::record(report, flight)).unwrap()
}

/// Times in seconds, nodes and texts of the marks of a kind.
fn marks(record: &Value, kind: &str) -> Vec<(f64, Vec<u64>, String)> {
    let kinds = record["kinds"].as_array().unwrap();
    let index = kinds.iter().position(|it| it == kind).unwrap();
    let all = record["marks"].as_array().unwrap().iter();
    all.filter(|mark| mark["kind"] == index)
        .map(|mark| {
            let nodes = mark["nodes"].as_array().unwrap().iter();
            (
                mark["at"].as_f64().unwrap() / 1e3,
                nodes.map(|id| id.as_u64().unwrap()).collect(),
                mark["text"].as_str().unwrap().to_owned(),
            )
        })
        .collect()
}

fn integers(list: &Value) -> Vec<i64> {
    let list = list.as_array().unwrap().iter();
    list.map(|it| it.as_i64().unwrap()).collect()
}

#[test]
fn record_has_the_fault_the_death_the_election_and_the_new_leaders_at_their_times() {
    let run = flown("kill-at-waypoint.toml");
    let election = run.0.elections[0].clone();
    let record = record(&run);
    let at_s = |kind: &str| {
        marks(&record, kind)
            .iter()
            .map(|mark| mark.0)
            .collect::<Vec<_>>()
    };
    let near = |a: f64, b: f64| (a - b).abs() < 0.001;
    for kind in ["fault", "death", "election", "partition"] {
        let at_s = at_s(kind);
        assert!(
            at_s.len() == 1 && near(at_s[0], election.at_s),
            "{kind}: {at_s:?}"
        );
    }
    assert_eq!(marks(&record, "fault")[0].1, [3]);
    assert_eq!(marks(&record, "death")[0].1, [3]);
    assert_eq!(marks(&record, "partition")[0].2, "partition: 0–2 | 4–6");
    let leaders = marks(&record, "leader");
    let who: Vec<_> = leaders.iter().map(|mark| mark.1[0]).collect();
    assert_eq!(who, [4, 2]);
    assert!(near(
        leaders[0].0,
        election.at_s + election.led_after_s.unwrap()
    ));
}

#[test]
fn dead_drone_comes_down_where_it_was_and_has_no_links() {
    let run = flown("kill-at-waypoint.toml");
    let died_s = run.0.elections[0].at_s;
    let record = record(&run);
    let dead = &record["nodes"][3];
    let condition = integers(&dead["conditions"]);
    let name = &record["conditions"][usize::try_from(condition[1]).unwrap()];
    assert_eq!(name, "dead");
    let (mut point, mut last_north) = ([0; 4], None);
    for delta in integers(&dead["track"]).chunks(4) {
        (point.iter_mut().zip(delta)).for_each(|(value, delta)| *value += delta);
        if point[0] as f64 / 1e3 > died_s + 1.0 {
            let north = *last_north.get_or_insert(point[1]);
            assert!((point[1] - north).abs() <= 5, "{point:?}");
        }
    }
    assert_eq!(point[3], 0, "it is on the ground at the end");
    for link in record["links"].as_array().unwrap() {
        let link = integers(link);
        if link[..2].contains(&3) {
            assert_eq!(link.last(), Some(&0), "{link:?}");
        }
    }
}

#[test]
fn marks_of_two_swarms_say_which_swarm_they_are_of() {
    let run = flown("two-swarms.toml");
    let swarms: Vec<_> = run.0.swarms().map(Report::name).collect();
    let texts = marks(&record(&run), "waypoint").into_iter();
    let texts: Vec<_> = texts.map(|mark| mark.2).collect();
    for swarm in swarms {
        let of_swarm = format!("{swarm}: ");
        assert!(
            texts.iter().any(|it| it.starts_with(&of_swarm)),
            "{texts:?}"
        );
    }
    let alone = marks(&record(&flown("kill-at-waypoint.toml")), "waypoint");
    assert!(alone.iter().all(|mark| !mark.2.contains(": ")));
}

#[test]
fn cut_and_healed_links_are_a_partition_and_a_merge() {
    let run = flown("cut-two-apart.toml");
    let record = record(&run);
    let texts = |kind: &str| {
        marks(&record, kind)
            .into_iter()
            .map(|mark| mark.2)
            .collect::<Vec<_>>()
    };
    assert_eq!(texts("partition")[0], "partition: 0–2 | 3–6");
    assert_eq!(texts("merge")[0], "segments meet: 0–6");
    assert!(texts("fault")[0].starts_with("fault: links cut between 0–2 and 3–6"));
}

#[test]
fn restarted_process_is_off_and_returns() {
    let record = record(&flown("returning-drone.toml"));
    let (off, on) = (marks(&record, "death"), marks(&record, "return"));
    assert!(!off.is_empty() && off.len() == on.len(), "{off:?} {on:?}");
    assert!(off[0].0 < on[0].0 && off[0].1 == on[0].1);
}

#[test]
fn equal_runs_of_both_engines_have_equal_records() {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/..")).join("kill-at-waypoint.toml");
    let of = |engine| {
        let (report, flight) = engine::run(&load(&path, &[]).unwrap(), engine, None).unwrap();
        serde_json::to_string(&super::record::record(&report, &flight)).unwrap()
    };
    let events = of(Engine::Events);
    assert_eq!(events, of(Engine::Events));
    assert_eq!(events, of(Engine::Actors));
}

fn observed(drone: u32, at_s: f64, name: &str, value: f64) -> ObservedValue {
    ObservedValue {
        at_s,
        drone,
        name: name.to_owned(),
        value,
    }
}

#[test]
fn observed_values_are_series_by_name_and_drone() {
    let (mut report, flight) = sample::swarm(3);
    report.observed = vec![
        observed(2, 10.0, "finds", 1.0),
        observed(0, 10.5, "speed", 4.123_456_78),
        observed(1, 11.0, "finds", 1.0),
        observed(2, 12.0, "finds", f64::NAN),
        observed(2, 12.25, "finds", 2.0),
    ];
    let record = record(&(report, flight));
    let series = serde_json::json!([
        {"name": "finds", "thinned": false, "lines": [
            {"drone": 1, "times": [11_000], "values": [1.0]},
            {"drone": 2, "times": [10_000, 12_250], "values": [1.0, 2.0]},
        ]},
        {"name": "speed", "thinned": false, "lines": [
            {"drone": 0, "times": [10_500], "values": [4.12346]},
        ]},
    ]);
    assert_eq!(record["values"]["series"], series);
    assert_eq!(record["values"]["omitted"], serde_json::json!([]));
}

#[test]
fn long_series_keep_their_extremes_and_names_beyond_the_limit_are_listed() {
    let (mut report, flight) = sample::swarm(3);
    let swing = |step: u32| {
        if step == 54_321 {
            9.0
        } else {
            f64::from(step % 7)
        }
    };
    let steps = 0..90_000;
    report.observed = steps
        .map(|step| observed(step % 3, f64::from(step) / 100.0, "swing", swing(step)))
        .collect();
    for name in ["a", "b", "c", "d", "e", "f"] {
        report.observed.push(observed(0, 901.0, name, 1.0));
    }
    report.observed[0].name = "a".to_owned();
    let values = &record(&(report.clone(), flight.clone()))["values"];
    assert_eq!(values["omitted"], serde_json::json!(["swing"]));
    assert_eq!(values["series"].as_array().unwrap().len(), NAMES_MAX);
    report.observed.truncate(90_000);
    let values = &record(&(report, flight))["values"]["series"][1];
    assert_eq!(values["thinned"], true);
    let lines = values["lines"].as_array().unwrap().iter();
    let values: Vec<f64> = lines
        .flat_map(|line| line["values"].as_array().unwrap())
        .map(|value| value.as_f64().unwrap())
        .collect();
    assert!(values.len() <= POINTS_MAX, "{}", values.len());
    assert!(values.contains(&9.0) && values.contains(&0.0));
}

#[test]
fn page_of_15_drones_is_below_1_mb_and_of_100_below_8_mb() {
    let series = leaning();
    let with_values = |(mut report, mut flight): (Report, Flight)| {
        let drones = u32::try_from(report.drones.len()).unwrap();
        let values = (0..100_000_u32).map(|step| {
            let name = format!("value {}", step % 10);
            let value = f64::from(step).sin() * 1e3;
            observed(step / 10 % drones, f64::from(step) / 500.0, &name, value)
        });
        report.observed = values.collect();
        for drone in &mut flight.drones {
            drone.control = Some(series.clone());
        }
        (report, flight)
    };
    let (report, flight) = with_values(flown("thesis-2.toml"));
    let size = page(&report, &flight).len();
    assert!(size < 1_000_000, "{size}");
    let (report, flight) = with_values(sample::swarm(100));
    let size = page(&report, &flight).len();
    assert!(size < 8_000_000, "{size}");
}

#[test]
fn page_allows_its_own_script_only() {
    let (report, flight) = sample::swarm(2);
    let page = page(&report, &flight);
    assert!(page.contains(&super::script_source()));
    assert!(!page.contains("'unsafe-inline' 'sha256") && !page.contains("script-src 'unsafe"));
    assert_eq!(page.matches("<script").count(), 2);
}
