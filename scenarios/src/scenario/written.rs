//! Scenarios as text: a search writes what it found as a file that reproduces it.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use muster_machines::identity::NodeId;
use muster_runtime::diagnostic::BadInput;
use muster_runtime::plan::raw::ActorName;
use toml_edit::{Array, ArrayOfTables, DocumentMut, Item, Table, Value, value};

use super::shipped::{self, mission_path, scenario_file};
use super::{
    ControllerFault, Distortion, DroneFault, Fault, FaultKind, LinkFault, Links, Tampered, Target,
    Trigger, When,
};
use muster_runtime::plan::file::{Override, Source};
use muster_runtime::plan::mission_file;

/// A scenario file's text with overrides, additional faults and another mission file, without `[chaos]`.
///
/// # Errors
/// If the text is not TOML.
pub fn written(
    (path, text): (&Path, &str),
    set: &[Override],
    faults: &[Fault],
    mission: &str,
) -> Result<String, BadInput> {
    let source = Source::overridden(path, text.to_owned(), set)?;
    let mut document: DocumentMut =
        (source.text.parse()).map_err(|_| source.error(0..0, "this is not TOML"))?;
    document.remove("chaos");
    document["mission"]["file"] = value(mission);
    let own = document.remove("faults").unwrap_or_default();
    let mut all = own
        .into_array_of_tables()
        .unwrap_or_else(|_| ArrayOfTables::new());
    for fault in faults {
        all.push(table(fault));
    }
    if !all.is_empty() {
        document.insert("faults", Item::ArrayOfTables(all));
    }
    Ok(document.to_string())
}

/// Name and text of a scenario file with overrides and of its mission file, changed such that both work in one folder.
/// `[chaos]` is removed.
///
/// # Errors
/// If a file can't be read, or the scenario can't be parsed.
pub fn side_by_side(path: &Path, set: &[Override]) -> Result<[(String, String); 2], BadInput> {
    let name = |path: &Path| {
        let name = path.file_name().unwrap_or_default();
        name.to_string_lossy().into_owned()
    };
    let path = scenario_file(path)?;
    let text = shipped::read(&path)?;
    let mission = mission_file(&Source::overridden(&path, text.clone(), set)?)?;
    let mission = mission_path(&mission)?;
    let scenario = written((&path, &text), set, &[], &name(&mission))?;
    Ok([
        (name(&path), scenario),
        (name(&mission), shipped::read(&mission)?),
    ])
}

/// A fault as a table of a scenario file.
pub(crate) fn table(fault: &Fault) -> Table {
    let mut table = Table::new();
    table.insert("kind", value(fault.kind.kind().name()));
    match fault.when {
        When::At(at) => {
            table.insert("at_s", value(at.as_secs_f64()));
        }
        When::After(trigger, after) => {
            match trigger {
                Trigger::Waypoint(waypoint) => {
                    table.insert("at_waypoint", value(i64::from(waypoint)));
                }
                Trigger::TakingOff => drop(table.insert("when", value("taking-off"))),
                Trigger::Elected => drop(table.insert("when", value("elected"))),
                Trigger::Settled => drop(table.insert("when", value("settled"))),
                Trigger::Landing => drop(table.insert("when", value("landing"))),
            }
            if after > Duration::ZERO {
                table.insert("after_s", value(after.as_secs_f64()));
            }
        }
    }
    insert_keys(&fault.kind, &mut table);
    if let Some(duration) = fault.duration {
        table.insert("for_s", value(duration.as_secs_f64()));
    }
    if fault.times > 1 {
        table.insert("times", value(i64::from(fault.times)));
        table.insert("every_s", value(fault.every.as_secs_f64()));
    }
    table
}

/// Inserts the keys that the kind takes.
fn insert_keys(kind: &FaultKind, table: &mut Table) {
    match kind {
        FaultKind::Drone(target, fault) => {
            table.insert("drone", value(target_value(*target)));
            match *fault {
                DroneFault::CrashActor(actor) | DroneFault::Hang(Some(actor)) => {
                    table.insert("actor", value(ActorName::from(actor).name()));
                }
                DroneFault::Drain(charge) => drop(table.insert("charge", value(charge))),
                DroneFault::Skew(ppm) => drop(table.insert("ppm", value(i64::from(ppm)))),
                DroneFault::Controller(fault) => insert_controller_key(fault, table),
                DroneFault::Kill
                | DroneFault::CrashAircraft
                | DroneFault::Restart
                | DroneFault::Hang(None)
                | DroneFault::LoseGps
                | DroneFault::Replay
                | DroneFault::Forge => {}
            }
        }
        FaultKind::Links(links, link) => {
            table.insert("links", value(links_value(links)));
            if let LinkFault::Degraded(loss) = link {
                table.insert("loss", value(*loss));
            }
        }
        FaultKind::Jam { centre, radius_m } => {
            table.insert("north_m", value(centre.0.x));
            table.insert("east_m", value(centre.0.y));
            table.insert("radius_m", value(*radius_m));
        }
        FaultKind::Tamper(Tampered { from, share, how }) => {
            let from = from.map_or_else(|| Value::from("all"), number);
            table.insert("from", value(from));
            if let Distortion::Delay(by) | Distortion::Reorder(by) = *how {
                table.insert("by_ms", value(milliseconds(by)));
            }
            table.insert("share", value(*share));
        }
    }
}

fn insert_controller_key(fault: ControllerFault, table: &mut Table) {
    if let ControllerFault::WeakenMotor(Some(motor), _) = fault {
        table.insert("motor", value(i64::from(motor)));
    }
    let (key, own) = match fault {
        ControllerFault::Freeze | ControllerFault::ClosePort | ControllerFault::TakeOver => return,
        ControllerFault::LoseBytes(share)
        | ControllerFault::CorruptBytes(share)
        | ControllerFault::WeakenMotor(_, share) => ("share", value(share)),
        ControllerFault::Shake(dps) => ("rate_dps", value(dps)),
        ControllerFault::DelayBytes(by) => ("by_ms", value(milliseconds(by))),
        ControllerFault::SagBattery(volts) => ("volts", value(volts)),
    };
    table.insert(key, own);
}

fn milliseconds(duration: Duration) -> i64 {
    i64::try_from(duration.as_millis()).unwrap_or(i64::MAX)
}

fn target_value(target: Target) -> Value {
    match target {
        Target::Master => Value::from("master"),
        Target::Drone(drone) => number(drone),
    }
}

fn number(drone: NodeId) -> Value {
    Value::from(i64::from(drone.0))
}

fn links_value(links: &Links) -> Array {
    let group = |ids: &Arc<[NodeId]>| ids.iter().copied().map(number).collect::<Array>();
    if let ([from], [to]) = (&*links.from, &*links.to) {
        return [number(*from), number(*to)].into_iter().collect();
    }
    [group(&links.from), group(&links.to)].into_iter().collect()
}
