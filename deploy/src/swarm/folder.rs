//! The folder of a flight: a fleet's keys, and for each drone its file, its journal and its log.

use std::fs::{self, File, TryLockError};
use std::io;
use std::net::{Ipv4Addr, SocketAddr, TcpListener, UdpSocket};
use std::path::{Path, PathBuf};

use muster_machines::identity::NodeId;
use muster_runtime::diagnostic::BadInput;
use muster_runtime::identity::Fleet;
use serde::Serialize;

use super::{Request, SwarmError};

/// The file that tells the folder of a flight from any other; locked while the flight is under way.
const MARK: &str = "flight.lock";

/// The folder of one drone's process.
#[derive(Debug)]
pub(super) struct DroneFolder {
    pub(super) id: NodeId,
    /// Its file.
    pub(super) config: PathBuf,
    /// Where what its process says is kept.
    pub(super) log: PathBuf,
}

#[derive(Serialize)]
struct DroneFile<'a> {
    scenario: &'a Path,
    id: u32,
    stage: &'static str,
    vehicle: &'static str,
    transport: &'static str,
    journal: &'static str,
    log: &'static str,
    keys: Keys,
    udp: Udp,
    observe: Observe,
}

#[derive(Serialize)]
struct Keys {
    drone: String,
    fleet: &'static str,
    roster: &'static str,
    expelled: &'static str,
}

#[derive(Serialize)]
struct Udp {
    bind: SocketAddr,
    peers: Vec<SocketAddr>,
}

#[derive(Serialize)]
struct Observe {
    http: SocketAddr,
}

/// Makes all that drones need to start.
pub(super) fn prepare(request: &Request<'_>) -> Result<(Vec<DroneFolder>, File), SwarmError> {
    let write = |path: &Path| {
        let path = path.to_owned();
        |source| SwarmError::Write { path, source }
    };
    let folder = request.folder;
    let lock = take(folder)?;
    let fleet = Fleet::create(&folder.join("fleet"))?;
    let scenario = fs::canonicalize(request.path).map_err(write(request.path))?;
    let nodes = request.scenario.nodes();
    let addresses = free_addresses(nodes).map_err(SwarmError::Ports)?;
    let endpoints = free_endpoints(nodes).map_err(SwarmError::Ports)?;
    let mut drones = Vec::new();
    for ((id, bind), http) in (0..).zip(&addresses).zip(endpoints) {
        let key = fleet.add_drone(NodeId(id))?;
        let own = folder.join(format!("drone-{id}"));
        fs::create_dir_all(&own).map_err(write(&own))?;
        let key = key.file_name().unwrap_or_default().to_string_lossy();
        let file = DroneFile {
            scenario: &scenario,
            id,
            stage: "sim",
            vehicle: "closed-form",
            transport: "udp",
            journal: "journal",
            log: "json",
            keys: Keys {
                drone: format!("../fleet/{key}"),
                fleet: "../fleet/fleet.pub",
                roster: "../fleet/roster.toml",
                expelled: "../fleet/expelled.toml",
            },
            udp: Udp {
                bind: *bind,
                peers: addresses.iter().filter(|it| *it != bind).copied().collect(),
            },
            observe: Observe { http },
        };
        let text = toml::to_string(&file).expect("a drone's file has a form in TOML");
        let config = own.join("drone.toml");
        fs::write(&config, text).map_err(write(&config))?;
        drones.push(DroneFolder {
            id: NodeId(id),
            config,
            log: own.join("log.jsonl"),
        });
    }
    Ok((drones, lock))
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

/// So many addresses of this machine's own at which nobody listens.
fn free_addresses(nodes: u32) -> io::Result<Vec<SocketAddr>> {
    let sockets = (0..nodes).map(|_| UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)));
    let sockets = sockets.collect::<io::Result<Vec<_>>>()?;
    sockets.iter().map(UdpSocket::local_addr).collect()
}

/// So many addresses of this machine's own at which nobody is asked anything.
fn free_endpoints(nodes: u32) -> io::Result<Vec<SocketAddr>> {
    let listeners = (0..nodes).map(|_| TcpListener::bind((Ipv4Addr::LOCALHOST, 0)));
    let listeners = listeners.collect::<io::Result<Vec<_>>>()?;
    listeners.iter().map(TcpListener::local_addr).collect()
}
