//! What a host sees of its drones: their services, and their status over HTTP.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::{Duration, Instant};

use serde::Deserialize;

use super::Host;
use super::facts::{DroneFacts, HostFacts, SlotFacts};
use super::flight::Flight;
use super::gate::DroneHealth;
use super::machine::SlotLink;
use super::systemd::{TRIAL, Unit, service};

/// Time limit of a question to a drone.
const ANSWER_MAX: Duration = Duration::from_secs(1);
/// The longest answer that is read, in bytes.
const ANSWER_BYTES_MAX: usize = 1_024 * 1_024;
/// Exit code of a process that is ready and finds its flight over. One that can't use its files or arguments has the same code
/// and was not ready.
const FLIGHT_OVER: i32 = 2;

/// The part of a drone's status that is needed here. Another version may send it.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Answer {
    version: Option<String>,
    faults: Vec<String>,
    proven: BTreeSet<u32>,
    pub(super) in_flight: bool,
    frames: Frames,
    /// `None` with a simulated vehicle.
    port: Option<Port>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Port {
    state: String,
}

impl Answer {
    /// What is wrong, in words. Empty if nothing is.
    fn complaints(&self) -> String {
        let is_silent = |port: &&Port| port.state != "open";
        let silent = self.port.as_ref().filter(is_silent);
        let silent = silent.map(|port| format!("the flight controller's port is {}", port.state));
        let all: Vec<_> = self.faults.iter().cloned().chain(silent).collect();
        all.join("; ")
    }
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Frames {
    dropped: BTreeMap<String, u64>,
}

/// Asks a drone for its status. `None` without a proper answer in time.
pub(super) fn ask(address: SocketAddr) -> Option<Answer> {
    let answer = exchange(address).ok()?;
    let end = answer.windows(4).position(|it| it == b"\r\n\r\n")?;
    serde_json::from_slice(&answer[end + 4..]).ok()
}

/// A question and its answer, all of it within [`ANSWER_MAX`].
fn exchange(address: SocketAddr) -> io::Result<Vec<u8>> {
    let start = Instant::now();
    let left = || {
        let left = ANSWER_MAX.checked_sub(start.elapsed());
        let left = left.filter(|it| !it.is_zero());
        left.ok_or(io::ErrorKind::TimedOut)
    };
    let mut stream = TcpStream::connect_timeout(&address, ANSWER_MAX)?;
    stream.set_write_timeout(Some(left()?))?;
    let question = format!("GET /status HTTP/1.0\r\nHost: {address}\r\n\r\n");
    stream.write_all(question.as_bytes())?;
    let (mut answer, mut piece) = (Vec::new(), [0; 4_096]);
    while answer.len() < ANSWER_BYTES_MAX {
        stream.set_read_timeout(Some(left()?))?;
        match stream.read(&mut piece)? {
            0 => break,
            read => answer.extend_from_slice(&piece[..read]),
        }
    }
    Ok(answer)
}

/// A drone's service before its slot is tried.
#[derive(Debug, Clone, Copy)]
pub(super) struct Before {
    /// How often systemd had started it again.
    pub(super) restarts: u32,
    /// When its process had started last, in microseconds since the host did; 0 if it never had.
    pub(super) started_us: u64,
}

/// For a host without a trial: restarts are counted by others.
const NO_TRIAL: Before = Before {
    restarts: u32::MAX,
    started_us: 0,
};

/// Looks at a drone of a slot.
fn drone(
    host: &Host,
    slot: &str,
    (id, address): (u32, SocketAddr),
    before: Before,
) -> io::Result<DroneFacts> {
    let unit = host.systemd.look(&service(id))?;
    let answer = ask(address);
    let flight = flight(host, slot, id, &unit)?;
    let health = health(&unit, answer.as_ref(), flight, before);
    let in_flight = takes_part(&unit, answer.as_ref(), flight);
    let answer = answer.unwrap_or_default();
    Ok(DroneFacts {
        health,
        in_flight,
        version: answer.version,
        dropped: answer.frames.dropped.values().sum(),
        restarts: unit.restarts(),
    })
}

/// What a drone's journal says of its flight. Ongoing if no slot's program runs it: that one may have another journal.
fn flight(host: &Host, slot: &str, id: u32, unit: &Unit) -> io::Result<Flight> {
    if is_of_slot(host, unit)? {
        return Ok(Flight::of(&host.disk.drone_file(slot, id)));
    }
    Ok(Flight::Ongoing)
}

/// Whether a drone's service runs the program of a slot, also of one that was removed since.
fn is_of_slot(host: &Host, unit: &Unit) -> io::Result<bool> {
    let program = unit
        .process()
        .map(|it| fs::read_link(format!("/proc/{it}/exe")));
    match program {
        Some(Ok(program)) => {
            let slots = fs::canonicalize(host.disk.home().join("slots"))?;
            Ok(program.starts_with(slots))
        }
        Some(Err(error)) if error.kind() != io::ErrorKind::NotFound => Ok(false),
        // Without a process: the next one is the running slot's.
        _ => Ok(host.disk.slots()?.current.is_some()),
    }
}

/// Whether a drone is armed or takes part in a flight. For one that runs and does not answer, its journal tells.
fn takes_part(unit: &Unit, answer: Option<&Answer>, flight: Flight) -> bool {
    answer.map_or(unit.is_running() && flight == Flight::Ongoing, |answer| {
        answer.in_flight
    })
}

/// Whether a drone of a slot is armed or takes part in a flight.
pub(super) fn is_in_flight(
    host: &Host,
    slot: &str,
    (id, address): (u32, SocketAddr),
) -> io::Result<bool> {
    let unit = host.systemd.look(&service(id))?;
    let flight = flight(host, slot, id, &unit)?;
    Ok(takes_part(&unit, ask(address).as_ref(), flight))
}

fn health(unit: &Unit, answer: Option<&Answer>, flight: Flight, before: Before) -> DroneHealth {
    let ended = || DroneHealth::Dead(format!("its process was ended ({})", unit.result()));
    if unit.restarts() > before.restarts {
        return ended();
    }
    match (unit.state(), answer) {
        ("active", Some(answer)) if answer.complaints().is_empty() => DroneHealth::Healthy {
            proven: answer.proven.clone(),
        },
        ("active", Some(answer)) => DroneHealth::Unhealthy(answer.complaints()),
        ("active", None) => DroneHealth::Unhealthy("does not answer".to_owned()),
        ("failed" | "inactive", _) if unit.started_us() <= before.started_us => {
            DroneHealth::Starting("its process has not started".to_owned())
        }
        ("failed" | "inactive", _) => match unit.exit_code() {
            Some(0 | FLIGHT_OVER)
                if unit.has_exited() && unit.was_ready() && flight == Flight::Over =>
            {
                DroneHealth::FlightOver
            }
            Some(code) if unit.has_exited() => {
                DroneHealth::Dead(format!("its process ended with exit code {code}"))
            }
            _ => ended(),
        },
        ("activating", _) if unit.result() != "success" => ended(),
        (state, _) => DroneHealth::Starting(format!("its service is {state}")),
    }
}

/// The services of a slot's drones.
pub(super) fn services(host: &Host, facts: &SlotFacts) -> io::Result<BTreeMap<u32, Before>> {
    let services = facts.drones.keys().map(|id| {
        let unit = host.systemd.look(&service(*id))?;
        let (restarts, started_us) = (unit.restarts(), unit.started_us());
        Ok((
            *id,
            Before {
                restarts,
                started_us,
            },
        ))
    });
    services.collect()
}

/// Looks at the drones of a slot.
pub(super) fn drones(
    host: &Host,
    slot: &str,
    facts: &SlotFacts,
    before: &BTreeMap<u32, Before>,
) -> io::Result<BTreeMap<u32, DroneFacts>> {
    let drones = facts.drones.iter().map(|(id, address)| {
        let before = before.get(id).copied().unwrap_or(NO_TRIAL);
        Ok((*id, drone(host, slot, (*id, *address), before)?))
    });
    drones.collect()
}

/// Number of a slot's drone that is armed or takes part in a flight. `None` if none does.
pub(super) fn in_flight(host: &Host, slot: &str) -> io::Result<Option<u32>> {
    for (id, address) in host.disk.facts(slot)?.drones {
        if is_in_flight(host, slot, (id, address))? {
            return Ok(Some(id));
        }
    }
    Ok(None)
}

/// Looks at the whole host.
pub(super) fn host(host: &Host) -> io::Result<HostFacts> {
    let disk = &host.disk;
    let slots = disk.slots()?;
    let current = slots
        .current
        .as_ref()
        .map(|it| disk.facts(it))
        .transpose()?;
    let since_good = fs::symlink_metadata(disk.link(SlotLink::Good)).and_then(|it| it.modified());
    let good_for = since_good.ok().and_then(|since| since.elapsed().ok());
    let is_tried = host.systemd.look(TRIAL)?.is_running();
    let home = disk.home();
    // Before the first release the folder is not there yet.
    let space = home.ancestors().find_map(|it| rustix::fs::statvfs(it).ok());
    let space = space.map(|it| it.f_bavail * it.f_frsize);
    Ok(HostFacts {
        drones: match (&slots.current, &current) {
            (Some(slot), Some(facts)) => drones(host, slot, facts, &BTreeMap::new())?,
            _ => BTreeMap::new(),
        },
        rollback_slot: slots.rollback_slot().cloned(),
        is_on_trial: is_tried || slots.is_on_trial(),
        good_for_s: slots.good.as_ref().and(good_for).map(|it| it.as_secs()),
        good: slots.good,
        current,
        failure: disk.failure(),
        free_bytes: space.unwrap_or_default(),
    })
}

#[cfg(test)]
mod tests;
