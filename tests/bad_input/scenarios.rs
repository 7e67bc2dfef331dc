//! Scenarios with one wrong field each.

use serde::Deserialize;

use super::{Folder, SCENARIO, assert_all, contains};

#[derive(Deserialize)]
struct Cases {
    case: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    name: String,
    replace: Vec<String>,
    by: Vec<String>,
    says: Vec<String>,
}

impl Case {
    fn check(&self) -> Result<(), String> {
        let folder = Folder::new();
        let replaced = self.replace.join("\n");
        if !SCENARIO.contains(&replaced) {
            return Err(format!("the scenario does not contain `{replaced}`"));
        }
        let scenario = SCENARIO.replacen(&replaced, &self.by.join("\n"), 1);
        folder.write("scenario.toml", scenario);
        let error = folder.refusal(&[])?;
        contains(&error, &self.says)?;
        contains(&error, &["scenario.toml", "help:"])?;
        match folder.muster(&["check", "scenario.toml"]).0 {
            Some(2) => Ok(()),
            code => Err(format!("`muster check` exits with {code:?}")),
        }
    }
}

#[test]
fn wrong_field_is_refused_with_its_place_and_accepted_values() {
    let cases: Cases = toml::from_str(include_str!("scenario.toml")).unwrap();
    assert_all(cases.case.iter().map(|case| (&case.name, case.check())));
}

#[test]
fn formation_with_layers_above_the_altitude_limit_is_refused() {
    let folder = Folder::new();
    let scenario = SCENARIO
        .replace("drones = 5", "drones = 25")
        .replace("spacing_m = 160", "spacing_m = 20\nheading_deg = 82");
    folder.write("scenario.toml", scenario);
    let texts = [
        "need altitude layers up to",
        "more than the limit of 120 m",
        "set `limits.altitude_max_m`",
    ];
    folder.check_refusal(&[], &texts).unwrap();
}

#[test]
fn mission_without_waypoints_is_refused() {
    let folder = Folder::new();
    folder.write(
        "hover.waypoints",
        "QGC WPL 110\n0 1 0 16 0 0 0 0 39.333 -0.3085 2 1\n1 0 3 16 0 0 0 0 39.333 -0.3085 25 1\n",
    );
    let mission = ["--set", "mission.file=hover.waypoints"];
    let texts = ["hover.waypoints", "has no waypoint other than", "help:"];
    folder.check_refusal(&mission, &texts).unwrap();
}
