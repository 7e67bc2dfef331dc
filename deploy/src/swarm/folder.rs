//! The folder of a flight: keys of the fleet, and the file, journal and log of each drone.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io;
use std::net::{Ipv4Addr, SocketAddr, TcpListener, UdpSocket};
use std::path::{Path, PathBuf};

use muster_machines::identity::NodeId;
use muster_runtime::diagnostic::BadInput;
use muster_runtime::file::Lock;
use muster_runtime::identity::Fleet;
use muster_runtime::schema::Or;
use muster_scenarios::scenario;

use super::controllers::{Port, Ports};
use super::{Request, SwarmError};
use crate::drone_file::{keys, tables};
use crate::hosts::{Host, Hosts, Reach};
use muster_daemon::config::{
    DroneFile, LevelName, LogName, Observe, ReceiverName, StageName, VehicleName,
};

/// The file that marks the folder of a flight; locked during the flight.
const LOCK_FILE: &str = "flight.lock";

/// The files of one drone in the folder of a flight.
#[derive(Debug)]
pub(super) struct DroneFolder {
    pub(super) id: NodeId,
    /// The drone's file, relative to the folder of the flight.
    pub(super) config: PathBuf,
    /// All files that its process needs, including `config`; relative to the folder of the flight.
    pub(super) files: Vec<PathBuf>,
    /// The log of its process's output.
    pub(super) log: PathBuf,
    /// Where its flight controller is. `None` if it has none.
    pub(super) controller: Option<SocketAddr>,
}

/// Creates the folder of a flight: keys, drone files and other files of all drones.
pub(super) fn prepare(
    request: &Request<'_>,
    hosts: &Hosts,
    ports: &Ports,
) -> Result<(Vec<DroneFolder>, Lock), SwarmError> {
    let lock = lock(request.folder)?;
    let drones = write_files(request, hosts, ports, LogName::Json)?;
    Ok((drones, lock))
}

/// Creates keys, drone files and other files of all drones in a folder that does not exist or is empty, for processes that
/// are started by hand.
pub(super) fn prepare_by_hand(
    request: &Request<'_>,
    hosts: &Hosts,
    ports: &Ports,
) -> Result<Vec<DroneFolder>, SwarmError> {
    let folder = request.folder;
    let is_used = match fs::read_dir(folder) {
        Ok(mut entries) => entries.next().is_some(),
        Err(_) => folder.symlink_metadata().is_ok(),
    };
    if is_used {
        let help = "name a new folder; keys are never overwritten";
        return Err(
            BadInput::without_excerpt(folder, "exists and is not an empty folder", help).into(),
        );
    }
    write_files(request, hosts, ports, LogName::Human)
}

fn write_files(
    request: &Request<'_>,
    hosts: &Hosts,
    ports: &Ports,
    log: LogName,
) -> Result<Vec<DroneFolder>, SwarmError> {
    let folder = request.folder;
    let fleet = Fleet::create(&folder.join("fleet"))?;
    let (scenario, shared) = write_scenario(request)?;
    let mut drones = Vec::new();
    let mut status_addresses = hosts.status_addresses().map_err(SwarmError::Ports)?;
    for (id, network) in hosts.networks() {
        let key = fleet.add_drone(id)?;
        let key = key.file_name().unwrap_or_default().to_string_lossy();
        let own = PathBuf::from(format!("drone-{id}"));
        let [udp, quic] = tables(request.transport, network);
        let addresses = ports.get(&id).map(Port::addresses).transpose();
        let addresses = addresses.map_err(SwarmError::Ports)?;
        let controller = addresses.map(|it| it.controller);
        let vehicle = controller.map_or(VehicleName::ClosedForm, |_| VehicleName::Msp);
        let receiver = ReceiverName::from(request.scenario.plan.receiver);
        let file = DroneFile {
            scenario: Path::new("../scenario").join(&scenario).into(),
            id: id.0.into(),
            swarm: Or::default(),
            stage: StageName::Sim.into(),
            vehicle: vehicle.into(),
            port: controller.map(|address| format!("tcp:{address}").into()),
            receiver: controller.map(|_| receiver.into()),
            pose: addresses.and_then(|it| it.pose).map(Into::into),
            flow: (addresses.and_then(|it| it.flow)).map(|address| format!("tcp:{address}").into()),
            transport: request.transport.into(),
            journal: "journal".into(),
            flight: Or::default(),
            log,
            log_level: LevelName::default(),
            keys: keys("../fleet", &key, None),
            udp,
            quic,
            observe: status_addresses
                .remove(&id)
                .map(|http| Observe { http: http.into() }),
        };
        let text = file.to_toml();
        let config = own.join("drone.toml");
        write(&folder.join(&config), &text)?;
        let mut files = shared.clone();
        files.extend([Path::new("fleet").join(&*key), config.clone()]);
        drones.push(DroneFolder {
            id,
            config,
            files,
            log: folder.join(own).join("log.jsonl"),
            controller,
        });
    }
    Ok(drones)
}

/// Writes the scenario and its mission. Returns the name of the scenario's file, and the files that all processes need.
fn write_scenario(request: &Request<'_>) -> Result<(String, Vec<PathBuf>), SwarmError> {
    let mut shared: Vec<_> = ["fleet.pub", "roster.toml", "revoked.toml"]
        .map(|name| Path::new("fleet").join(name))
        .into();
    let [scenario, mission] = scenario::side_by_side(request.path, request.overrides)?;
    for (name, text) in [&scenario, &mission] {
        let file = Path::new("scenario").join(name);
        write(&request.folder.join(&file), text)?;
        shared.push(file);
    }
    Ok((scenario.0, shared))
}

/// Writes a file and creates its folder if needed.
fn write(path: &Path, text: &str) -> Result<(), SwarmError> {
    let created = path.parent().map_or(Ok(()), fs::create_dir_all);
    created
        .and_then(|()| fs::write(path, text))
        .map_err(|source| SwarmError::Write {
            path: path.to_owned(),
            source,
        })
}

impl Hosts {
    /// All drones and relays on this machine, at free UDP ports of the loopback interface.
    pub(super) fn local(nodes: u32, musterd: &Path) -> io::Result<Self> {
        let sockets = (0..nodes).map(|_| UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)));
        // Kept open until all are bound, so that the ports differ.
        let sockets = sockets.collect::<io::Result<Vec<_>>>()?;
        let addresses = sockets.iter().map(UdpSocket::local_addr);
        let drones = (0..).map(NodeId).zip(addresses);
        let drones = drones.map(|(id, address)| Ok((id, Some(address?))));
        let host = Host {
            run: Vec::new(),
            musterd: musterd.to_owned(),
            drones: drones.collect::<io::Result<_>>()?,
            interface: None,
        };
        Ok(Self {
            reach: Reach::Peers,
            hosts: vec![host],
        })
    }

    /// HTTP addresses for the status of this machine's drones: free TCP ports of the loopback interface.
    fn status_addresses(&self) -> io::Result<BTreeMap<NodeId, SocketAddr>> {
        let local = self.hosts.iter().filter(|host| host.is_local());
        let drones = local.flat_map(|host| host.drones.keys().copied());
        let listeners = drones.map(|id| Ok((id, TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?)));
        // Kept open until all are bound, so that the ports differ.
        let listeners = listeners.collect::<io::Result<Vec<_>>>()?;
        let addresses = listeners.iter();
        addresses
            .map(|(id, listener)| Ok((*id, listener.local_addr()?)))
            .collect()
    }
}

/// Creates and locks the folder for this flight, and removes the subfolders of an earlier flight. Refuses any other folder.
fn lock(folder: &Path) -> Result<Lock, SwarmError> {
    let write = |source| SwarmError::Write {
        path: folder.to_owned(),
        source,
    };
    let refuse = |message: &str, help: &str| {
        SwarmError::Refused(BadInput::without_excerpt(folder, message, help))
    };
    let lock_file = folder.join(LOCK_FILE);
    if folder.exists() && !lock_file.exists() {
        let message = "exists and does not belong to an earlier flight";
        return Err(refuse(message, "give another folder with --out"));
    }
    fs::create_dir_all(folder).map_err(write)?;
    let lock = File::create(&lock_file).map_err(write)?;
    let lock = Lock::of(&lock).map_err(write)?.ok_or_else(|| {
        let help = "wait for its end, or give another folder with --out";
        refuse("is in use by another flight", help)
    })?;
    for entry in fs::read_dir(folder).map_err(write)? {
        let path = entry.map_err(write)?.path();
        if path.is_dir() {
            fs::remove_dir_all(&path).map_err(write)?;
        }
    }
    Ok(lock)
}
