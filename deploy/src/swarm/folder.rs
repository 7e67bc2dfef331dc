//! The folder of a flight: a fleet's keys, and for each drone its file, its journal and its log.

use std::fs;
use std::io;
use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::path::{Path, PathBuf};

use muster_machines::identity::NodeId;
use muster_runtime::identity::Fleet;
use serde::Serialize;

use super::{Request, SwarmError};

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
struct File<'a> {
    scenario: &'a Path,
    id: u32,
    stage: &'static str,
    vehicle: &'static str,
    transport: &'static str,
    journal: &'static str,
    log: &'static str,
    keys: Keys,
    udp: Udp,
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

/// Makes all that drones need to start.
pub(super) fn prepare(request: &Request<'_>) -> Result<Vec<DroneFolder>, SwarmError> {
    let write = |path: &Path| {
        let path = path.to_owned();
        |source| SwarmError::Write { path, source }
    };
    let folder = request.folder;
    if folder.exists() {
        fs::remove_dir_all(folder).map_err(write(folder))?;
    }
    let fleet = Fleet::create(&folder.join("fleet"))?;
    let scenario = fs::canonicalize(request.path).map_err(write(request.path))?;
    let addresses = free_addresses(request.scenario.nodes()).map_err(SwarmError::Ports)?;
    let mut drones = Vec::new();
    for (id, bind) in (0..).zip(&addresses) {
        let key = fleet.add_drone(NodeId(id))?;
        let own = folder.join(format!("drone-{id}"));
        fs::create_dir_all(&own).map_err(write(&own))?;
        let key = key.file_name().unwrap_or_default().to_string_lossy();
        let file = File {
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
    Ok(drones)
}

/// So many addresses of this machine's own at which nobody listens.
fn free_addresses(nodes: u32) -> io::Result<Vec<SocketAddr>> {
    let sockets = (0..nodes).map(|_| UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)));
    let sockets = sockets.collect::<io::Result<Vec<_>>>()?;
    sockets.iter().map(UdpSocket::local_addr).collect()
}
