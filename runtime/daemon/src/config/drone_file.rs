//! The fields of a drone's file. As for scenario files, this is their only declaration: for who reads it and for who writes it.

use std::net::{SocketAddr, SocketAddrV4};
use std::ops::Range;
use std::path::PathBuf;

use muster_machines::msp::controller::Receiver;
use muster_runtime::plan::raw::Whole;
use muster_runtime::schema::{Located, Or};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::TransportName;

/// Number of a flight.
pub type FlightNumber = Whole<1, 4_294_967_295>;

/// A drone's file. Its values are in their ranges, but need not fit together.
#[derive(Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DroneFile {
    /// Scenario of the flight: formation, mission and protocol.
    #[schemars(extend("x-accepted" = "the path of a scenario file, relative to this file"))]
    pub scenario: Located<PathBuf>,
    /// Number of the drone or relay in the scenario.
    #[schemars(extend("x-accepted" = "the number of a drone or relay of the scenario, from 0"))]
    pub id: Located<u32>,
    /// Number of its swarm; frames of other swarms are dropped.
    #[serde(default)]
    pub swarm: Or<Whole<1, 4_294_967_295>, 1>,
    /// What the drone may do. It does nothing above its stage.
    pub stage: Located<StageName>,
    /// What it flies.
    pub vehicle: Located<VehicleName>,
    /// Where the flight controller or the autopilot is; with `vehicle = "msp"` and `"mavlink"` only, which need it.
    #[schemars(extend(
        "x-accepted" = "a serial device as \"serial:/dev/ttyACM0\" or \"serial:/dev/ttyAMA0@115200\", or \"tcp:HOST:PORT\"; with `vehicle = \"mavlink\"` \"udpin:ADDRESS:PORT\"",
        "x-condition" = "in the stage `sim` an address of this host and no serial device"
    ))]
    pub port: Option<Located<String>>,
    /// Who else commands the flight controller; with `vehicle = "msp"` only, which needs it.
    pub receiver: Option<Located<ReceiverName>>,
    /// Where the drone listens for poses: UDP datagrams with a JSON object each, from a program on this machine that measures
    /// where the vehicle is; required if the scenario has a table `[vehicle.pose]`, else refused.
    #[schemars(extend(
        "x-accepted" = "a loopback address and a fixed port, for example \"127.0.0.1:9010\""
    ))]
    pub pose: Option<Located<SocketAddr>>,
    /// Where the optical flow module is, which speaks MSP by itself (as `MSP2_SENSOR_OPTICALFLOW_MT`), mounted with its x axis
    /// forward and its y axis to the right; required if the scenario has a table `[vehicle.flow]`, else refused.
    #[schemars(extend(
        "x-accepted" = "a serial device as \"serial:/dev/ttyUSB0@115200\", or \"tcp:HOST:PORT\" with an address of this host"
    ))]
    pub flow: Option<Located<String>>,
    /// How frames are sent. Each transport has a table of its name; the other table is ignored.
    pub transport: Located<TransportName>,
    /// Folder with the journal and the files of the current flight; created if missing.
    #[schemars(extend(
        "x-accepted" = "the path of a folder for this drone only, relative to this file"
    ))]
    pub journal: PathBuf,
    /// Number of the flight. A higher number than before starts a new flight once the last one is over; its journal is a
    /// new subfolder, and the last flights before stay readable. A number below that of the last flight is refused.
    #[serde(default)]
    pub flight: Or<FlightNumber, 1>,
    /// Format of the log on standard error.
    #[serde(default)]
    pub log: LogName,
    /// Least severity that is logged.
    #[serde(default)]
    pub log_level: LevelName,
    /// The drone's identity, made by `muster keys`.
    pub keys: Keys,
    /// Sockets and addresses of the transport UDP. One of `group`, `broadcast` and `peers` is required.
    pub udp: Option<Located<Network>>,
    /// Sockets and addresses of the transport QUIC. One of `group`, `broadcast` and `peers` is required.
    pub quic: Option<Located<Network>>,
    /// Metrics, health and status over HTTP. Without this table there are none.
    pub observe: Option<Observe>,
}

impl DroneFile {
    /// The file's text.
    #[must_use]
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("numbers, names, addresses and paths have a form in TOML")
    }

    /// Where it names a sensor beside a flight controller. `None` if it names none.
    pub(super) fn sensor_span(&self) -> Option<Range<usize>> {
        let pose = self.pose.as_ref().map(Located::span);
        pose.or(self.flow.as_ref().map(Located::span))
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
/// The stage in a drone's file.
pub enum StageName {
    /// Arms a simulated vehicle, a flight controller that reports a simulated board, or an autopilot at a loopback address.
    Sim,
    /// Telemetry of a flight controller. Never arms, and no motor turns.
    Bench,
    /// Flies what the pilot arms, at most 2 m high and 3 m from where it took off, with tilt and throttle capped. Needs
    /// `receiver = "override"` and `keys.grant`.
    Tethered,
    /// Flies what the pilot arms. Needs `receiver = "override"` and `keys.grant`.
    Flight,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
/// What a drone flies, in its file.
pub enum VehicleName {
    /// A simulated vehicle in real time.
    ClosedForm,
    /// A flight controller over MSP.
    Msp,
    /// An autopilot over MAVLink.
    Mavlink,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
/// Who else commands a flight controller, in a drone's file.
pub enum ReceiverName {
    /// Nobody: MSP is the only receiver. For bench and simulation, since no pilot can take over.
    Sole,
    /// A pilot: the receiver arms and hands MSP the sticks by a switch (`MSP OVERRIDE`).
    Override,
}

impl From<Receiver> for ReceiverName {
    fn from(receiver: Receiver) -> Self {
        match receiver {
            Receiver::Sole => Self::Sole,
            Receiver::Override => Self::Override,
        }
    }
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
/// The format of the log in a drone's file.
pub enum LogName {
    /// Text.
    #[default]
    Human,
    /// One JSON object a line.
    Json,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
/// The least severity that is logged, in a drone's file.
pub enum LevelName {
    /// What the drone can't do as it should.
    Error,
    /// Also what was refused or lost.
    Warn,
    /// Also what the swarm does.
    #[default]
    Info,
    /// Also each refused frame.
    Debug,
    /// Also what the libraries log.
    Trace,
}

/// The drone's identity, made by `muster keys`.
#[derive(Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[keys]`")]
pub struct Keys {
    /// The drone's secret key; only its owner may be able to read the file.
    #[schemars(extend("x-accepted" = "the path of a key file, relative to this file"))]
    pub drone: Located<PathBuf>,
    /// The fleet's public key.
    #[schemars(extend("x-accepted" = "the path of a key file, relative to this file"))]
    pub fleet: PathBuf,
    /// The roster: each drone's public key, signed by the fleet's key.
    #[schemars(extend("x-accepted" = "the path of a roster, relative to this file"))]
    pub roster: PathBuf,
    /// The revocation list, signed by the fleet's key.
    #[schemars(extend("x-accepted" = "the path of a revocation list, relative to this file"))]
    pub revoked: PathBuf,
    /// The grant for the stage, signed by the fleet's key; lower stages ignore it. If it does not fit the flight controller
    /// that is found, or has ended, the stage falls to `bench`.
    #[schemars(extend(
        "x-accepted" = "the path of a grant, relative to this file",
        "x-condition" = "required in the stages `tethered` and `flight`"
    ))]
    pub grant: Option<Located<PathBuf>>,
}

/// Sockets and addresses of a transport. One of `group`, `broadcast` and `peers` is required.
#[derive(Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub struct Network {
    /// The drone's own address.
    #[schemars(extend(
        "x-accepted" = "an address and port, for example \"10.0.0.7:4700\"",
        "x-condition" = "required with `peers`",
        "x-default" = "any address and port"
    ))]
    pub bind: Option<Located<SocketAddr>>,
    /// Multicast group for broadcasts; with QUIC for discovery.
    #[schemars(extend(
        "x-accepted" = "an IPv4 address from 224.0.0.0 to 239.255.255.255 and a port, for example \"239.77.0.1:4700\""
    ))]
    pub group: Option<Located<SocketAddrV4>>,
    /// Broadcast address of the network; with QUIC for discovery.
    #[schemars(extend(
        "x-accepted" = "an IPv4 broadcast address and a port, for example \"10.0.0.255:4700\""
    ))]
    pub broadcast: Option<Located<SocketAddrV4>>,
    /// Addresses of the other drones, for networks without multicast and broadcast.
    #[schemars(extend(
        "x-accepted" = "a list of at most 1000 addresses and ports, for example `[\"10.0.0.8:4700\", \"10.0.0.9:4700\"]`"
    ))]
    pub peers: Option<Located<Vec<SocketAddr>>>,
    /// Network interface.
    #[schemars(extend(
        "x-accepted" = "the name of a network interface, for example \"wlan0\"",
        "x-default" = "by the system's routes"
    ))]
    pub interface: Option<String>,
}

/// Metrics, health and status over HTTP. Without this table there are none.
#[derive(Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[observe]`")]
pub struct Observe {
    /// Where the drone listens. There is no authentication: everyone who reaches this address can read.
    #[schemars(extend(
        "x-accepted" = "an address of this machine and a fixed port (1–65535), for example \"127.0.0.1:9100\""
    ))]
    pub http: Located<SocketAddr>,
}
