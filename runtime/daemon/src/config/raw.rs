//! A drone's file as it is written.

use std::net::{SocketAddr, SocketAddrV4};
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::Deserialize;
use toml::Spanned;

use super::TransportName;

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Raw {
    #[schemars(with = "PathBuf")]
    pub(super) scenario: Spanned<PathBuf>,
    #[schemars(with = "u32")]
    pub(super) id: Spanned<u32>,
    #[schemars(with = "Option<u32>")]
    pub(super) swarm: Option<Spanned<u32>>,
    #[schemars(with = "StageName")]
    pub(super) stage: Spanned<StageName>,
    #[schemars(with = "VehicleName")]
    pub(super) vehicle: Spanned<VehicleName>,
    #[schemars(with = "TransportName")]
    pub(super) transport: Spanned<TransportName>,
    pub(super) journal: PathBuf,
    #[serde(default)]
    pub(super) log: LogName,
    #[serde(default)]
    pub(super) log_level: LevelName,
    pub(super) keys: Keys,
    #[schemars(with = "Option<Network>")]
    pub(super) udp: Option<Spanned<Network>>,
    #[schemars(with = "Option<Network>")]
    pub(super) quic: Option<Spanned<Network>>,
    pub(super) observe: Option<Observe>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(super) enum StageName {
    Sim,
    Bench,
    Tethered,
    Flight,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(super) enum VehicleName {
    ClosedForm,
    Msp,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(super) enum LogName {
    #[default]
    Human,
    Json,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(super) enum LevelName {
    Error,
    Warn,
    #[default]
    Info,
    Debug,
    Trace,
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[keys]`")]
pub(super) struct Keys {
    #[schemars(with = "PathBuf")]
    pub(super) drone: Spanned<PathBuf>,
    pub(super) fleet: PathBuf,
    pub(super) roster: PathBuf,
    pub(super) revoked: PathBuf,
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct Network {
    #[schemars(with = "Option<String>")]
    pub(super) bind: Option<Spanned<SocketAddr>>,
    #[schemars(with = "Option<String>")]
    pub(super) group: Option<Spanned<SocketAddrV4>>,
    #[schemars(with = "Option<String>")]
    pub(super) broadcast: Option<Spanned<SocketAddrV4>>,
    #[schemars(with = "Option<Vec<String>>")]
    pub(super) peers: Option<Spanned<Vec<SocketAddr>>>,
    pub(super) interface: Option<String>,
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[observe]`")]
pub(super) struct Observe {
    #[schemars(with = "String")]
    pub(super) http: Spanned<SocketAddr>,
}
