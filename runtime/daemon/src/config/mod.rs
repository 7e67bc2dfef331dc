//! A drone's file. It names a scenario, the same file that is simulated. The scenario's simulated world (radio, faults,
//! seed, other swarms) is ignored here.

mod autopilot;
mod controller;
mod drone_file;
mod flight;
mod network;

use std::io;
use std::net::SocketAddr;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock};

use muster_machines::identity::{NodeId, SwarmId};
use muster_machines::msp::controller::{Receiver, Stage};
use muster_machines::node::LinkBuilder;
use muster_runtime::diagnostic::{BadInput, FileFormat, TomlFile, read_text};
use muster_runtime::identity::{DroneKey, Ed25519Authenticator, FleetKey, RevocationList, Roster};
use muster_runtime::journal::flights;
use muster_runtime::plan::Plan;
use muster_runtime::schema::{self, FieldList, FileSchema, Located};
use muster_runtime::vehicle::VehicleKind;
use muster_transport::sockets;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub(crate) use self::autopilot::AutopilotConfig;
pub(crate) use self::controller::{ControllerConfig, Permission};
pub use self::drone_file::{
    DroneFile, FlightNumber, Keys, LevelName, LogName, Network, Observe, ReceiverName, StageName,
    VehicleName,
};
pub(crate) use self::flight::Origin;
use crate::log::{Format, Level};

/// Path of the newest revocation list that a drone has received. It is beside the journal's folder, because it outlives
/// the journal.
fn kept_list(journal: &Path, id: u32) -> PathBuf {
    journal.with_file_name(format!("revoked-kept-{id}.toml"))
}

/// The schema of a drone's file.
#[must_use]
pub fn schema() -> &'static FileSchema {
    static SCHEMA: LazyLock<FileSchema> =
        LazyLock::new(|| FileSchema::of::<DroneFile>("A drone of muster"));
    &SCHEMA
}

/// The reference of a drone's file, as Markdown.
#[must_use]
pub fn reference() -> String {
    let introduction = "A drone's file tells `musterd` which drone it is and how it reaches the others. It is a TOML \
                        file; paths are relative to its folder.";
    schema::page("Drone file", introduction, &schema().fields)
}

/// How frames are sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TransportName {
    /// Datagrams to a group, a broadcast address or a list of peers.
    Udp,
    /// A connection with each other drone.
    Quic,
}

/// A drone's configuration: its file and all files that it names are valid and fit together.
#[derive(Debug)]
pub struct DroneConfig {
    /// The drone's file, which HUP reads again.
    pub(crate) path: PathBuf,
    /// The scenario's file, named in the drone's file.
    pub(crate) scenario_path: PathBuf,
    pub(crate) plan: Plan,
    /// Source of the plan.
    pub(crate) origin: Origin,
    pub(crate) id: NodeId,
    pub(crate) swarm: SwarmId,
    pub(crate) authenticator: Arc<Ed25519Authenticator>,
    /// The newest known revocation list.
    pub(crate) revoked: RevocationList,
    /// Key that signs the roster and revocation lists. Constant while the process runs.
    pub(crate) fleet: FleetKey,
    pub(crate) transport: TransportName,
    /// Sockets and the addresses of other drones.
    pub(crate) network: sockets::Config,
    /// Folder of the flight's journal.
    pub(crate) journal: PathBuf,
    /// Folder of all flights.
    pub(crate) journals: PathBuf,
    pub(crate) log: Format,
    pub(crate) level: Level,
    /// The flight controller. `None` with a simulated vehicle.
    pub(crate) controller: Option<ControllerConfig>,
    /// The autopilot. `None` with any other vehicle.
    pub(crate) autopilot: Option<AutopilotConfig>,
    /// Address of `/metrics`, `/health` and `/status`. `None` without `[observe]`.
    pub(crate) http: Option<SocketAddr>,
}

/// Returns the text of the file at a path.
pub(crate) type Read<'a> = &'a dyn Fn(&Path) -> Result<String, BadInput>;

/// Values that can be reloaded in flight.
#[derive(Debug)]
pub(crate) struct Reloaded {
    pub(crate) level: Level,
    pub(crate) revoked: RevocationList,
}

impl DroneConfig {
    /// Reads a drone's file and all files that it names.
    ///
    /// # Errors
    /// If a file is invalid, or the files do not fit together. The error names the file, shows the place and what is
    /// accepted.
    pub fn load(path: &Path) -> Result<Self, BadInput> {
        Self::load_from(path, &read_text)
    }

    /// Like [`Self::load`], but reads the named scenario's files with `read`. A drone that takes part in a flight uses the
    /// scenario stored at its start, if it is there.
    ///
    /// # Errors
    /// As [`Self::load`], and errors of `read`.
    pub(crate) fn load_from(path: &Path, read: Read<'_>) -> Result<Self, BadInput> {
        let file = File::read(path)?;
        let raw = &file.0.raw;
        let autopilot = autopilot::of(&file.0)?;
        let controller = file.controller()?;
        let scenario_path = file.0.resolve(raw.scenario.get_ref());
        let journals = file.0.resolve(&raw.journal);
        let journal = file.journal(&journals)?;
        let (plan, origin) = flight::scenario(&journal, &scenario_path, read)?;
        file.check_plan(&plan)?;
        let fleet = file.fleet()?;
        let revoked = file.revoked(&fleet)?;
        let id = NodeId(*raw.id.get_ref());
        Ok(Self {
            path: path.to_owned(),
            scenario_path,
            id,
            swarm: SwarmId(raw.swarm.to_u32()),
            authenticator: Arc::new(file.authenticator(id, &revoked)?),
            revoked,
            fleet,
            transport: *raw.transport.get_ref(),
            network: file.network(id)?,
            journal,
            journals,
            log: match raw.log {
                LogName::Human => Format::Human,
                LogName::Json => Format::Json,
            },
            level: raw.log_level.into(),
            http: file.http()?,
            controller,
            autopilot,
            plan,
            origin,
        })
    }

    /// Path of the newest revocation list received, for the next incarnation.
    pub(crate) fn kept_list(&self) -> PathBuf {
        kept_list(&self.journals, self.id.0)
    }

    /// Whether the drone took part in a flight, by its journal, when this configuration was read.
    pub(crate) const fn is_of_a_flight(&self) -> bool {
        !matches!(self.origin, Origin::Named(_))
    }

    /// Whether the scenario of the flight is known: no flight has begun, or its stored copy is intact.
    pub(crate) const fn knows_its_flight(&self) -> bool {
        !matches!(self.origin, Origin::Lost)
    }

    /// Stores the scenario in the journal's folder, unless a flight has begun.
    ///
    /// # Errors
    /// If it can't be written.
    pub(crate) fn store_flight(&self) -> io::Result<()> {
        match &self.origin {
            Origin::Named(files) => files.store(&self.journal),
            Origin::Stored | Origin::Lost => Ok(()),
        }
    }

    /// Whether the drone has the centre slot of its swarm, so that it leads when the operator orders it to fly.
    #[must_use]
    pub fn leads(&self) -> bool {
        self.id == self.plan.centre()
    }

    /// Builds the link to what the drone flies.
    pub(crate) fn link(&self) -> Arc<LinkBuilder> {
        if let Some(autopilot) = &self.autopilot {
            return self.plan.autopilot_link(autopilot.stage);
        }
        let (kind, stage, receiver) = match &self.controller {
            Some(controller) => (VehicleKind::Msp, controller.stage, controller.receiver),
            None => (VehicleKind::ClosedForm, Stage::Sim, Receiver::Sole),
        };
        self.plan.link(kind, stage, receiver)
    }

    /// Whether the drone flies no mission and only forwards frames.
    pub(crate) fn is_relay(&self) -> bool {
        self.id.0 >= self.plan.layout.formation().drones()
    }

    /// One line for people: number, role and flight.
    #[must_use]
    pub fn description(&self) -> String {
        let role = match () {
            () if self.leads() => ", leads",
            () if self.is_relay() => ", relay",
            () => "",
        };
        format!(
            "drone {}{role}: {}",
            self.id,
            self.plan.description(self.plan.limits.duration)
        )
    }
}

/// Reads the values that can be reloaded in flight. The fleet's key is that of the start.
///
/// # Errors
/// If the drone's file or its revocation list is invalid.
pub(crate) fn reload(path: &Path, fleet: &FleetKey) -> Result<Reloaded, BadInput> {
    let file = File::read(path)?;
    Ok(Reloaded {
        level: file.0.raw.log_level.into(),
        revoked: RevocationList::load(&file.0.resolve(&file.0.raw.keys.revoked), fleet)?,
    })
}

/// The drone's number and the address of its status, from its file. Other fields are parsed but not validated.
///
/// # Errors
/// If the file can't be parsed or has no table `[observe]`.
pub fn observed(path: &Path) -> Result<(NodeId, SocketAddr), BadInput> {
    let file = File::read(path)?;
    let id = NodeId(*file.0.raw.id.get_ref());
    file.http()?.map(|address| (id, address)).ok_or_else(|| {
        let message = "no table `[observe]`: this drone does not serve its status";
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

/// A parsed drone's file that is not validated yet.
struct File(TomlFile<DroneFile>);

impl File {
    fn read(path: &Path) -> Result<Self, BadInput> {
        TomlFile::read(path, FORMAT).map(Self)
    }

    fn check_plan(&self, plan: &Plan) -> Result<(), BadInput> {
        let nodes = plan.nodes();
        if *self.0.raw.id.get_ref() >= nodes {
            let message = format!(
                "no such drone in the scenario: its drones and relays have numbers up to {}",
                nodes - 1
            );
            return Err(self.0.error(self.0.raw.id.span(), &message));
        }
        let raw = &self.0.raw;
        self.check_sensor(
            raw.pose.as_ref().map(Located::span),
            plan.pose.is_some(),
            "the scenario has no table `[vehicle.pose]`, so GPS gives the position",
            "the scenario has a table `[vehicle.pose]`, so this needs `pose`, an address for poses",
        )?;
        self.check_sensor(
            raw.flow.as_ref().map(Located::span),
            plan.flow.is_some(),
            "the scenario has no table `[vehicle.flow]`, so the drone has no optical flow module",
            "the scenario has a table `[vehicle.flow]`, so this needs `flow`, the port of an optical flow module",
        )?;
        if plan.is_steered() {
            let message =
                "the scenario needs a simulated pilot or operator, which `musterd` does not have";
            return Err(self.0.error(self.0.raw.scenario.span(), message));
        }
        Ok(())
    }

    /// Checks that a sensor beside a flight controller is named where the plan has one, and only there.
    fn check_sensor(
        &self,
        named: Option<Range<usize>>,
        is_planned: bool,
        superfluous: &str,
        missing: &str,
    ) -> Result<(), BadInput> {
        let vehicle = &self.0.raw.vehicle;
        match named {
            Some(span) if !is_planned => Err(self.0.error(span, superfluous)),
            None if is_planned && *vehicle.get_ref() == VehicleName::Msp => {
                Err(self.0.error(vehicle.span(), missing))
            }
            _ => Ok(()),
        }
    }

    fn http(&self) -> Result<Option<SocketAddr>, BadInput> {
        let Some(observe) = &self.0.raw.observe else {
            return Ok(None);
        };
        if observe.http.get_ref().port() == 0 {
            let message = "`observe.http` needs a fixed port (1–65535), found 0";
            return Err(self.0.error(observe.http.span(), message));
        }
        Ok(Some(*observe.http.get_ref()))
    }

    /// Journal folder of the flight that the drone joins.
    fn journal(&self, root: &Path) -> Result<PathBuf, BadInput> {
        let flight = &self.0.raw.flight;
        match flights::choose(root, flight.to_u32()) {
            Ok(chosen) => Ok(flights::folder_of(root, chosen)),
            Err(error) => {
                let message = format!(
                    "{error}: set `flight` to {} or, for a new flight, to a higher number",
                    error.newest
                );
                Err(self.0.error(flight.span().unwrap_or(0..0), &message))
            }
        }
    }

    fn fleet(&self) -> Result<FleetKey, BadInput> {
        FleetKey::load(&self.0.resolve(&self.0.raw.keys.fleet))
    }

    fn authenticator(
        &self,
        id: NodeId,
        revoked: &RevocationList,
    ) -> Result<Ed25519Authenticator, BadInput> {
        let keys = &self.0.raw.keys;
        let fleet = self.fleet()?;
        let roster = Roster::load(&self.0.resolve(&keys.roster), &fleet)?;
        let key = DroneKey::load(&self.0.resolve(keys.drone.get_ref()))?;
        Ed25519Authenticator::new(id, key, fleet, roster, revoked)
            .map_err(|error| self.0.error(keys.drone.span(), &error.to_string()))
    }

    /// The newer of the named revocation list and the kept one.
    fn revoked(&self, fleet: &FleetKey) -> Result<RevocationList, BadInput> {
        let named = RevocationList::load(&self.0.resolve(&self.0.raw.keys.revoked), fleet)?;
        let path = kept_list(
            &self.0.resolve(&self.0.raw.journal),
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
}

const FORMAT: FileFormat = FileFormat {
    fields: FieldList::new(include_str!("fields.txt")),
    description: "a drone's file is a TOML file: lines `key = value`, then tables like `[keys]`",
};
