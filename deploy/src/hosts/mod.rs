//! The hosts file: which drones' processes run on which host, and how their frames reach each other. For `muster deploy` it is
//! the fleet's file, with more in it.

mod fleet;
mod raw;

use std::collections::BTreeMap;
use std::net::{SocketAddr, SocketAddrV4};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use muster_machines::identity::NodeId;
use muster_runtime::diagnostic::{BadInput, FileFormat, TomlFile};
use muster_runtime::schema::{self, FieldList, FileSchema};

pub use self::fleet::{Controller, Fleet, FleetHost, Wave};
use self::raw::{Raw, RawHost};

/// What a hosts file may hold.
#[must_use]
pub fn schema() -> &'static FileSchema {
    static SCHEMA: LazyLock<FileSchema> =
        LazyLock::new(|| FileSchema::of::<Raw>("Hosts of a muster swarm"));
    &SCHEMA
}

/// The reference of hosts files as a page in Markdown.
#[must_use]
pub fn reference() -> String {
    let introduction = "A hosts file tells `muster swarm --hosts` and `muster deploy` which drones run on which host, \
                        and how their frames reach each other. It is a TOML file. Without `group` and `broadcast`, a frame for all is \
                        sent to each drone's address.";
    schema::page("Hosts file", introduction, &schema().fields)
}

/// The hosts of a swarm. Each drone runs on exactly one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Hosts {
    pub(crate) reach: Reach,
    pub(crate) hosts: Vec<Host>,
}

/// How a broadcast frame reaches the other drones.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Reach {
    /// To a multicast group.
    Group(SocketAddrV4),
    /// To the broadcast address of the network.
    Broadcast(SocketAddrV4),
    /// To the address of each other drone.
    Peers,
}

/// A machine or a network namespace that runs drones' processes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Host {
    /// The command that runs other commands there, for example ssh; empty for this machine.
    pub(crate) run: Vec<String>,
    /// The daemon's program there.
    pub(crate) musterd: PathBuf,
    /// Its drones, each with its address; `None` if any free port will do.
    pub(crate) drones: BTreeMap<NodeId, Option<SocketAddr>>,
    pub(crate) interface: Option<String>,
}

impl Host {
    /// Whether it is this machine, outside of any namespace.
    pub(crate) fn is_local(&self) -> bool {
        self.run.is_empty()
    }

    /// Its name in messages: the command that runs others there.
    pub(crate) fn name(&self) -> String {
        match &self.run[..] {
            [] => "this machine".to_owned(),
            run => run.join(" "),
        }
    }
}

impl Hosts {
    /// Reads a hosts file for a scenario with drones and relays 0 to `nodes` - 1.
    ///
    /// # Errors
    /// If the file can't be used; the error shows the line and what is accepted.
    pub fn load(path: &Path, nodes: u32) -> Result<Self, BadInput> {
        File(TomlFile::read(path, FORMAT)?).hosts(nodes)
    }
}

/// The commands that run others on the hosts of a file, whatever drones they have.
///
/// # Errors
/// If the file can't be used, or has no host.
pub fn commands(path: &Path) -> Result<Vec<Vec<String>>, BadInput> {
    let file = File(TomlFile::read(path, FORMAT)?);
    let hosts = file.0.raw.hosts.iter();
    let commands: Vec<_> = hosts
        .map(|raw| file.run(raw.get_ref()))
        .collect::<Result<_, _>>()?;
    if commands.is_empty() {
        return Err(file.0.error(0..0, "the file has no `[[hosts]]`"));
    }
    Ok(commands)
}

/// A parsed hosts file that is not validated yet.
struct File(TomlFile<Raw>);

impl File {
    fn hosts(&self, nodes: u32) -> Result<Hosts, BadInput> {
        let reach = self.reach()?;
        let mut placed: BTreeMap<NodeId, Option<SocketAddr>> = BTreeMap::new();
        let mut hosts = Vec::new();
        for raw in &self.0.raw.hosts {
            let drones = self.drones(raw.get_ref(), (reach, nodes), &placed)?;
            placed.extend(&drones);
            hosts.push(Host {
                run: self.run(raw.get_ref())?,
                musterd: self.musterd(raw.get_ref())?,
                interface: raw.get_ref().interface.clone(),
                drones,
            });
        }
        if let Some(missing) = (0..nodes).find(|id| !placed.contains_key(&NodeId(*id))) {
            let message = format!("drone {missing} of the scenario is on no host");
            let last = self
                .0
                .raw
                .hosts
                .last()
                .map_or(0..0, |it| it.get_ref().drones.span());
            return Err(self.0.error(last, &message));
        }
        self.check_addresses(&placed)?;
        Ok(Hosts { reach, hosts })
    }

    fn reach(&self) -> Result<Reach, BadInput> {
        match (&self.0.raw.group, &self.0.raw.broadcast) {
            (Some(_), Some(broadcast)) => {
                let message = "`group` and `broadcast` exclude each other";
                Err(self.0.error(broadcast.span(), message))
            }
            (Some(address), None) | (None, Some(address)) if address.get_ref().port() == 0 => {
                let message = "needs a fixed port (1–65535), found 0";
                Err(self.0.error(address.span(), message))
            }
            (Some(group), None) if !group.get_ref().ip().is_multicast() => {
                let message = "not a multicast group (224.0.0.0 to 239.255.255.255)";
                Err(self.0.error(group.span(), message))
            }
            (Some(group), None) => Ok(Reach::Group(*group.get_ref())),
            (None, Some(broadcast)) => Ok(Reach::Broadcast(*broadcast.get_ref())),
            (None, None) => Ok(Reach::Peers),
        }
    }

    fn drones(
        &self,
        raw: &RawHost,
        (reach, nodes): (Reach, u32),
        placed: &BTreeMap<NodeId, Option<SocketAddr>>,
    ) -> Result<BTreeMap<NodeId, Option<SocketAddr>>, BadInput> {
        let listed = raw.drones.get_ref();
        if listed.is_empty() {
            return Err(self.0.error(raw.drones.span(), "the host has no drone"));
        }
        let first = match (&raw.address, reach) {
            (None, Reach::Peers) => {
                let message = "the host needs an `address`, since the file has neither `group` nor `broadcast`";
                return Err(self.0.error(raw.drones.span(), message));
            }
            (Some(address), Reach::Group(_) | Reach::Broadcast(_)) => {
                let message = "`address` can't be combined with `group` or `broadcast`";
                return Err(self.0.error(address.span(), message));
            }
            (address, _) => address.as_ref(),
        };
        let mut drones = BTreeMap::new();
        for (nth, id) in (0_u16..).zip(listed) {
            let (span, id) = (id.span(), NodeId(*id.get_ref()));
            if id.0 >= nodes {
                let last = nodes - 1;
                let message = format!("the scenario has drones and relays 0 to {last}, found {id}");
                return Err(self.0.error(span, &message));
            }
            let address = match first {
                None => None,
                Some(first) => Some(port_after(*first.get_ref(), nth).ok_or_else(|| {
                    let message = "each drone of the host needs a port, counted from this one; the address can't be \
                                   unspecified";
                    self.0.error(first.span(), message)
                })?),
            };
            if placed.contains_key(&id) || drones.insert(id, address).is_some() {
                return Err(self.0.error(span, &format!("drone {id} is listed twice")));
            }
        }
        Ok(drones)
    }

    fn run(&self, raw: &RawHost) -> Result<Vec<String>, BadInput> {
        match &raw.run {
            None => Ok(Vec::new()),
            Some(run) if run.get_ref().iter().any(String::is_empty) || run.get_ref().is_empty() => {
                Err(self.0.error(run.span(), "the command is empty"))
            }
            Some(run) => Ok(run.get_ref().clone()),
        }
    }

    /// The command may pass the path to a shell, as ssh does, so characters with a meaning to a shell are refused.
    fn musterd(&self, raw: &RawHost) -> Result<PathBuf, BadInput> {
        let Some(musterd) = &raw.musterd else {
            return Ok(PathBuf::from("musterd"));
        };
        let is_plain = |c: char| c.is_ascii_alphanumeric() || "/._-+".contains(c);
        let path = musterd.get_ref();
        if path.is_empty() || path.starts_with('-') || !path.chars().all(is_plain) {
            let message = "the path needs quoting in a shell";
            return Err(self.0.error(musterd.span(), message));
        }
        Ok(PathBuf::from(path))
    }

    fn check_addresses(
        &self,
        placed: &BTreeMap<NodeId, Option<SocketAddr>>,
    ) -> Result<(), BadInput> {
        let mut seen = BTreeMap::new();
        let first = placed.values().flatten().next();
        for raw in &self.0.raw.hosts {
            let Some(address) = &raw.get_ref().address else {
                continue;
            };
            if first.is_some_and(|first| first.is_ipv4() != address.get_ref().is_ipv4()) {
                let message = "IPv4 and IPv6 addresses can't be mixed";
                return Err(self.0.error(address.span(), message));
            }
            for id in raw.get_ref().drones.get_ref() {
                let own = placed.get(&NodeId(*id.get_ref())).copied().flatten();
                if let Some(other) = own.and_then(|own| seen.insert(own, *id.get_ref())) {
                    let message =
                        format!("drones {other} and {} have the same address", id.get_ref());
                    return Err(self.0.error(address.span(), &message));
                }
            }
        }
        Ok(())
    }
}

/// The address with its port raised by `nth`; `None` without a valid port or with an unspecified address.
fn port_after(mut address: SocketAddr, nth: u16) -> Option<SocketAddr> {
    let port = address.port().checked_add(nth)?;
    address.set_port(port);
    (address.port() > 0 && !address.ip().is_unspecified()).then_some(address)
}

const FORMAT: FileFormat = FileFormat {
    fields: FieldList::new(include_str!("fields.txt")),
    description: "a hosts file is a TOML file with a line `group = …` and tables `[[hosts]]`",
};
