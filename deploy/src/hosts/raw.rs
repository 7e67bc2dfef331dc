//! The fields of a hosts file.

use std::net::{SocketAddr, SocketAddrV4};
use std::path::PathBuf;

use muster_daemon::config::{FlightNumber, ReceiverName, StageName, TransportName};
use muster_runtime::plan::raw::{FrameRate, Whole};
use muster_runtime::schema::{Located, Or};
use schemars::JsonSchema;
use serde::Deserialize;

/// The fields of a hosts file; their only declaration, as for scenario files.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Raw {
    /// Multicast group for broadcasts.
    #[schemars(extend(
        "x-accepted" = "an IPv4 address from 224.0.0.0 to 239.255.255.255 and a port, for example \"239.77.0.1:4700\""
    ))]
    pub(super) group: Option<Located<SocketAddrV4>>,
    /// Broadcast address of the network.
    #[schemars(extend(
        "x-accepted" = "an IPv4 broadcast address and a port, for example \"10.0.0.255:4700\"",
        "x-condition" = "not with `group`"
    ))]
    pub(super) broadcast: Option<Located<SocketAddrV4>>,
    /// Scenario that the fleet flies; for `muster deploy`, which needs it.
    #[schemars(extend(
        "x-accepted" = "the path of a scenario file, relative to this file, or the name of a shipped one"
    ))]
    pub(super) scenario: Option<Located<PathBuf>>,
    /// Folder of the fleet's keys; for `muster deploy`, which needs it.
    #[schemars(extend(
        "x-accepted" = "the path of a folder that `muster keys` made, relative to this file"
    ))]
    pub(super) keys: Option<Located<PathBuf>>,
    /// How frames are sent; for `muster deploy`. `muster swarm` has an option for it.
    #[schemars(extend("x-default" = "\"udp\""))]
    pub(super) transport: Option<TransportName>,
    /// Number of the flight; for `muster deploy`. Raise it for another flight, once the last one is over.
    #[serde(default)]
    pub(super) flight: Or<FlightNumber, 1>,
    #[serde(default)]
    pub(super) gate: Gate,
    #[serde(default)]
    pub(super) hosts: Vec<Located<RawHost>>,
    #[serde(default)]
    pub(super) waves: Vec<Located<RawWave>>,
}

/// When a release counts as good on a host; for `muster deploy`.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default, expecting = "a table, `[gate]`")]
pub(super) struct Gate {
    /// Time for all drones of a host to be healthy and to have heard the others, in seconds.
    pub(super) within_s: Or<Whole<1, 3_600>, 60>,
    /// Time that they must then stay so, in seconds.
    pub(super) hold_s: Or<Whole<0, 3_600>, 10>,
}

/// The waves of a rollout, in their order; for `muster deploy`. Without them the first host is the first wave, the others are
/// the second.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[[waves]]`")]
pub(super) struct RawWave {
    /// Its hosts. Each host is in exactly one wave.
    #[schemars(
        with = "Vec<String>",
        extend("x-accepted" = "a list of names of hosts, for example `[\"pi1\", \"pi2\"]`")
    )]
    pub(super) hosts: Located<Vec<Located<String>>>,
    /// How many of them are changed at once.
    #[schemars(extend("x-default" = "all"))]
    pub(super) at_once: Option<Located<Whole<1, 10_000>>>,
    /// Time that the wave must stay healthy before the next one, in seconds.
    #[serde(default)]
    pub(super) soak_s: SoakSeconds,
    /// The most frames that each of its drones may drop while the wave soaks, a second. Replays and overflows of a busy network
    /// are fewer than the default.
    #[serde(default)]
    pub(super) dropped_per_s_max: DroppedPerSecond,
}

/// Up to a day.
pub(super) type SoakSeconds = Or<Whole<0, 86_400>, 10>;

pub(super) type DroppedPerSecond = Or<FrameRate, 10>;

/// The hosts, each with its drones.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[[hosts]]`")]
pub(super) struct RawHost {
    /// Drones and relays on this host. Each of the scenario is on exactly one host.
    #[schemars(
        with = "Vec<u32>",
        extend("x-accepted" = "a list of numbers of drones and relays, for example `[0, 1]`")
    )]
    pub(super) drones: Located<Vec<Located<u32>>>,
    /// Command that runs another command on the host and connects its input and output.
    #[schemars(extend(
        "x-accepted" = "a list of a command and its arguments, for example `[\"ssh\", \"pi@10.0.0.7\"]`",
        "x-default" = "none, for this machine"
    ))]
    pub(super) run: Option<Located<Vec<String>>>,
    /// The daemon's program on the host, of the same version as `muster`.
    #[schemars(extend(
        "x-accepted" = "a path or name of letters, digits and `/._-+`",
        "x-default" = "\"musterd\""
    ))]
    pub(super) musterd: Option<Located<String>>,
    /// Network interface of the host.
    #[schemars(extend(
        "x-accepted" = "the name of a network interface, for example \"wlan0\"",
        "x-default" = "by the system's routes"
    ))]
    pub(super) interface: Option<String>,
    /// Address of the host's first drone; the others use the following ports.
    #[schemars(extend(
        "x-accepted" = "an address and port, for example \"10.0.0.7:4700\"",
        "x-condition" = "only without `group` and `broadcast`, which need none"
    ))]
    pub(super) address: Option<Located<SocketAddr>>,
    /// Name of the host, in waves and tables; for `muster deploy`.
    #[schemars(extend(
        "x-accepted" = "letters, digits and `._-`",
        "x-default" = "the last word of `run` without a user, or \"local\""
    ))]
    pub(super) name: Option<Located<String>>,
    /// Where the flight controller of its only drone is; for `muster deploy`. Without it the vehicle is simulated.
    #[schemars(extend("x-accepted" = "as `port` in a drone's file"))]
    pub(super) controller: Option<Located<String>>,
    /// Who else commands the flight controller; for `muster deploy`.
    #[schemars(extend("x-condition" = "required with `controller`"))]
    pub(super) receiver: Option<Located<ReceiverName>>,
    /// What its drones may do; for `muster deploy`. The stages above `bench` need grants in the folder of keys.
    #[schemars(extend("x-default" = "\"sim\""))]
    pub(super) stage: Option<Located<StageName>>,
}
