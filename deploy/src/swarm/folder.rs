//! The folder of a flight: a fleet's keys, and for each drone its file, its journal and its log.

use std::collections::BTreeMap;
use std::fs::{self, File, TryLockError};
use std::io;
use std::net::{Ipv4Addr, SocketAddr, SocketAddrV4, TcpListener, UdpSocket};
use std::path::{Path, PathBuf};

use muster_machines::identity::NodeId;
use muster_runtime::diagnostic::BadInput;
use muster_runtime::identity::Fleet;
use muster_scenarios::scenario;
use serde::Serialize;

use super::hosts::{Host, Hosts, Reach};
use super::{Request, SwarmError};
use muster_daemon::config::TransportName;

/// The file that tells the folder of a flight from any other; locked while the flight is under way.
const MARK: &str = "flight.lock";

/// What one drone's process has in the folder of a flight.
#[derive(Debug)]
pub(super) struct DroneFolder {
    pub(super) id: NodeId,
    /// Its file, as seen from the folder of the flight.
    pub(super) config: PathBuf,
    /// All that its process needs, its file too, likewise.
    pub(super) files: Vec<PathBuf>,
    /// Where what its process says is kept.
    pub(super) log: PathBuf,
}

#[derive(Serialize)]
struct DroneFile<'a> {
    scenario: &'a Path,
    id: u32,
    stage: &'static str,
    vehicle: &'static str,
    transport: TransportName,
    journal: &'static str,
    log: &'static str,
    keys: Keys,
    #[serde(skip_serializing_if = "Option::is_none")]
    udp: Option<Network>,
    #[serde(skip_serializing_if = "Option::is_none")]
    quic: Option<Network>,
    observe: Option<Observe>,
}

#[derive(Serialize)]
struct Keys {
    drone: String,
    fleet: &'static str,
    roster: &'static str,
    revoked: &'static str,
}

#[derive(Serialize)]
struct Network {
    bind: Option<SocketAddr>,
    group: Option<SocketAddrV4>,
    broadcast: Option<SocketAddrV4>,
    peers: Option<Vec<SocketAddr>>,
    interface: Option<String>,
}

#[derive(Serialize)]
struct Observe {
    http: SocketAddr,
}

/// Makes all that drones need to start, each at its host.
pub(super) fn prepare(
    request: &Request<'_>,
    hosts: &Hosts,
) -> Result<(Vec<DroneFolder>, File), SwarmError> {
    let folder = request.folder;
    let lock = take(folder)?;
    let fleet = Fleet::create(&folder.join("fleet"))?;
    let mut shared: Vec<_> = ["fleet.pub", "roster.toml", "revoked.toml"]
        .map(|name| Path::new("fleet").join(name))
        .into();
    let [scenario, mission] = scenario::side_by_side(request.path)?;
    for (name, text) in [&scenario, &mission] {
        let file = Path::new("scenario").join(name);
        write(&folder.join(&file), text)?;
        shared.push(file);
    }
    let mut drones = Vec::new();
    let mut endpoints = hosts.endpoints().map_err(SwarmError::Ports)?;
    for (id, network) in hosts.networks() {
        let key = fleet.add_drone(id)?;
        let key = key.file_name().unwrap_or_default().to_string_lossy();
        let own = PathBuf::from(format!("drone-{id}"));
        let (udp, quic) = match request.transport {
            TransportName::Udp => (Some(network), None),
            TransportName::Quic => (None, Some(network)),
        };
        let file = DroneFile {
            scenario: &Path::new("../scenario").join(&scenario.0),
            id: id.0,
            stage: "sim",
            vehicle: "closed-form",
            transport: request.transport,
            journal: "journal",
            log: "json",
            keys: Keys {
                drone: format!("../fleet/{key}"),
                fleet: "../fleet/fleet.pub",
                roster: "../fleet/roster.toml",
                revoked: "../fleet/revoked.toml",
            },
            udp,
            quic,
            observe: endpoints.remove(&id).map(|http| Observe { http }),
        };
        let text = toml::to_string(&file).expect("a drone's file has a form in TOML");
        let config = own.join("drone.toml");
        write(&folder.join(&config), &text)?;
        let mut files = shared.clone();
        files.extend([Path::new("fleet").join(&*key), config.clone()]);
        drones.push(DroneFolder {
            id,
            config,
            files,
            log: folder.join(own).join("log.jsonl"),
        });
    }
    Ok((drones, lock))
}

/// Writes a file, in a folder that is made if it is not there.
fn write(path: &Path, text: &str) -> Result<(), SwarmError> {
    let made = path.parent().map_or(Ok(()), fs::create_dir_all);
    made.and_then(|()| fs::write(path, text))
        .map_err(|source| SwarmError::Write {
            path: path.to_owned(),
            source,
        })
}

impl Hosts {
    /// All drones and relays of a swarm at this machine, at addresses of its own at which nobody listens.
    pub(super) fn here(nodes: u32, musterd: &Path) -> io::Result<Self> {
        let sockets = (0..nodes).map(|_| UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)));
        // Held until all are there, so that no two are the same.
        let sockets = sockets.collect::<io::Result<Vec<_>>>()?;
        let addresses = sockets.iter().map(UdpSocket::local_addr);
        let drones = (0..).map(NodeId).zip(addresses);
        let drones = drones.map(|(id, address)| Ok((id, Some(address?))));
        let here = Host {
            run: Vec::new(),
            musterd: musterd.to_owned(),
            drones: drones.collect::<io::Result<_>>()?,
            interface: None,
        };
        Ok(Self {
            reach: Reach::Peers,
            hosts: vec![here],
        })
    }

    /// Where drones of this machine can be asked what they do: addresses of its own at which nobody is asked anything.
    fn endpoints(&self) -> io::Result<BTreeMap<NodeId, SocketAddr>> {
        let here = self.hosts.iter().filter(|host| host.is_here());
        let drones = here.flat_map(|host| host.drones.keys().copied());
        let listeners = drones.map(|id| Ok((id, TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?)));
        // Held until all are there, so that no two are the same.
        let listeners = listeners.collect::<io::Result<Vec<_>>>()?;
        let addresses = listeners.iter();
        addresses
            .map(|(id, listener)| Ok((*id, listener.local_addr()?)))
            .collect()
    }

    /// How each drone talks, in the order of their numbers.
    fn networks(&self) -> BTreeMap<NodeId, Network> {
        let drones = |host: &'_ Host| host.drones.clone();
        let all: Vec<_> = self.hosts.iter().flat_map(drones).collect();
        let network = |host: &Host, id: NodeId, bind: Option<SocketAddr>| {
            let others = all.iter().filter(|(other, _)| *other != id);
            let (group, broadcast, peers) = match self.reach {
                Reach::Group(all) => (Some(all), None, None),
                Reach::Broadcast(all) => (None, Some(all), None),
                Reach::Peers => (None, None, Some(others.filter_map(|it| it.1).collect())),
            };
            Network {
                bind,
                group,
                broadcast,
                peers,
                interface: host.interface.clone(),
            }
        };
        let of_host = |host: &Host| {
            let drones = host.drones.iter();
            let drones = drones.map(|(id, bind)| (*id, network(host, *id, *bind)));
            drones.collect::<Vec<_>>()
        };
        self.hosts.iter().flat_map(of_host).collect()
    }
}

/// Has the folder for this flight alone, empty but for a mark: what an earlier flight left is removed, and nothing else.
fn take(folder: &Path) -> Result<File, SwarmError> {
    let write = |source| SwarmError::Write {
        path: folder.to_owned(),
        source,
    };
    let refuse = |message: &str, help: &str| {
        SwarmError::Refused(BadInput::without_excerpt(folder, message, help))
    };
    let mark = folder.join(MARK);
    if folder.exists() && !mark.exists() {
        let message = "is there already and is not of an earlier flight, so it is left as it is";
        return Err(refuse(message, "--out takes another folder"));
    }
    fs::create_dir_all(folder).map_err(write)?;
    let lock = File::create(&mark).map_err(write)?;
    lock.try_lock().map_err(|error| match error {
        TryLockError::WouldBlock => {
            let help = "wait for its end, or give another folder with --out";
            refuse("another flight is under way in this folder", help)
        }
        TryLockError::Error(source) => write(source),
    })?;
    for entry in fs::read_dir(folder).map_err(write)? {
        let path = entry.map_err(write)?.path();
        if path.is_dir() {
            fs::remove_dir_all(&path).map_err(write)?;
        }
    }
    Ok(lock)
}
