//! JSON Schemas of the messages. Those with names of Foxglove describe what is written here of Foxglove's messages.

use serde_json::{Map, Value, json};

/// A kind of message.
#[derive(Debug, Clone, Copy)]
pub(super) enum Schema {
    /// What is seen.
    Scene,
    /// What happened.
    Log,
    /// Where a drone is on the Earth.
    Location,
    /// What a drone does.
    Drone,
    /// Who leads.
    Swarm,
    /// What a drone's agent observed.
    Value,
}

impl Schema {
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Scene => "foxglove.SceneUpdate",
            Self::Log => "foxglove.Log",
            Self::Location => "foxglove.LocationFix",
            Self::Drone => "muster.Drone",
            Self::Swarm => "muster.Swarm",
            Self::Value => "muster.Value",
        }
    }

    pub(super) fn json(self) -> Value {
        let (about, fields) = match self {
            Self::Scene => (
                "Drones, links to parents and waypoints; x east, y north, z up, in metres from home",
                scene(),
            ),
            Self::Log => ("Something that happened", log()),
            Self::Location => ("Where a drone is", location()),
            Self::Drone => ("What a drone does", drone()),
            Self::Swarm => ("Who leads, and how near drones are to each other", swarm()),
            Self::Value => ("A value that a drone's agent observed", value()),
        };
        let mut schema = object(about, fields);
        schema["$schema"] = json!("https://json-schema.org/draft/2020-12/schema");
        schema["title"] = json!(self.name());
        schema
    }
}

type Fields = Vec<(&'static str, Value)>;

/// An object with these fields, all of them required.
fn object(about: &str, fields: Fields) -> Value {
    let names: Vec<_> = fields.iter().map(|(name, _)| *name).collect();
    let properties: Map<String, Value> = fields
        .into_iter()
        .map(|(name, schema)| (name.to_owned(), schema))
        .collect();
    json!({"type": "object", "description": about, "properties": properties, "required": names})
}

fn kind(name: &str, about: &str) -> Value {
    json!({"type": name, "description": about})
}

fn or_null(name: &str, about: &str) -> Value {
    json!({"type": [name, "null"], "description": about})
}

fn list(of: &Value) -> Value {
    json!({"type": "array", "items": of})
}

fn time(about: &str) -> Value {
    let nsec = json!({"type": "integer", "minimum": 0, "maximum": 999_999_999});
    object(
        about,
        vec![
            ("sec", json!({"type": "integer", "minimum": 0})),
            ("nsec", nsec),
        ],
    )
}

fn vector(about: &str) -> Value {
    object(
        about,
        ["x", "y", "z"]
            .map(|axis| (axis, kind("number", axis)))
            .into(),
    )
}

fn pose(about: &str) -> Value {
    let orientation = ["x", "y", "z", "w"]
        .map(|part| (part, kind("number", part)))
        .into();
    object(
        about,
        vec![
            ("position", vector("position")),
            ("orientation", object("quaternion", orientation)),
        ],
    )
}

fn colour() -> Value {
    object(
        "0 to 1",
        ["r", "g", "b", "a"]
            .map(|part| (part, kind("number", part)))
            .into(),
    )
}

fn sphere() -> Value {
    let fields = vec![
        ("pose", pose("centre")),
        ("size", vector("diameters")),
        ("color", colour()),
    ];
    object("A drone", fields)
}

fn text() -> Value {
    let fields = vec![
        ("pose", pose("centre")),
        ("billboard", kind("boolean", "faces the viewer")),
        ("font_size", kind("number", "in pixels")),
        ("scale_invariant", kind("boolean", "in pixels")),
        ("color", colour()),
        ("text", kind("string", "text")),
    ];
    object("Its id", fields)
}

fn line() -> Value {
    let fields = vec![
        ("type", kind("integer", "0: a strip, 2: pairs of points")),
        ("pose", pose("origin")),
        ("thickness", kind("number", "in pixels")),
        ("scale_invariant", kind("boolean", "in pixels")),
        ("points", list(&vector("point"))),
        ("color", colour()),
        ("colors", list(&colour())),
        ("indices", list(&kind("integer", "of points"))),
    ];
    object("Lines", fields)
}

fn scene() -> Fields {
    let deletion = vec![
        ("timestamp", time("when")),
        ("type", kind("integer", "0: the entity with this id")),
        ("id", kind("string", "id")),
    ];
    let deletion = object("An entity to remove", deletion);
    let unused = || json!({"type": "array", "maxItems": 0});
    let pair = vec![
        ("key", kind("string", "name")),
        ("value", kind("string", "value")),
    ];
    let pair = object("A fact", pair);
    let entity = vec![
        ("timestamp", time("when")),
        ("frame_id", kind("string", "home")),
        ("id", kind("string", "replaces the entity with the same id")),
        ("lifetime", time("zero: until it is replaced")),
        ("frame_locked", kind("boolean", "false")),
        ("metadata", list(&pair)),
        ("arrows", unused()),
        ("cubes", unused()),
        ("spheres", list(&sphere())),
        ("cylinders", unused()),
        ("lines", list(&line())),
        ("triangles", unused()),
        ("texts", list(&text())),
        ("models", unused()),
    ];
    let about = "A drone, the links to parents, or the path of the mission";
    let entity = object(about, entity);
    vec![("deletions", list(&deletion)), ("entities", list(&entity))]
}

fn log() -> Fields {
    vec![
        ("timestamp", time("when")),
        (
            "level",
            json!({"type": "integer", "minimum": 0, "maximum": 5, "description": "2 info, 3 warning, 4 error"}),
        ),
        ("message", kind("string", "one line")),
        (
            "name",
            kind(
                "string",
                "kind: fault, death, agent failure, election, leader, partition, …",
            ),
        ),
        ("file", kind("string", "empty")),
        ("line", kind("integer", "0")),
    ]
}

fn location() -> Fields {
    vec![
        ("timestamp", time("when")),
        ("frame_id", kind("string", "of the drone")),
        ("latitude", kind("number", "degrees, WGS84")),
        ("longitude", kind("number", "degrees, WGS84")),
        ("altitude", kind("number", "metres above sea level")),
        (
            "position_covariance",
            json!({"type": "array", "items": {"type": "number"}, "minItems": 9, "maxItems": 9}),
        ),
        ("position_covariance_type", kind("integer", "0: unknown")),
    ]
}

fn drone() -> Fields {
    vec![
        ("timestamp", time("when")),
        ("drone", kind("integer", "id")),
        ("north_m", kind("number", "metres north of home")),
        ("east_m", kind("number", "metres east of home")),
        ("altitude_m", kind("number", "metres above home")),
        ("state", kind("string", "state of its mission")),
        (
            "condition",
            kind(
                "string",
                "runs, hangs, stopped, dead, battery empty, fell, failed",
            ),
        ),
        ("airborne", kind("boolean", "its motors are armed")),
        (
            "leader",
            or_null("integer", "the drone that it follows, perhaps itself"),
        ),
        ("term", or_null("integer", "term of the leader epoch")),
        ("hops", or_null("integer", "hops to its leader")),
        ("parent", or_null("integer", "next hop to its leader")),
        ("relay", kind("boolean", "it relays orders")),
    ]
}

fn swarm() -> Fields {
    let leader = object(
        "A leader",
        vec![
            ("drone", kind("integer", "id")),
            ("term", kind("integer", "term of its epoch")),
            (
                "members",
                kind("integer", "live drones that follow it, itself included"),
            ),
        ],
    );
    vec![
        ("timestamp", time("when")),
        ("airborne", kind("integer", "drones in the air")),
        ("leaders", list(&leader)),
        (
            "closest_m",
            or_null(
                "number",
                "distance of the closest two drones in the air, in metres",
            ),
        ),
    ]
}

fn value() -> Fields {
    vec![
        ("timestamp", time("when")),
        ("drone", kind("integer", "id")),
        ("name", kind("string", "name that the agent gave the value")),
        (
            "value",
            kind("number", "the value; its unit is the agent's"),
        ),
    ]
}
