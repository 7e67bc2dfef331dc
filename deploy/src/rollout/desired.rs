//! What each host should have: the release, and the configuration of its drones.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;

use muster_daemon::config::{
    DroneFile, LevelName, LogName, Network, Observe, StageName, TransportName, VehicleName,
};
use muster_daemon::slots::{Incoming, IncomingFile, SlotFacts, configuration_digest};
use muster_machines::identity::NodeId;
use muster_runtime::diagnostic::{BadInput, read_text};
use muster_runtime::identity::{DroneKey, ReleaseFile, Roster, hex, is_plain};
use muster_runtime::schema::Or;
use muster_scenarios::scenario;

use crate::drone_file::{keys, tables};
use crate::hosts::{Fleet, FleetHost, Reach};
use crate::release::Release;

/// Port of drone 0's status on its host; the others use the following ports.
const STATUS_PORT: u16 = 9_100;

/// Folder of the drones' state on a host.
const STATE: &str = "/var/lib/muster";

/// What a host should have.
#[derive(Debug, Clone)]
pub struct Desired {
    /// What the slot has, without peers.
    pub facts: SlotFacts,
    /// The configuration: contents by path in the slot.
    configuration: BTreeMap<String, Vec<u8>>,
}

/// What each host of a fleet should have, in the order of the hosts.
///
/// # Errors
/// If a key, list or scenario can't be used, or a drone has no key.
pub fn desired(fleet: &Fleet, release: &Release) -> Result<Vec<Desired>, BadInput> {
    let shared = shared(fleet)?;
    let mut networks = fleet.network.networks();
    let mut all = Vec::new();
    for host in &fleet.hosts {
        let mut configuration = shared.clone();
        for id in &host.drones {
            let network = networks
                .remove(id)
                .expect("each drone of a host has a network");
            add_drone(&mut configuration, fleet, host, (*id, network))?;
        }
        let hashes = configuration
            .iter()
            .map(|(path, content)| (path.clone(), ReleaseFile::of(content).sha256));
        let manifest = &release.manifest;
        let status = host.drones.iter().map(|id| (id.0, status_address(*id)));
        all.push(Desired {
            facts: SlotFacts {
                version: manifest.version.clone(),
                release: hex(&manifest.digest()),
                configuration: configuration_digest(&hashes.collect()),
                wire: manifest.wire.clone(),
                journal: manifest.journal.clone(),
                drones: status.collect(),
                peers: BTreeSet::new(),
                gate: fleet.gate,
                network: Some(network_in_words(fleet)),
            },
            configuration,
        });
    }
    Ok(all)
}

/// How drones of a fleet reach each other. Addresses of peers are left out: hosts whose lists differ may hear each other.
fn network_in_words(fleet: &Fleet) -> String {
    let transport = match fleet.transport {
        TransportName::Udp => "udp",
        TransportName::Quic => "quic",
    };
    match fleet.network.reach {
        Reach::Group(group) => format!("{transport} to {group}"),
        Reach::Broadcast(all) => format!("{transport} to {all}"),
        Reach::Peers => format!("{transport} to each address"),
    }
}

/// Files that all drones have.
fn shared(fleet: &Fleet) -> Result<BTreeMap<String, Vec<u8>>, BadInput> {
    let mut files = BTreeMap::new();
    for name in ["fleet.pub", "roster.toml", "revoked.toml"] {
        let text = read_text(&fleet.keys.join(name))?;
        files.insert(format!("config/{name}"), text.into_bytes());
    }
    for (name, text) in scenario::side_by_side(&fleet.scenario_path, &[])? {
        if !is_plain(&name) {
            let message = format!("no file of a host can have the name \"{name}\"");
            let help = "name it with letters, digits and `._@+-`, beginning with a letter or digit";
            return Err(BadInput::without_excerpt(
                &fleet.scenario_path,
                message,
                help,
            ));
        }
        files.insert(format!("config/{name}"), text.into_bytes());
    }
    Ok(files)
}

/// Adds a drone's file, key and grant.
fn add_drone(
    files: &mut BTreeMap<String, Vec<u8>>,
    fleet: &Fleet,
    host: &FleetHost,
    (id, network): (NodeId, Network),
) -> Result<(), BadInput> {
    let [(scenario, _), _] = scenario::side_by_side(&fleet.scenario_path, &[])?;
    let (key, grant) = (format!("drone-{id}.key"), format!("drone-{id}.grant"));
    let mut put = |name: &str| -> Result<(), BadInput> {
        let path = fleet.keys.join(name);
        let content = fs::read(&path).map_err(|error| {
            let help = format!(
                "`muster keys drone {} {id}` makes a drone's key",
                fleet.keys.display()
            );
            BadInput::without_excerpt(&path, error, help)
        })?;
        files.insert(format!("config/{name}"), content);
        Ok(())
    };
    // Refuses a key that others can read.
    DroneKey::load(&fleet.keys.join(&key))?;
    put(&key)?;
    let needs_grant = matches!(host.stage, StageName::Tethered | StageName::Flight);
    if needs_grant {
        put(&grant)?;
    }
    let [udp, quic] = tables(fleet.transport, network);
    let controller = host.controller.as_ref();
    let vehicle = controller.map_or(VehicleName::ClosedForm, |_| VehicleName::Msp);
    let file = DroneFile {
        scenario: PathBuf::from(&scenario).into(),
        id: id.0.into(),
        swarm: Or::default(),
        stage: host.stage.into(),
        vehicle: vehicle.into(),
        port: controller.map(|it| it.port.clone().into()),
        receiver: controller.map(|it| it.receiver.into()),
        pose: None,
        flow: None,
        transport: fleet.transport.into(),
        journal: format!("{STATE}/journal-{id}").into(),
        flight: fleet.flight.clone(),
        log: LogName::Human,
        log_level: LevelName::default(),
        keys: keys("", &key, needs_grant.then(|| grant.into())),
        udp,
        quic,
        observe: Some(Observe {
            http: status_address(id).into(),
        }),
    };
    let text = file.to_toml().into_bytes();
    files.insert(format!("config/drone-{id}.toml"), text);
    Ok(())
}

fn status_address(id: NodeId) -> SocketAddr {
    let port = u32::from(STATUS_PORT) + id.0 % 10_000;
    let port = u16::try_from(port).expect("below 20,000");
    SocketAddr::from((Ipv4Addr::LOCALHOST, port))
}

/// Why a host can't have a release.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("the release has no programs for {0}")]
pub struct OtherProcessor(pub String);

impl Desired {
    /// Name of the slot.
    #[must_use]
    pub fn id(&self) -> String {
        self.facts.id()
    }

    /// The slot for a host with this processor, and the contents of its files. Each drone must hear the peers before it is
    /// good.
    ///
    /// # Errors
    /// If the release has no programs for the processor.
    pub fn slot(
        &self,
        release: &Release,
        processor: &str,
        peers: BTreeSet<u32>,
    ) -> Result<(Incoming, Vec<u8>), OtherProcessor> {
        let program = format!("{processor}/musterd");
        let mut files = Vec::new();
        let mut contents = Vec::new();
        let released = [
            ("musterd", program.as_str()),
            ("musterd@.service", "units/musterd@.service"),
            ("muster-slots.service", "units/muster-slots.service"),
        ];
        for (path, name) in released {
            let content = release.files.get(name);
            let content = content.ok_or_else(|| OtherProcessor(processor.to_owned()))?;
            files.push((path.to_owned(), Some(name.to_owned()), content));
        }
        let configuration = self.configuration.iter();
        files.extend(configuration.map(|(path, content)| (path.clone(), None, content)));
        let files = files.into_iter().map(|(path, in_release, content)| {
            contents.extend_from_slice(content);
            IncomingFile {
                is_secret: path.ends_with(".key"),
                path,
                in_release,
                bytes: content.len() as u64,
            }
        });
        let incoming = Incoming {
            files: files.collect(),
            manifest: release.manifest_text.clone(),
            facts: SlotFacts {
                peers,
                ..self.facts.clone()
            },
        };
        Ok((incoming, contents))
    }
}

/// Checks that the roster has all drones of a fleet.
///
/// # Errors
/// If one is missing.
pub fn check_roster(fleet: &Fleet, roster: &Roster) -> Result<(), BadInput> {
    let listed: BTreeSet<_> = roster.drones().collect();
    let mut drones = fleet.hosts.iter().flat_map(|host| &host.drones);
    match drones.find(|id| !listed.contains(id)) {
        None => Ok(()),
        Some(missing) => {
            let path = fleet.keys.join("roster.toml");
            let message = format!("has no drone {missing}, which the fleet's file has");
            let help = format!(
                "`muster keys drone {} {missing}` adds it",
                fleet.keys.display()
            );
            Err(BadInput::without_excerpt(&path, message, help))
        }
    }
}

#[cfg(test)]
pub(super) mod tests;
