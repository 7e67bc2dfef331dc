//! What a drone's process opens when it starts: its journal, network and vehicle.

use std::sync::Arc;

use muster_machines::node::Checkpoints;
use muster_runtime::identity::RevocationList;
use muster_runtime::journal::{Folder, Journal, flights};
use tokio::signal::unix::Signal;
use tokio::sync::watch;

use super::Start;
use super::autopilot;
use super::endpoint::Endpoint;
use super::error::DaemonError;
use super::network::Network;
use super::tasks::{self, ControlMessages};
use super::vehicle::{self, PortEvents, Vehicle};
use crate::clock::Clock;
use crate::config::DroneConfig;
use crate::control::ControlMessage;

/// What a process opens before it counts an incarnation.
pub(super) struct Resources {
    pub(super) folder: Folder,
    pub(super) network: Network,
    /// The revocation list in force, which the network watches.
    pub(super) in_force: watch::Sender<RevocationList>,
    pub(super) endpoint: Option<Endpoint>,
    pub(super) recall: [Signal; 2],
    pub(super) reload: Signal,
    /// Random number of this incarnation. The journal's number is not used for it: another journal would count from 1
    /// again, under the same key.
    pub(super) drawn: u32,
}

impl Resources {
    pub(super) async fn open(config: &DroneConfig, clock: Clock) -> Result<Self, DaemonError> {
        let folder = Folder::open(&config.journal)?;
        let (in_force, revoked) = watch::channel(config.revoked.clone());
        let network = Network::open(config, revoked, Arc::new(move || clock.now()))?;
        let endpoint = open_endpoint(config).await?;
        Ok(Self {
            folder,
            network,
            in_force,
            endpoint,
            recall: tasks::recall_signals().map_err(DaemonError::Runtime)?,
            reload: tasks::reload_signal().map_err(DaemonError::Runtime)?,
            drawn: getrandom::u32().map_err(DaemonError::Random)?,
        })
    }
}

/// A vehicle, and what it is reached by.
pub(super) struct OpenedVehicle {
    pub(super) vehicle: Vehicle,
    /// The control channel, if the process has one.
    pub(super) control_messages: Option<ControlMessages>,
    /// Events of the port, if the vehicle has one.
    pub(super) port_events: Option<PortEvents>,
}

/// Opens the port to the flight controller or the autopilot; or creates the simulated vehicle, or resumes it with the state
/// from the control channel. `None` if the channel closed before that.
pub(super) async fn open_vehicle(
    config: &DroneConfig,
    start: Start,
    clock: Clock,
) -> Result<Option<OpenedVehicle>, DaemonError> {
    let mut control_messages = start.is_controlled.then(tasks::control_messages);
    let opened = match (&config.controller, &config.autopilot) {
        (Some(controller), _) => Some(vehicle::controlled(controller)),
        (None, Some(autopilot)) => Some(autopilot::open(autopilot)),
        (None, None) => None,
    };
    if let Some(opened) = opened {
        let (vehicle, port_events) = opened.map_err(DaemonError::Runtime)?;
        return Ok(Some(OpenedVehicle {
            vehicle,
            control_messages,
            port_events: Some(port_events),
        }));
    }
    let mut vehicle = (config
        .plan
        .simulated_vehicle(config.id, clock.now().as_nanos()))
    .expect("the configuration checked the drone's id");
    if let Some(control_messages) = control_messages.as_mut().filter(|_| start.resume) {
        match control_messages.recv().await {
            Some(ControlMessage::Vehicle { epoch, state }) => {
                vehicle.resume(*state, epoch, clock.now());
            }
            Some(ControlMessage::Losses(_) | ControlMessage::Inject { .. }) => {
                return Err(DaemonError::NoVehicle);
            }
            None => return Ok(None),
        }
    }
    Ok(Some(OpenedVehicle {
        vehicle: Vehicle::Simulated(Box::new(vehicle)),
        control_messages,
        port_events: None,
    }))
}

/// Opens the HTTP endpoint of `observe.http`. If the address can't be opened, that is an error on the ground; in flight it
/// is logged and retried.
async fn open_endpoint(config: &DroneConfig) -> Result<Option<Endpoint>, DaemonError> {
    let Some(address) = config.http else {
        return Ok(None);
    };
    let mut endpoint = Endpoint::at(address);
    match endpoint.open().await {
        Err(source) if !config.is_of_a_flight() => Err(DaemonError::Endpoint { address, source }),
        Err(error) => {
            tracing::error!(%error, "can't listen at {address}; retries each second");
            Ok(Some(endpoint))
        }
        Ok(()) => Ok(Some(endpoint)),
    }
}

/// Opens the journal and starts an incarnation. Before a flight it stores the scenario in the journal's folder.
pub(super) fn open_journal(
    folder: Folder,
    config: &DroneConfig,
    in_air: bool,
) -> Result<(Journal<Folder>, Checkpoints), DaemonError> {
    let opened = if in_air {
        Journal::open_in_flight(folder)
    } else {
        Journal::open(folder)
    };
    let kept = opened.and_then(|(journal, checkpoints)| {
        config.store_flight()?;
        if let Err(error) = flights::prune(&config.journals) {
            tracing::warn!(%error, "can't remove the journals of old flights");
        }
        Ok((journal, checkpoints))
    });
    kept.map_err(|source| DaemonError::Journal {
        path: config.journal.clone(),
        source,
    })
}
