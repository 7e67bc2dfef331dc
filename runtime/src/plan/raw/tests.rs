use serde::Deserialize;

use muster_machines::msp::controller;

use super::super::schema;
use super::{ActorName, FaultKindName, Gains, ParametersName};
use crate::schema::Field;

fn field(path: &str) -> &'static Field {
    schema().fields.iter().find(|it| it.path == path).unwrap()
}

#[test]
fn every_field_has_a_description_and_accepted_values() {
    for field in &schema().fields {
        let Field {
            path,
            description,
            accepted,
            ..
        } = field;
        let is_plain = |text: &str| !text.is_empty() && !text.contains("null");
        let is_described = path == "faults.kind" || description.ends_with(['.', '`']);
        assert!(
            is_described && is_plain(description),
            "{path}: {description}"
        );
        assert!(is_plain(accepted), "{path}: {accepted}");
    }
}

#[test]
fn fields_have_the_order_of_their_declaration() {
    let first: Vec<&str> = schema().fields.iter().take(5).map(|it| &*it.path).collect();
    let expected = [
        "seed",
        "formation",
        "formation.kind",
        "formation.drones",
        "formation.spacing_m",
    ];
    assert_eq!(first, expected);
}

#[test]
fn type_gives_accepted_values_and_default() {
    let gap = field("formation.gap_m");
    let accepted = "a number from 0.01 to 100000, in metres; from `limits.separation_horizontal_m` + 0.5 to `spacing_m`";
    assert_eq!(gap.accepted, accepted);
    assert_eq!(gap.default.as_deref(), Some("10"));
    assert_eq!(field("vehicle.climb_mps").default.as_deref(), Some("2.5"));
    let ground = field("formation.ground");
    assert_eq!(ground.accepted, "\"gathered\", \"line\" or \"grid\"");
    assert_eq!(ground.default.as_deref(), Some("\"gathered\""));
    assert!(field("radio.range_m").is_required && !gap.is_required);
}

#[test]
fn every_key_of_a_kind_of_fault_is_a_field() {
    for kind in FaultKindName::ALL {
        for key in kind.keys().iter() {
            assert!(!field(&format!("faults.{key}")).accepted.is_empty());
        }
    }
}

#[test]
fn names_are_those_that_a_file_has() {
    #[derive(Deserialize)]
    struct Fields {
        kind: FaultKindName,
        actor: ActorName,
    }
    for kind in FaultKindName::ALL {
        for actor in ["radio", "routing", "mission", "navigation", "msp"] {
            let text = format!("kind = \"{}\"\nactor = \"{actor}\"", kind.name());
            let fields: Fields = toml::from_str(&text).unwrap();
            assert_eq!((fields.kind, fields.actor.name()), (kind, actor));
        }
    }
    let sets: Vec<String> = ParametersName::ALL
        .map(|(name, _)| format!("\"{name}\""))
        .into();
    assert_eq!(
        field("protocol.parameters").accepted.replace(" or ", ", "),
        sets.join(", ")
    );
}

#[test]
fn default_gains_are_those_of_a_quadcopter() {
    let gains = controller::Gains::from(&Gains::default());
    assert_eq!(gains, controller::Gains::QUADCOPTER);
}
