//! Scenarios as text: what a search has found, written as a file that fails by itself.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use muster_machines::identity::NodeId;
use muster_machines::node::Address;
use muster_runtime::diagnostic::{BadInput, read_text};
use toml_edit::{Array, ArrayOfTables, DocumentMut, InlineTable, Item, Table, Value, value};

use super::{
    Distortion, DroneFault, Fault, FaultKind, Link, Links, Tampered, Target, Trigger, When,
};
use muster_runtime::plan::file::{Override, Source};
use muster_runtime::plan::mission_file;

/// A scenario file's text with fields set, faults added to its own, another name for its mission's file, and without
/// what a search may choose.
///
/// # Errors
/// When the text is not TOML.
pub(crate) fn written(
    (path, text): (&Path, &str),
    set: &[Override],
    faults: &[Fault],
    mission: &str,
) -> Result<String, BadInput> {
    let source = Source::new(path, text.to_owned(), set)?;
    let mut document: DocumentMut =
        (source.text.parse()).map_err(|_| source.error(0..0, "can't be written once more"))?;
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

/// A scenario's file and that of its mission as they would be in one folder, for a machine that has neither: name and text
/// of each. What a search may choose is left out.
///
/// # Errors
/// When either file can't be read, or the scenario's is none.
pub fn side_by_side(path: &Path) -> Result<[(String, String); 2], BadInput> {
    let name = |path: &Path| {
        let name = path.file_name().unwrap_or_default();
        name.to_string_lossy().into_owned()
    };
    let text = read_text(path)?;
    let mission = mission_file((path, &text), &[])?;
    let mission = path.parent().unwrap_or(Path::new("")).join(mission);
    let scenario = written((path, &text), &[], &[], &name(&mission))?;
    Ok([
        (name(path), scenario),
        (name(&mission), read_text(&mission)?),
    ])
}

/// A fault as a scenario file has it.
pub(crate) fn table(fault: &Fault) -> Table {
    let mut table = Table::new();
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
    kind(&fault.kind, &mut table);
    if let Some(lasts) = fault.lasts {
        table.insert("for_s", value(lasts.as_secs_f64()));
    }
    if fault.times > 1 {
        table.insert("times", value(i64::from(fault.times)));
        table.insert("every_s", value(fault.every.as_secs_f64()));
    }
    table
}

fn kind(kind: &FaultKind, table: &mut Table) {
    match kind {
        FaultKind::Drone(target, fault) => {
            table.insert(fault.verb(), value(victim(*target)));
            match *fault {
                DroneFault::CrashActor(actor) | DroneFault::Hang(Some(actor)) => {
                    table.insert("actor", value(actor_name(actor)));
                }
                DroneFault::Drain(to) => drop(table.insert("to", value(to))),
                DroneFault::Skew(ppm) => drop(table.insert("ppm", value(i64::from(ppm)))),
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
            table.insert(link.verb(), value(pair(links)));
            if let Link::Degraded(loss) = link {
                table.insert("loss", value(*loss));
            }
        }
        FaultKind::Jam { centre, radius_m } => {
            let disc = [
                ("north_m", centre.0.x),
                ("east_m", centre.0.y),
                ("radius_m", *radius_m),
            ];
            let disc: InlineTable = disc.into_iter().collect();
            table.insert("jam", value(disc));
        }
        FaultKind::Tamper(Tampered { from, share, how }) => {
            let from = from.map_or_else(|| Value::from("all"), number);
            table.insert(how.verb(), value(from));
            if let Distortion::Delay(by) | Distortion::Reorder(by) = how {
                let ms = i64::try_from(by.as_millis()).unwrap_or(i64::MAX);
                table.insert("by_ms", value(ms));
            }
            table.insert("share", value(*share));
        }
    }
}

fn victim(target: Target) -> Value {
    match target {
        Target::Master => Value::from("master"),
        Target::Drone(drone) => number(drone),
    }
}

fn number(drone: NodeId) -> Value {
    Value::from(i64::from(drone.0))
}

fn pair(links: &Links) -> Array {
    let group = |ids: &Arc<[NodeId]>| ids.iter().copied().map(number).collect::<Array>();
    if let ([from], [to]) = (&*links.from, &*links.to) {
        return [number(*from), number(*to)].into_iter().collect();
    }
    [group(&links.from), group(&links.to)].into_iter().collect()
}

/// An actor as a scenario file names it.
const fn actor_name(actor: Address) -> &'static str {
    match actor {
        Address::Radio => "radio",
        Address::Routing => "routing",
        Address::Mission => "mission",
        Address::Navigation => "navigation",
        Address::Msp => "msp",
    }
}

impl FaultKind {
    /// What a scenario file calls it, with the actor that it is about.
    pub(crate) fn name(&self) -> String {
        match self {
            Self::Drone(_, fault) => match fault {
                DroneFault::CrashActor(actor) | DroneFault::Hang(Some(actor)) => {
                    format!("{} {}", fault.verb(), actor_name(*actor))
                }
                _ => fault.verb().to_owned(),
            },
            Self::Links(_, link) => link.verb().to_owned(),
            Self::Jam { .. } => "jam".to_owned(),
            Self::Tamper(tampered) => tampered.how.verb().to_owned(),
        }
    }
}

impl DroneFault {
    const fn verb(&self) -> &'static str {
        match self {
            Self::CrashActor(_) => "crash",
            Self::Kill => "kill",
            Self::CrashAircraft => "crash_aircraft",
            Self::Restart => "restart",
            Self::Hang(_) => "hang",
            Self::Drain(_) => "drain",
            Self::LoseGps => "lose_gps",
            Self::Replay => "replay",
            Self::Forge => "forge",
            Self::Skew(_) => "skew",
        }
    }
}

impl Link {
    const fn verb(&self) -> &'static str {
        match self {
            Self::Cut => "cut",
            Self::OneWay => "one_way",
            Self::Degraded(_) => "degrade",
            Self::Healed => "heal",
        }
    }
}

impl Distortion {
    const fn verb(&self) -> &'static str {
        match self {
            Self::Corrupt => "corrupt",
            Self::Duplicate => "duplicate",
            Self::Delay(_) => "delay",
            Self::Reorder(_) => "reorder",
        }
    }
}
