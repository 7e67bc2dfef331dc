//! What is seen, as `foxglove.SceneUpdate`: only what has changed since the last one.

use std::collections::BTreeMap;

use muster_machines::geometry::Ned;
use muster_machines::time::Timestamp;
use muster_scenarios::report::{Condition, Flight};
use serde_json::{Value, json};

use super::super::colours;
use super::super::place::rounded;
use super::states::Drone;
use super::time;

/// Diameter of a drone, in metres: larger than real ones, to be seen from afar.
const DRONE_M: f64 = 4.0;

/// The entities as they were last written.
pub(super) struct Scene<'a> {
    flight: &'a Flight,
    shown: BTreeMap<String, Value>,
}

impl<'a> Scene<'a> {
    pub(super) const fn new(flight: &'a Flight) -> Self {
        Self {
            flight,
            shown: BTreeMap::new(),
        }
    }

    /// The entities that have changed; `None` if there are none.
    pub(super) fn update(&mut self, at: Timestamp, drones: &[Drone<'_>]) -> Option<Value> {
        let mut entities = Vec::new();
        for drone in drones {
            if let Some(content) = drone_content(drone, at) {
                self.changed(&mut entities, at, format!("drone {}", drone.id), &content);
            }
        }
        self.changed(
            &mut entities,
            at,
            "parents".to_owned(),
            &parents(drones, at),
        );
        let flight = self.flight;
        for (index, swarm) in flight.swarms().enumerate() {
            let content = waypoints(&swarm.waypoints);
            self.changed(&mut entities, at, format!("mission {index}"), &content);
        }
        (!entities.is_empty()).then(|| json!({"deletions": [], "entities": entities}))
    }

    /// Adds an entity, if its content is new.
    fn changed(&mut self, entities: &mut Vec<Value>, at: Timestamp, id: String, content: &Content) {
        let value = json!([content.spheres, content.lines, content.texts, content.facts]);
        if self.shown.get(&id) == Some(&value) {
            return;
        }
        entities.push(json!({
            "timestamp": time(at),
            "frame_id": "home",
            "id": id,
            "lifetime": {"sec": 0, "nsec": 0},
            "frame_locked": false,
            "metadata": content.facts,
            "arrows": [],
            "cubes": [],
            "spheres": content.spheres,
            "cylinders": [],
            "lines": content.lines,
            "triangles": [],
            "texts": content.texts,
            "models": [],
        }));
        self.shown.insert(id, value);
    }
}

/// What an entity consists of.
#[derive(Default)]
struct Content {
    spheres: Vec<Value>,
    lines: Vec<Value>,
    texts: Vec<Value>,
    facts: Vec<Value>,
}

fn drone_content(drone: &Drone<'_>, at: Timestamp) -> Option<Content> {
    let position = drone.position(at)?;
    let condition = drone.condition(at);
    let epoch = drone.epoch(at);
    let colour = match condition {
        Condition::Runs | Condition::Hangs => colours::epoch(epoch.map(|(index, _)| index)),
        _ => colours::DEAD,
    };
    let leads = epoch.is_some_and(|(_, epoch)| epoch.master == drone.id) && drone.takes_part(at);
    let name = match condition {
        Condition::Runs if leads => format!("◆ {}", drone.id),
        Condition::Runs => drone.id.to_string(),
        condition => format!("{} {}", drone.id, condition.name()),
    };
    let fact = |key: &str, value: String| json!({"key": key, "value": value});
    let size_m = if leads { DRONE_M * 1.5 } else { DRONE_M };
    Some(Content {
        spheres: vec![json!({
            "pose": pose(position),
            "size": {"x": size_m, "y": size_m, "z": size_m},
            "color": rgba(colour),
        })],
        texts: vec![json!({
            "pose": pose(Ned::new(position.north_m(), position.east_m(), -position.altitude_m() - DRONE_M)),
            "billboard": true,
            "font_size": 14.0,
            "scale_invariant": true,
            "color": rgba(colour),
            "text": name,
        })],
        facts: vec![
            fact("state", drone.flown.state_at(at).to_string()),
            fact("condition", condition.name().to_owned()),
        ],
        lines: vec![],
    })
}

/// A line from each drone that takes part to its parent.
fn parents(drones: &[Drone<'_>], at: Timestamp) -> Content {
    let (mut points, mut colours) = (vec![], vec![]);
    for drone in drones.iter().filter(|drone| drone.takes_part(at)) {
        let parent = drone.route(at).parent;
        let index = parent.and_then(|id| drones.binary_search_by_key(&id, |it| it.id).ok());
        let parent = index.map(|index| &drones[index]);
        let ends = parent.and_then(|parent| drone.position(at).zip(parent.position(at)));
        if let Some((from, to)) = ends {
            let colour = rgba(colours::epoch(drone.epoch(at).map(|(index, _)| index)));
            points.extend([point(from), point(to)]);
            colours.extend([colour.clone(), colour]);
        }
    }
    let pairs_of_points = 2;
    Content {
        lines: vec![lines(pairs_of_points, &points, &colours)],
        ..Content::default()
    }
}

fn waypoints(waypoints: &[Ned]) -> Content {
    let strip = 0;
    let points: Vec<_> = waypoints.iter().map(|it| point(*it)).collect();
    Content {
        lines: vec![lines(strip, &points, &[])],
        ..Content::default()
    }
}

fn lines(kind: u8, points: &[Value], colours: &[Value]) -> Value {
    json!({
        "type": kind,
        "pose": pose(Ned::HOME),
        "thickness": 2.0,
        "scale_invariant": true,
        "points": points,
        "color": {"r": 0.5, "g": 0.55, "b": 0.62, "a": 1.0},
        "colors": colours,
        "indices": [],
    })
}

fn point(place: Ned) -> Value {
    json!({
        "x": rounded(place.east_m(), 1e2),
        "y": rounded(place.north_m(), 1e2),
        "z": rounded(place.altitude_m(), 1e2),
    })
}

fn pose(place: Ned) -> Value {
    json!({"position": point(place), "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}})
}

fn rgba([red, green, blue]: [u8; 3]) -> Value {
    let part = |value: u8| rounded(f64::from(value) / 255.0, 1e3);
    json!({"r": part(red), "g": part(green), "b": part(blue), "a": 1.0})
}
