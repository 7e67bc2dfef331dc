//! A fleet: what the hosts file says beyond the hosts of a flight.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::Duration;

use muster_daemon::config::{FlightNumber, ReceiverName, StageName, TransportName};
use muster_daemon::slots::GateLimits;
use muster_machines::identity::NodeId;
use muster_runtime::diagnostic::{BadInput, TomlFile, did_you_mean};
use muster_runtime::identity::is_plain;
use muster_runtime::plan::to_usize;
use muster_runtime::schema::{Located, Or};
use muster_scenarios::scenario::{self, Scenario};

use super::raw::{DroppedPerSecond, RawHost, RawWave, SoakSeconds};
use super::{FORMAT, File, Host, Hosts};

/// A fleet and how it is changed.
#[derive(Debug, Clone)]
pub struct Fleet {
    /// The hosts, in the order of the file.
    pub hosts: Vec<FleetHost>,
    /// The waves, in their order. Each host is in exactly one.
    pub waves: Vec<Wave>,
    /// The scenario's path, or the name of a shipped one.
    pub scenario_path: PathBuf,
    /// The scenario that the drones fly.
    pub scenario: Scenario,
    /// Folder of the fleet's keys.
    pub keys: PathBuf,
    /// How frames are sent.
    pub transport: TransportName,
    /// Number of the flight.
    pub flight: Or<FlightNumber, 1>,
    /// When a release counts as good on a host.
    pub gate: GateLimits,
    /// The network settings of the drones.
    pub(crate) network: Hosts,
}

/// A host of a fleet.
#[derive(Debug, Clone)]
pub struct FleetHost {
    /// Its name; letters, digits and `._-`.
    pub name: String,
    /// The command that runs other commands there. Empty for this machine.
    pub run: Vec<String>,
    /// Its drones.
    pub drones: BTreeSet<NodeId>,
    /// What its drones may do.
    pub stage: StageName,
    /// The flight controller of its only drone. `None` for simulated vehicles.
    pub controller: Option<Controller>,
}

/// A flight controller of a host.
#[derive(Debug, Clone)]
pub struct Controller {
    /// Where it is, as in a drone's file.
    pub port: String,
    /// Who else commands it.
    pub receiver: ReceiverName,
}

/// A wave of a rollout.
#[derive(Debug, Clone, PartialEq)]
pub struct Wave {
    /// Its hosts, as indices.
    pub hosts: Vec<usize>,
    /// How many of them are changed at once.
    pub at_once: usize,
    /// Time that they must stay healthy before the next wave.
    pub soak: Duration,
    /// The most frames that a drone may drop while the wave soaks, a second.
    pub dropped_per_s_max: f64,
}

impl Fleet {
    /// Reads a fleet's file and its scenario.
    ///
    /// # Errors
    /// If a file can't be used; the error shows the line and what is accepted.
    pub fn load(path: &Path) -> Result<Self, BadInput> {
        File(TomlFile::read(path, FORMAT)?).fleet()
    }

    /// The host of a name. Errors name `path`, the fleet's file.
    ///
    /// # Errors
    /// If there is none.
    pub fn host(&self, path: &Path, name: &str) -> Result<&FleetHost, BadInput> {
        self.hosts
            .iter()
            .find(|host| host.name == name)
            .ok_or_else(|| {
                let names = self.hosts.iter().map(|host| host.name.as_str());
                let near = did_you_mean(name, names.clone());
                let message = format!("has no host \"{name}\"{near}");
                let help = format!("its hosts are {}", names.collect::<Vec<_>>().join(", "));
                BadInput::without_excerpt(path, message, help)
            })
    }
}

impl File {
    fn fleet(&self) -> Result<Fleet, BadInput> {
        let raw = &self.0.raw;
        let scenario_path = self.scenario_path()?;
        let scenario = scenario::load(&scenario_path, &[])?;
        let keys = self.needed(raw.keys.as_ref(), "`keys`, the folder of the fleet's keys")?;
        let network = self.hosts(scenario.plan.nodes())?;
        let hosts = raw.hosts.iter().zip(&network.hosts);
        let hosts = hosts.map(|(raw, host)| self.host(raw.get_ref(), host));
        let hosts = hosts.collect::<Result<Vec<_>, _>>()?;
        self.check_names(&hosts)?;
        Ok(Fleet {
            waves: self.waves(&hosts)?,
            hosts,
            scenario_path,
            scenario,
            keys: self.0.resolve(keys),
            transport: raw.transport.unwrap_or(TransportName::Udp),
            flight: raw.flight.clone(),
            gate: GateLimits {
                within_s: raw.gate.within_s.to_u32(),
                hold_s: raw.gate.hold_s.to_u32(),
            },
            network,
        })
    }

    fn needed<'a, T>(&self, field: Option<&'a Located<T>>, what: &str) -> Result<&'a T, BadInput> {
        field.map(Located::get_ref).ok_or_else(|| {
            let message = format!("`muster deploy` needs {what}");
            self.0.error(0..0, &message)
        })
    }

    /// The scenario beside this file, or the shipped one of that name.
    fn scenario_path(&self) -> Result<PathBuf, BadInput> {
        let named = self.needed(self.0.raw.scenario.as_ref(), "`scenario`")?;
        let beside = self.0.resolve(named);
        Ok(if beside.is_file() || !scenario::is_shipped(named) {
            beside
        } else {
            named.clone()
        })
    }

    fn host(&self, raw: &RawHost, host: &Host) -> Result<FleetHost, BadInput> {
        let stage = raw
            .stage
            .as_ref()
            .map_or(StageName::Sim, |it| *it.get_ref());
        let controller = match (&raw.controller, &raw.receiver) {
            (Some(port), Some(receiver)) => {
                if raw.drones.get_ref().len() > 1 {
                    let message = "a host with a controller has one drone";
                    return Err(self.0.error(raw.drones.span(), message));
                }
                Some(Controller {
                    port: port.get_ref().clone(),
                    receiver: *receiver.get_ref(),
                })
            }
            (Some(port), None) => {
                let message = "`controller` needs `receiver`";
                return Err(self.0.error(port.span(), message));
            }
            (None, Some(receiver)) => {
                let message = "`receiver` needs `controller`";
                return Err(self.0.error(receiver.span(), message));
            }
            (None, None) => None,
        };
        if let (None, Some(stage)) = (&controller, &raw.stage)
            && *stage.get_ref() != StageName::Sim
        {
            let message =
                "a simulated vehicle flies in the stage \"sim\" only; others need `controller`";
            return Err(self.0.error(stage.span(), message));
        }
        Ok(FleetHost {
            name: self.name(raw, host)?,
            run: host.run.clone(),
            drones: host.drones.keys().copied().collect(),
            stage,
            controller,
        })
    }

    fn name(&self, raw: &RawHost, host: &Host) -> Result<String, BadInput> {
        let Some(name) = &raw.name else {
            let last = host.run.last().map_or("local", String::as_str);
            return Ok(last.rsplit('@').next().unwrap_or(last).to_owned());
        };
        let text = name.get_ref();
        if !is_plain(text) || text.contains(['/', '@', '+']) {
            let message =
                "a host's name has letters, digits and `._-`, and begins with a letter or digit";
            return Err(self.0.error(name.span(), message));
        }
        Ok(text.clone())
    }

    fn check_names(&self, hosts: &[FleetHost]) -> Result<(), BadInput> {
        let mut seen = BTreeSet::new();
        for (host, raw) in hosts.iter().zip(&self.0.raw.hosts) {
            if !seen.insert(&host.name) {
                let message = format!(
                    "two hosts have the name \"{}\"; give each a `name`",
                    host.name
                );
                return Err(self.0.error(raw.get_ref().drones.span(), &message));
            }
        }
        Ok(())
    }

    fn waves(&self, hosts: &[FleetHost]) -> Result<Vec<Wave>, BadInput> {
        if self.0.raw.waves.is_empty() {
            return Ok(default_waves(hosts.len()));
        }
        let numbers = hosts
            .iter()
            .zip(0..)
            .map(|(host, nth)| (host.name.as_str(), nth));
        let mut left: BTreeMap<&str, usize> = numbers.collect();
        let mut waves = Vec::new();
        for raw in &self.0.raw.waves {
            let mut members = Vec::new();
            for name in raw.get_ref().hosts.get_ref() {
                let Some(nth) = left.remove(name.get_ref().as_str()) else {
                    return Err(self.not_left(name, hosts));
                };
                members.push(nth);
            }
            waves.push(self.wave(raw.get_ref(), members)?);
        }
        if let Some(missing) = left.keys().next() {
            let last = self
                .0
                .raw
                .waves
                .last()
                .map_or(0..0, |it| it.get_ref().hosts.span());
            let message = format!("the host \"{missing}\" is in no wave");
            return Err(self.0.error(last, &message));
        }
        Ok(waves)
    }

    fn not_left(&self, name: &Located<String>, hosts: &[FleetHost]) -> BadInput {
        let named = name.get_ref();
        let is_host = hosts.iter().any(|host| host.name == *named);
        let message = if is_host {
            format!("the host \"{named}\" is in two waves")
        } else {
            let names = hosts.iter().map(|host| host.name.as_str());
            let near = did_you_mean(named, names);
            format!("no host has the name \"{named}\"{near}")
        };
        self.0.error(name.span(), &message)
    }

    fn wave(&self, raw: &RawWave, hosts: Vec<usize>) -> Result<Wave, BadInput> {
        if hosts.is_empty() {
            return Err(self.0.error(raw.hosts.span(), "the wave has no host"));
        }
        let all = hosts.len();
        Ok(Wave {
            at_once: (raw.at_once.as_ref()).map_or(all, |it| to_usize(it.get_ref().0)),
            hosts,
            soak: Duration::from_secs(raw.soak_s.0),
            dropped_per_s_max: raw.dropped_per_s_max.0,
        })
    }
}

/// The first host, then the others.
fn default_waves(hosts: usize) -> Vec<Wave> {
    let wave = |hosts: Range<usize>| Wave {
        at_once: hosts.len(),
        hosts: hosts.collect(),
        soak: Duration::from_secs(SoakSeconds::default().0),
        dropped_per_s_max: DroppedPerSecond::default().0,
    };
    let waves = [wave(0..1.min(hosts)), wave(1.min(hosts)..hosts)];
    waves
        .into_iter()
        .filter(|wave| !wave.hosts.is_empty())
        .collect()
}

#[cfg(test)]
mod tests;
