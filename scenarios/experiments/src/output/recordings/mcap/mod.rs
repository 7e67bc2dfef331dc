//! MCAP (<https://mcap.dev>) with messages in JSON: a scene and a log for Foxglove, and each drone's place and state.

mod scene;
mod schemas;
mod states;

use std::collections::BTreeMap;
use std::io::{self, Seek, Write};
use std::time::Duration;

use ::mcap::records::MessageHeader;
use ::mcap::{Compression, McapError, WriteOptions, Writer};
use muster_machines::time::Timestamp;
use muster_scenarios::report::{Flight, Mark, MarkKind, ObservedValue, Report};
use serde_json::{Value, json};

use self::schemas::Schema;
use self::states::Drone;

/// Interval between scenes.
const SCENE_EVERY: Duration = Duration::from_millis(250);
/// Scenes between two states and places of each drone.
const SCENES_PER_STATE: u64 = 4;

/// Writes a run as MCAP. Times are since its start.
///
/// # Errors
/// If `to` can't be written.
pub(super) fn write(
    to: &mut (impl Write + Seek),
    report: &Report,
    flight: &Flight,
) -> io::Result<()> {
    let mut file = File::new(to)?;
    file.write(report, flight)?;
    file.writer.finish().map(drop).map_err(io_error)
}

/// A file being written.
struct File<W: Write + Seek> {
    writer: Writer<W>,
    schemas: BTreeMap<&'static str, u16>,
    /// Number and next message of each topic.
    topics: BTreeMap<String, (u16, u32)>,
}

impl<W: Write + Seek> File<W> {
    fn new(to: W) -> io::Result<Self> {
        let options = WriteOptions::new()
            .compression(Some(Compression::Lz4))
            .library(format!("muster {}", env!("CARGO_PKG_VERSION")));
        Ok(Self {
            writer: options.create(to).map_err(io_error)?,
            schemas: BTreeMap::new(),
            topics: BTreeMap::new(),
        })
    }

    fn write(&mut self, report: &Report, flight: &Flight) -> io::Result<()> {
        let drones = Drone::all(report, flight);
        let mut marks = marks(flight).into_iter().peekable();
        let mut values = values(report).into_iter().peekable();
        let mut scene = scene::Scene::new(flight);
        let end = Timestamp::from_secs_f64(report.simulated_s);
        let mut at = Timestamp::ZERO;
        for tick in 0.. {
            let is_last = at >= end;
            let at_most = at.min(end);
            while let Some(mark) = marks.next_if(|mark| mark.at <= at_most || is_last) {
                self.message("/log", Schema::Log, mark.at, &log(mark))?;
            }
            while let Some((at, value)) = values.next_if(|(at, _)| *at <= at_most || is_last) {
                let topic = format!("/drones/{}/values", value.drone);
                self.message(&topic, Schema::Value, at, &states::value(at, value))?;
            }
            if let Some(update) = scene.update(at_most, &drones) {
                self.message("/scene", Schema::Scene, at_most, &update)?;
            }
            if tick % SCENES_PER_STATE == 0 || is_last {
                self.states(at_most, &drones, flight)?;
            }
            if is_last {
                return Ok(());
            }
            at += SCENE_EVERY;
        }
        Ok(())
    }

    /// Writes the place and the state of each drone, and that of the swarm.
    fn states(&mut self, at: Timestamp, drones: &[Drone<'_>], flight: &Flight) -> io::Result<()> {
        for drone in drones {
            let id = drone.id;
            self.message(
                &format!("/drones/{id}/state"),
                Schema::Drone,
                at,
                &drone.state(at),
            )?;
            if let Some(home) = flight.history.home
                && let Some(location) = drone.location(at, home)
            {
                let topic = format!("/drones/{id}/location");
                self.message(&topic, Schema::Location, at, &location)?;
            }
        }
        self.message("/swarm", Schema::Swarm, at, &states::swarm(at, drones))
    }

    fn message(
        &mut self,
        topic: &str,
        schema: Schema,
        at: Timestamp,
        message: &Value,
    ) -> io::Result<()> {
        let (channel_id, sequence) = self.topic(topic, schema)?;
        let header = MessageHeader {
            channel_id,
            sequence,
            log_time: at.as_nanos(),
            publish_time: at.as_nanos(),
        };
        let data = serde_json::to_vec(message)?;
        let written = self.writer.write_to_known_channel(&header, &data);
        written.map_err(io_error)
    }

    /// The channel of a topic, and the number of its next message.
    fn topic(&mut self, topic: &str, schema: Schema) -> io::Result<(u16, u32)> {
        if let Some((channel, sequence)) = self.topics.get_mut(topic) {
            *sequence += 1;
            return Ok((*channel, *sequence));
        }
        let schema = match self.schemas.get(schema.name()) {
            Some(id) => *id,
            None => {
                let text = serde_json::to_vec(&schema.json())?;
                let added = self.writer.add_schema(schema.name(), "jsonschema", &text);
                *self
                    .schemas
                    .entry(schema.name())
                    .or_insert(added.map_err(io_error)?)
            }
        };
        let added = self
            .writer
            .add_channel(schema, topic, "json", &BTreeMap::new());
        let channel = added.map_err(io_error)?;
        self.topics.insert(topic.to_owned(), (channel, 0));
        Ok((channel, 0))
    }
}

fn io_error(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        error => io::Error::other(error),
    }
}

/// The marks of all swarms, in order of time.
fn marks(flight: &Flight) -> Vec<&Mark> {
    let mut marks: Vec<_> = flight
        .swarms()
        .flat_map(|swarm| &swarm.history.marks)
        .collect();
    marks.sort_by_key(|mark| mark.at);
    marks
}

/// The values that agents of all swarms observed, in order of time. JSON has no numbers that are not finite.
fn values(report: &Report) -> Vec<(Timestamp, &ObservedValue)> {
    let observed = report.swarms().flat_map(|swarm| &swarm.observed);
    let mut values: Vec<_> = observed
        .filter(|value| value.value.is_finite())
        .map(|value| (Timestamp::from_secs_f64(value.at_s), value))
        .collect();
    values.sort_by_key(|(at, _)| *at);
    values
}

/// A mark as `foxglove.Log`.
fn log(mark: &Mark) -> Value {
    // Levels of `foxglove.Log`.
    let (info, warning, error) = (2, 3, 4);
    let level = match mark.kind {
        MarkKind::Death | MarkKind::Violation => error,
        MarkKind::Fault
        | MarkKind::Election
        | MarkKind::Partition
        | MarkKind::Landing
        | MarkKind::Restart
        | MarkKind::AgentFailure => warning,
        MarkKind::Return | MarkKind::Leader | MarkKind::Merge | MarkKind::Waypoint => info,
    };
    json!({
        "timestamp": time(mark.at),
        "level": level,
        "message": mark.text,
        "name": mark.kind.name(),
        "file": "",
        "line": 0,
    })
}

/// A time as Foxglove writes it.
fn time(at: Timestamp) -> Value {
    let nanos = at.as_nanos();
    json!({"sec": nanos / 1_000_000_000, "nsec": nanos % 1_000_000_000})
}
