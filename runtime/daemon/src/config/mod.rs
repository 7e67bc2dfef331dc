//! What a drone's file says. The scenario that it names is the very file that was simulated, so that what was simulated
//! is what flies; what a scenario says of its world (the radio, faults, the seed, other swarms) means nothing here.

mod fields;
mod flight;
mod raw;

use std::io;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use muster_machines::identity::{NodeId, SwarmId};
use muster_machines::wire;
use muster_runtime::diagnostic::{BadInput, Form, TomlFile, read_text};
use muster_runtime::identity::{DroneKey, Ed25519Authenticator, FleetKey, RevocationList, Roster};
use muster_runtime::plan::Plan;
use muster_runtime::schema;
use muster_transport::sockets::{self, Reach};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use toml::Spanned;

use self::fields::FIELDS;
pub(crate) use self::flight::Origin;
use self::raw::{LevelName, LogName, Network, Raw, StageName, VehicleName};
use crate::log::{Format, Level};

/// What the newest list of the expelled is kept in that a drone has taken: beside its journal, for it outlives that.
fn kept_list(journal: &Path, id: u32) -> PathBuf {
    journal.with_file_name(format!("revoked-kept-{id}.toml"))
}

/// The most peers of a drone.
const PEERS_MAX: usize = 1_000;

/// What is not there yet, by name.
const NO_CONTROLLER: &str =
    "there is no link to a flight controller yet, so nothing but a simulated vehicle flies";

/// Every field of a drone's file, tables included, as in `udp.group`.
pub fn fields() -> impl Iterator<Item = &'static str> {
    FIELDS.iter().map(|(field, _)| *field)
}

/// What a drone's file may say, as a JSON Schema.
#[must_use]
pub fn schema() -> Value {
    schema::of::<Raw>("A drone of muster's", FIELDS)
}

/// How drones' frames move.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TransportName {
    /// As datagrams to all of a network or to a list of addresses.
    Udp,
    /// Over a connection with each other drone.
    Quic,
}

/// A drone that can be flown: its file, and all that it names, fit together.
#[derive(Debug)]
pub struct DroneConfig {
    /// The file, to be read again when that is asked for.
    pub(crate) path: PathBuf,
    /// The scenario's file that it names.
    pub(crate) scenario_path: PathBuf,
    pub(crate) plan: Plan,
    /// Where that comes from.
    pub(crate) origin: Origin,
    pub(crate) id: NodeId,
    pub(crate) swarm: SwarmId,
    pub(crate) authenticator: Arc<Ed25519Authenticator>,
    /// Whose word counts, from the start to the end of the process.
    pub(crate) fleet: FleetKey,
    pub(crate) transport: TransportName,
    /// Its sockets, and how others are reached.
    pub(crate) network: sockets::Config,
    pub(crate) journal: PathBuf,
    pub(crate) log: Format,
    pub(crate) level: Level,
    /// Where it is asked what it is doing, if anywhere.
    pub(crate) observed_at: Option<SocketAddr>,
}

/// What the file at a path says.
pub(crate) type Read<'a> = &'a dyn Fn(&Path) -> Result<String, BadInput>;

/// What is read again while a drone flies.
#[derive(Debug)]
pub(crate) struct Reread {
    pub(crate) level: Level,
    pub(crate) revoked: RevocationList,
}

impl DroneConfig {
    /// Reads a drone's file and all that it names.
    ///
    /// # Errors
    /// When a file can't be used or they do not fit together: the error names the file, shows the place and says what
    /// would be accepted.
    pub fn load(path: &Path) -> Result<Self, BadInput> {
        Self::load_from(path, &read_text)
    }

    /// Likewise, with the text of the files that make up the named scenario from `read`. Of a drone that takes part in a
    /// flight it is the scenario with which that began that counts, if that can be had.
    ///
    /// # Errors
    /// As [`Self::load`], and what `read` refuses.
    pub(crate) fn load_from(path: &Path, read: Read<'_>) -> Result<Self, BadInput> {
        let file = File::read(path)?;
        let raw = &file.0.raw;
        file.check_vehicle()?;
        let scenario_path = file.0.beside(raw.scenario.get_ref());
        let journal = file.0.beside(&raw.journal);
        let (plan, origin) = flight::scenario(&journal, &scenario_path, read)?;
        file.check_plan(&plan)?;
        let id = NodeId(*raw.id.get_ref());
        Ok(Self {
            path: path.to_owned(),
            scenario_path,
            id,
            swarm: file.swarm()?,
            authenticator: Arc::new(file.authenticator(id)?),
            fleet: file.fleet()?,
            transport: *raw.transport.get_ref(),
            network: file.network(id)?,
            journal,
            log: match raw.log {
                LogName::Human => Format::Human,
                LogName::Json => Format::Json,
            },
            level: raw.log_level.into(),
            observed_at: file.observed_at()?,
            plan,
            origin,
        })
    }

    /// Where it keeps the newest list of the expelled that it has taken, for its next life.
    pub(crate) fn kept_list(&self) -> PathBuf {
        kept_list(&self.journal, self.id.0)
    }

    /// Whether it takes part in a flight by its journal, as that was when this was read.
    pub(crate) const fn is_of_a_flight(&self) -> bool {
        !matches!(self.origin, Origin::Named(_))
    }

    /// Whether it has the scenario with which its flight began, or none has begun.
    pub(crate) const fn knows_its_flight(&self) -> bool {
        !matches!(self.origin, Origin::Lost)
    }

    /// Keeps the scenario in the journal's folder for the flight that may begin; of one that has begun it is there.
    ///
    /// # Errors
    /// When the system can't write it.
    pub(crate) fn keep_flight(&self) -> io::Result<()> {
        match &self.origin {
            Origin::Named(files) => files.keep(&self.journal),
            Origin::Kept | Origin::Lost => Ok(()),
        }
    }

    /// Whether it is the drone at the centre of its swarm, which leads when the operator tells it to fly.
    #[must_use]
    pub fn leads(&self) -> bool {
        self.id == self.plan.centre()
    }

    /// Whether it flies no mission and only passes on.
    pub(crate) fn is_relay(&self) -> bool {
        self.id.0 >= self.plan.layout.formation().drones()
    }

    /// What it is, in a few words.
    #[must_use]
    pub fn description(&self) -> String {
        let part = match () {
            () if self.leads() => ", which leads",
            () if self.is_relay() => ", a relay",
            () => "",
        };
        format!(
            "number {}{part}: {}",
            self.id,
            self.plan.description(self.plan.limits.duration)
        )
    }
}

/// Reads what may change while a drone flies, of the fleet that it belongs to since its start.
///
/// # Errors
/// As [`DroneConfig::load`], of what is read.
pub(crate) fn reread(path: &Path, fleet: &FleetKey) -> Result<Reread, BadInput> {
    let file = File::read(path)?;
    Ok(Reread {
        level: file.0.raw.log_level.into(),
        revoked: RevocationList::load(&file.0.beside(&file.0.raw.keys.revoked), fleet)?,
    })
}

/// Which drone a file is of, and where it is asked what it is doing; nothing else of the file is looked into.
///
/// # Errors
/// As [`DroneConfig::load`], and when the drone tells nobody.
pub fn observed(path: &Path) -> Result<(NodeId, SocketAddr), BadInput> {
    let file = File::read(path)?;
    let id = NodeId(*file.0.raw.id.get_ref());
    file.observed_at()?
        .map(|address| (id, address))
        .ok_or_else(|| {
            let message = "this drone tells nobody what it does: its file has no table `[observe]`";
            file.0.error(file.0.raw.id.span(), message)
        })
}

impl From<LevelName> for Level {
    fn from(name: LevelName) -> Self {
        match name {
            LevelName::Error => Self::ERROR,
            LevelName::Warn => Self::WARN,
            LevelName::Info => Self::INFO,
            LevelName::Debug => Self::DEBUG,
            LevelName::Trace => Self::TRACE,
        }
    }
}

/// A drone's file that has been read, but not looked into.
struct File(TomlFile<Raw>);

impl File {
    fn read(path: &Path) -> Result<Self, BadInput> {
        TomlFile::read(path, FORM).map(Self)
    }

    /// A drone does nothing above its stage, and there is no vehicle yet that needs a stage above the lowest.
    fn check_vehicle(&self) -> Result<(), BadInput> {
        let (stage, vehicle) = (&self.0.raw.stage, &self.0.raw.vehicle);
        match (stage.get_ref(), vehicle.get_ref()) {
            (_, VehicleName::Msp) => Err(self.0.error(vehicle.span(), NO_CONTROLLER)),
            (StageName::Sim, VehicleName::ClosedForm) => Ok(()),
            (StageName::Bench | StageName::Tethered | StageName::Flight, _) => {
                let message = "a simulated vehicle flies in the stage \"sim\", and in no other";
                Err(self.0.error(stage.span(), message))
            }
        }
    }

    fn check_plan(&self, plan: &Plan) -> Result<(), BadInput> {
        let nodes = plan.nodes();
        if *self.0.raw.id.get_ref() >= nodes {
            let message = format!(
                "the scenario's drones and relays have numbers up to {}",
                nodes - 1
            );
            return Err(self.0.error(self.0.raw.id.span(), &message));
        }
        if plan.is_steered() {
            let message = "in this scenario a simulated pilot or operator ends or steers the flight, who is not here";
            return Err(self.0.error(self.0.raw.scenario.span(), message));
        }
        Ok(())
    }

    fn observed_at(&self) -> Result<Option<SocketAddr>, BadInput> {
        let Some(observe) = &self.0.raw.observe else {
            return Ok(None);
        };
        if observe.http.get_ref().port() == 0 {
            let message = "port 0 is any, and whoever asks must know which";
            return Err(self.0.error(observe.http.span(), message));
        }
        Ok(Some(*observe.http.get_ref()))
    }

    fn swarm(&self) -> Result<SwarmId, BadInput> {
        match &self.0.raw.swarm {
            None => Ok(Plan::FIRST_SWARM),
            Some(number) if *number.get_ref() == 0 => {
                Err(self.0.error(number.span(), "swarms are numbered from 1"))
            }
            Some(number) => Ok(SwarmId(*number.get_ref())),
        }
    }

    fn fleet(&self) -> Result<FleetKey, BadInput> {
        FleetKey::load(&self.0.beside(&self.0.raw.keys.fleet))
    }

    fn authenticator(&self, id: NodeId) -> Result<Ed25519Authenticator, BadInput> {
        let keys = &self.0.raw.keys;
        let fleet = self.fleet()?;
        let roster = Roster::load(&self.0.beside(&keys.roster), &fleet)?;
        let revoked = self.revoked(&fleet)?;
        let key = DroneKey::load(&self.0.beside(keys.drone.get_ref()))?;
        Ed25519Authenticator::new(id, key, fleet, roster, revoked)
            .map_err(|error| self.0.error(keys.drone.span(), &error.to_string()))
    }

    /// The newer one of the list that the file names and the one that was kept.
    fn revoked(&self, fleet: &FleetKey) -> Result<RevocationList, BadInput> {
        let named = RevocationList::load(&self.0.beside(&self.0.raw.keys.revoked), fleet)?;
        let path = kept_list(
            &self.0.beside(&self.0.raw.journal),
            *self.0.raw.id.get_ref(),
        );
        if let Ok(false) = path.try_exists() {
            return Ok(named);
        }
        let kept = RevocationList::load(&path, fleet)?;
        Ok(if kept.number() > named.number() {
            kept
        } else {
            named
        })
    }

    /// What the table of the chosen transport says; that of another waits for another choice.
    fn network(&self, id: NodeId) -> Result<sockets::Config, BadInput> {
        let transport = &self.0.raw.transport;
        let (table, name) = match transport.get_ref() {
            TransportName::Udp => (&self.0.raw.udp, "udp"),
            TransportName::Quic => (&self.0.raw.quic, "quic"),
        };
        let Some(network) = table else {
            let message = format!(
                "this transport needs a table `[{name}]`, which says how others are reached"
            );
            return Err(self.0.error(transport.span(), &message));
        };
        let reach = self.reach(network)?;
        let network = network.get_ref();
        let bind = network.bind.as_ref().map(|it| *it.get_ref());
        let bind = bind.unwrap_or(SocketAddr::from((Ipv4Addr::UNSPECIFIED, 0)));
        if let Reach::Group(all) | Reach::Broadcast(all) = reach
            && let Some(own) = &network.bind
        {
            if own.get_ref().port() == all.port() {
                let message = "a drone's own port must be another than that of what is for all";
                return Err(self.0.error(own.span(), message));
            }
            if !own.get_ref().is_ipv4() {
                let message =
                    "groups and broadcasts are IPv4's, so the drone's own address must be";
                return Err(self.0.error(own.span(), message));
            }
        }
        Ok(sockets::Config {
            id,
            bind,
            reach,
            interface: network.interface.clone(),
            datagram_max: wire::DATAGRAM_MAX,
        })
    }

    fn reach(&self, network: &Spanned<Network>) -> Result<Reach, BadInput> {
        let Network {
            bind,
            group,
            broadcast,
            peers,
            ..
        } = network.get_ref();
        let is_of_other_family = |peer: &SocketAddr| {
            bind.as_ref()
                .is_some_and(|bind| bind.get_ref().is_ipv4() != peer.is_ipv4())
        };
        match (group, broadcast, peers) {
            (Some(all), None, None) | (None, Some(all), None) if all.get_ref().port() == 0 => {
                Err(self
                    .0
                    .error(all.span(), "what is for all needs a port that all know"))
            }
            (Some(group), None, None) if group.get_ref().ip().is_multicast() => {
                Ok(Reach::Group(*group.get_ref()))
            }
            (Some(group), None, None) => {
                let message =
                    "this is not a multicast group: they go from 224.0.0.0 to 239.255.255.255";
                Err(self.0.error(group.span(), message))
            }
            (None, Some(broadcast), None) => Ok(Reach::Broadcast(*broadcast.get_ref())),
            (None, None, Some(peers)) if peers.get_ref().len() > PEERS_MAX => Err(self
                .0
                .error(peers.span(), &format!("more than {PEERS_MAX} peers"))),
            (None, None, Some(peers)) if bind.is_none() => {
                let message = "`peers` send to a drone's own address, so it needs `bind`";
                Err(self.0.error(peers.span(), message))
            }
            (None, None, Some(peers)) if peers.get_ref().iter().any(is_of_other_family) => {
                let message =
                    "a drone with an IPv4 address reaches no IPv6 address, nor the other way round";
                Err(self.0.error(peers.span(), message))
            }
            (None, None, Some(peers)) => Ok(Reach::Peers(peers.get_ref().clone())),
            _ => {
                let message = "others are reached by a `group`, by a `broadcast` address or as `peers`: one of them";
                Err(self.0.error(network.span(), message))
            }
        }
    }
}

const FORM: Form = Form {
    fields: FIELDS,
    is: "a drone's file is a TOML file: lines `key = value`, then tables like `[keys]`",
};
