//! What a hosts file says: which drones' processes run where, and how they talk to each other.

mod fields;

use std::collections::BTreeMap;
use std::net::{SocketAddr, SocketAddrV4};
use std::path::{Path, PathBuf};

use muster_machines::identity::NodeId;
use muster_runtime::diagnostic::{BadInput, Form, TomlFile};
use muster_runtime::schema;
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::Value;
use toml::Spanned;

use self::fields::FIELDS;

/// Every field of a hosts file, tables included, as in `hosts.run`.
pub fn fields() -> impl Iterator<Item = &'static str> {
    FIELDS.iter().map(|(field, _)| *field)
}

/// What a hosts file may say, as a JSON Schema.
#[must_use]
pub fn schema() -> Value {
    schema::of::<Raw>("The hosts of a swarm of muster's", FIELDS)
}

/// Where the drones of a swarm run: each of them at one host.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Hosts {
    pub(super) reach: Reach,
    pub(super) hosts: Vec<Host>,
}

/// How frames for all get to all.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Reach {
    /// To a multicast group.
    Group(SocketAddrV4),
    /// To a network's broadcast address.
    Broadcast(SocketAddrV4),
    /// To each of the others' addresses.
    Peers,
}

/// A machine, or a namespace of one, on which drones' processes run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Host {
    /// The command that runs another there; none for this machine.
    pub(super) run: Vec<String>,
    /// The daemon's program there.
    pub(super) musterd: PathBuf,
    /// Who flies there, with its address where it has to have a certain one.
    pub(super) drones: BTreeMap<NodeId, Option<SocketAddr>>,
    pub(super) interface: Option<String>,
}

impl Host {
    /// Whether it is this machine, and no namespace of it.
    pub(super) fn is_here(&self) -> bool {
        self.run.is_empty()
    }

    /// What it is called.
    pub(super) fn name(&self) -> String {
        match &self.run[..] {
            [] => "this machine".to_owned(),
            run => run.join(" "),
        }
    }
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Raw {
    #[schemars(with = "Option<String>")]
    group: Option<Spanned<SocketAddrV4>>,
    #[schemars(with = "Option<String>")]
    broadcast: Option<Spanned<SocketAddrV4>>,
    #[serde(default)]
    #[schemars(with = "Vec<RawHost>")]
    hosts: Vec<Spanned<RawHost>>,
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[[hosts]]`")]
struct RawHost {
    #[schemars(with = "Vec<u32>")]
    drones: Spanned<Vec<Spanned<u32>>>,
    #[schemars(with = "Option<Vec<String>>")]
    run: Option<Spanned<Vec<String>>>,
    #[schemars(with = "Option<String>")]
    musterd: Option<Spanned<String>>,
    interface: Option<String>,
    #[schemars(with = "Option<String>")]
    address: Option<Spanned<SocketAddr>>,
}

impl Hosts {
    /// Reads where the drones and relays of a scenario, numbered up to `nodes`, run.
    ///
    /// # Errors
    /// When the file can't be used: the error shows the place and says what would be accepted.
    pub fn load(path: &Path, nodes: u32) -> Result<Self, BadInput> {
        File(TomlFile::read(path, FORM)?).hosts(nodes)
    }
}

/// A hosts file that has been read, but not looked into.
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
            let message = format!("no host has drone {missing} of the scenario");
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
                let message =
                    "frames for all go to a `group` or to a `broadcast` address: one of them";
                Err(self.0.error(broadcast.span(), message))
            }
            (Some(all), None) | (None, Some(all)) if all.get_ref().port() == 0 => Err(self
                .0
                .error(all.span(), "what is for all needs a port that all know")),
            (Some(group), None) if !group.get_ref().ip().is_multicast() => {
                let message =
                    "this is not a multicast group: they go from 224.0.0.0 to 239.255.255.255";
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
            return Err(self.0.error(raw.drones.span(), "no drone flies here"));
        }
        let first = match (&raw.address, reach) {
            (None, Reach::Peers) => {
                let message = "frames for all go to a `group`, to a `broadcast` address, or to the `address` that each host \
                               has: this one has none";
                return Err(self.0.error(raw.drones.span(), message));
            }
            (Some(address), Reach::Group(_) | Reach::Broadcast(_)) => {
                let message =
                    "drones that talk by a `group` or a `broadcast` take a port of their own";
                return Err(self.0.error(address.span(), message));
            }
            (address, _) => address.as_ref(),
        };
        let mut drones = BTreeMap::new();
        for (nth, id) in (0_u16..).zip(listed) {
            let (span, id) = (id.span(), NodeId(*id.get_ref()));
            if id.0 >= nodes {
                let last = nodes - 1;
                let message = format!("the scenario's drones and relays have numbers up to {last}");
                return Err(self.0.error(span, &message));
            }
            let address = match first {
                None => None,
                Some(first) => Some(port_after(*first.get_ref(), nth).ok_or_else(|| {
                    self.0.error(
                        first.span(),
                        "each drone here needs an address and a port of its own, from this one on",
                    )
                })?),
            };
            if placed.contains_key(&id) || drones.insert(id, address).is_some() {
                return Err(self
                    .0
                    .error(span, &format!("drone {id} is at a host already")));
            }
        }
        Ok(drones)
    }

    fn run(&self, raw: &RawHost) -> Result<Vec<String>, BadInput> {
        match &raw.run {
            None => Ok(Vec::new()),
            Some(run) if run.get_ref().iter().any(String::is_empty) || run.get_ref().is_empty() => {
                Err(self.0.error(run.span(), "this names no command"))
            }
            Some(run) => Ok(run.get_ref().clone()),
        }
    }

    /// What runs it there may hand it to a shell, as ssh does: nothing that means something to one is let through.
    fn musterd(&self, raw: &RawHost) -> Result<PathBuf, BadInput> {
        let Some(musterd) = &raw.musterd else {
            return Ok(PathBuf::from("musterd"));
        };
        let is_plain = |c: char| c.is_ascii_alphanumeric() || "/._-+".contains(c);
        let path = musterd.get_ref();
        if path.is_empty() || path.starts_with('-') || !path.chars().all(is_plain) {
            let message = "a shell there would not take this for the path of a program";
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
                let message =
                    "a drone with an IPv4 address reaches no IPv6 address, nor the other way round";
                return Err(self.0.error(address.span(), message));
            }
            for id in raw.get_ref().drones.get_ref() {
                let own = placed.get(&NodeId(*id.get_ref())).copied().flatten();
                if let Some(other) = own.and_then(|own| seen.insert(own, *id.get_ref())) {
                    let message = format!("drone {other} has one of the addresses from here on");
                    return Err(self.0.error(address.span(), &message));
                }
            }
        }
        Ok(())
    }
}

/// The same address, so many ports on; a port 0 is nobody's.
fn port_after(mut address: SocketAddr, nth: u16) -> Option<SocketAddr> {
    let port = address.port().checked_add(nth)?;
    address.set_port(port);
    (address.port() > 0 && !address.ip().is_unspecified()).then_some(address)
}

const FORM: Form = Form {
    fields: FIELDS,
    is: "a hosts file is a TOML file: a line `group = …`, then tables `[[hosts]]`",
};
