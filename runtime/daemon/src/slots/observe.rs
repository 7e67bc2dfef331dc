//! What a host sees of its drones: their services, and their status over HTTP.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

use serde::Deserialize;

use super::disk::Disk;
use super::facts::{DroneFacts, HostFacts, SlotFacts};
use super::gate::DroneHealth;
use super::machine::Link;
use super::systemd::{TRIAL, Unit, service};

/// Time limit of a question to a drone.
const ANSWER_MAX: Duration = Duration::from_secs(1);
/// The longest answer that is read, in bytes.
const ANSWER_BYTES_MAX: u64 = 1_024 * 1_024;
/// Exit code of a process whose flight is over, or whose files can't be used.
const UNUSABLE: i32 = 2;

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
    let ask = || -> io::Result<Vec<u8>> {
        let mut stream = TcpStream::connect_timeout(&address, ANSWER_MAX)?;
        stream.set_read_timeout(Some(ANSWER_MAX))?;
        stream.set_write_timeout(Some(ANSWER_MAX))?;
        let question = format!("GET /status HTTP/1.0\r\nHost: {address}\r\n\r\n");
        stream.write_all(question.as_bytes())?;
        let mut answer = Vec::new();
        stream.take(ANSWER_BYTES_MAX).read_to_end(&mut answer)?;
        Ok(answer)
    };
    let answer = ask().ok()?;
    let end = answer.windows(4).position(|it| it == b"\r\n\r\n")?;
    serde_json::from_slice(&answer[end + 4..]).ok()
}

/// Looks at a drone of the running slot. `restarts` is how often systemd had started it again before.
pub(super) fn drone(id: u32, address: SocketAddr, restarts: u32) -> io::Result<DroneFacts> {
    let unit = Unit::look(&service(id))?;
    let answer = ask(address);
    let health = health(&unit, answer.as_ref(), restarts);
    let answer = answer.unwrap_or_default();
    Ok(DroneFacts {
        health,
        in_flight: answer.in_flight,
        version: answer.version,
        dropped: answer.frames.dropped.values().sum(),
        restarts: unit.restarts(),
    })
}

fn health(unit: &Unit, answer: Option<&Answer>, restarts: u32) -> DroneHealth {
    if unit.restarts() > restarts {
        return DroneHealth::Dead(format!("its process was ended ({})", unit.result()));
    }
    match (unit.state(), answer) {
        ("active", Some(answer)) if answer.complaints().is_empty() => DroneHealth::Healthy {
            proven: answer.proven.clone(),
        },
        ("active", Some(answer)) => DroneHealth::Unhealthy(answer.complaints()),
        ("active", None) => DroneHealth::Unhealthy("does not answer".to_owned()),
        ("failed" | "inactive", _)
            if unit.result() == "exit-code" && unit.exit_code() == Some(UNUSABLE) =>
        {
            // A file that can't be used was refused before the trial.
            DroneHealth::FlightOver
        }
        ("failed", _) => DroneHealth::Dead(match unit.exit_code() {
            Some(code) if unit.result() == "exit-code" => {
                format!("its process ended with exit code {code}")
            }
            _ => format!("its process was ended ({})", unit.result()),
        }),
        ("inactive", _) if unit.result() == "success" && unit.exit_code() == Some(0) => {
            DroneHealth::FlightOver
        }
        ("activating", _) if unit.result() != "success" => {
            DroneHealth::Dead(format!("its process was ended ({})", unit.result()))
        }
        (state, _) => DroneHealth::Starting(format!("its service is {state}")),
    }
}

/// Looks at the drones of a slot.
pub(super) fn drones(
    facts: &SlotFacts,
    restarts: &BTreeMap<u32, u32>,
) -> io::Result<BTreeMap<u32, DroneFacts>> {
    let drones = facts.drones.iter().map(|(id, address)| {
        let before = restarts.get(id).copied().unwrap_or(u32::MAX);
        Ok((*id, drone(*id, *address, before)?))
    });
    drones.collect()
}

/// Whether any drone is armed or takes part in a flight; its number.
pub(super) fn in_flight(facts: &SlotFacts) -> Option<u32> {
    let asked = facts.drones.iter();
    let mut flying = asked.filter(|(_, address)| ask(**address).is_some_and(|it| it.in_flight));
    flying.next().map(|(id, _)| *id)
}

/// Looks at the whole host.
pub(super) fn host(disk: &Disk) -> io::Result<HostFacts> {
    let slots = disk.slots()?;
    let current = slots
        .current
        .as_ref()
        .map(|it| disk.facts(it))
        .transpose()?;
    let since_good = fs::symlink_metadata(disk.link(Link::Good)).and_then(|it| it.modified());
    let good_for = since_good.ok().and_then(|since| since.elapsed().ok());
    let is_tried = matches!(
        Unit::look(TRIAL)?.state(),
        "active" | "activating" | "deactivating"
    );
    let home = disk.home();
    // Before the first release the folder is not there yet.
    let space = home.ancestors().find_map(|it| rustix::fs::statvfs(it).ok());
    let space = space.map(|it| it.f_bavail * it.f_frsize);
    Ok(HostFacts {
        drones: match &current {
            Some(facts) => drones(facts, &BTreeMap::new())?,
            None => BTreeMap::new(),
        },
        way_back: slots.way_back().cloned(),
        is_on_trial: is_tried || slots.is_on_trial(),
        good_for_s: slots.good.as_ref().and(good_for).map(|it| it.as_secs()),
        good: slots.good,
        current,
        failure: disk.failure(),
        free_bytes: space.unwrap_or_default(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(properties: [&str; 4], faults: Option<&[&str]>) -> DroneHealth {
        let [state, result, code, restarts] = properties;
        let text = format!(
            "ActiveState={state}\nResult={result}\nExecMainStatus={code}\nNRestarts={restarts}\n"
        );
        let answer = faults.map(|faults| Answer {
            faults: faults.iter().map(ToString::to_string).collect(),
            ..Answer::default()
        });
        health(&Unit::read(&text), answer.as_ref(), 1)
    }

    #[test]
    fn health_follows_from_service_and_answer() {
        use DroneHealth::{Dead, FlightOver, Healthy, Starting, Unhealthy};
        type Case = (
            [&'static str; 4],
            Option<&'static [&'static str]>,
            fn(&DroneHealth) -> bool,
        );
        let table: [Case; 9] = [
            (["active", "success", "0", "1"], Some(&[]), |it| {
                matches!(it, Healthy { .. })
            }),
            (["active", "success", "0", "1"], Some(&["x"]), |it| {
                matches!(it, Unhealthy(_))
            }),
            (["active", "success", "0", "1"], None, |it| {
                matches!(it, Unhealthy(_))
            }),
            (["active", "success", "0", "2"], Some(&[]), |it| {
                matches!(it, Dead(_))
            }),
            (["activating", "success", "0", "1"], None, |it| {
                matches!(it, Starting(_))
            }),
            (["activating", "watchdog", "6", "1"], None, |it| {
                matches!(it, Dead(_))
            }),
            (["failed", "exit-code", "1", "1"], None, |it| {
                matches!(it, Dead(_))
            }),
            (["failed", "exit-code", "2", "1"], None, |it| {
                matches!(it, FlightOver)
            }),
            (["inactive", "success", "0", "1"], None, |it| {
                matches!(it, FlightOver)
            }),
        ];
        for (properties, faults, expected) in table {
            let health = seen(properties, faults);
            assert!(expected(&health), "{properties:?}: {health:?}");
        }
    }

    #[test]
    fn drone_whose_controller_is_silent_is_unhealthy() {
        let healthy =
            Unit::read("ActiveState=active\nResult=success\nExecMainStatus=0\nNRestarts=0\n");
        for (state, is_well) in [("open", true), ("silent", false), ("closed", false)] {
            let json =
                format!("{{\"faults\":[],\"port\":{{\"state\":\"{state}\",\"rc_sent\":7}}}}");
            let answer: Answer = serde_json::from_str(&json).unwrap();
            let health = health(&healthy, Some(&answer), 0);
            assert_eq!(
                matches!(health, DroneHealth::Healthy { .. }),
                is_well,
                "{state}"
            );
        }
    }
}
