//! A drone's file as it is written.

use std::net::{SocketAddr, SocketAddrV4};
use std::path::PathBuf;

use serde::Deserialize;
use toml::Spanned;

use super::TransportName;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Raw {
    pub(super) scenario: Spanned<PathBuf>,
    pub(super) id: Spanned<u32>,
    pub(super) swarm: Option<Spanned<u32>>,
    pub(super) stage: Spanned<StageName>,
    pub(super) vehicle: Spanned<VehicleName>,
    pub(super) transport: Spanned<TransportName>,
    pub(super) journal: PathBuf,
    #[serde(default)]
    pub(super) log: LogName,
    #[serde(default)]
    pub(super) log_level: LevelName,
    pub(super) keys: Keys,
    pub(super) udp: Option<Spanned<Network>>,
    pub(super) quic: Option<Spanned<Network>>,
    pub(super) observe: Option<Observe>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum StageName {
    Sim,
    Bench,
    Tethered,
    Flight,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum VehicleName {
    ClosedForm,
    Msp,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum LogName {
    #[default]
    Human,
    Json,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum LevelName {
    Error,
    Warn,
    #[default]
    Info,
    Debug,
    Trace,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table, `[keys]`")]
pub(super) struct Keys {
    pub(super) drone: Spanned<PathBuf>,
    pub(super) fleet: PathBuf,
    pub(super) roster: PathBuf,
    pub(super) expelled: PathBuf,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct Network {
    pub(super) bind: Option<Spanned<SocketAddr>>,
    pub(super) group: Option<Spanned<SocketAddrV4>>,
    pub(super) broadcast: Option<Spanned<SocketAddrV4>>,
    pub(super) peers: Option<Spanned<Vec<SocketAddr>>>,
    pub(super) interface: Option<String>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table, `[observe]`")]
pub(super) struct Observe {
    pub(super) http: Spanned<SocketAddr>,
}
