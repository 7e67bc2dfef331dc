//! The flight controller of a drone's file: its port, who flies it, and what its stage needs.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};

use muster_machines::identity::NodeId;
use muster_machines::msp::controller::{Receiver, Stage};
use muster_port::Address;
use muster_runtime::diagnostic::BadInput;
use muster_runtime::identity::{Grant, GrantedStage};
use muster_runtime::schema::Located;

use super::File;
use super::drone_file::{ReceiverName, StageName, VehicleName};

/// Path of the last check of a drone's flight controller on the ground. It is beside the journal's folder, because it
/// outlives the journal.
fn kept_check(journal: &Path, id: u32) -> PathBuf {
    journal.with_file_name(format!("controller-kept-{id}.toml"))
}

/// A flight controller, as a drone's file names it.
#[derive(Debug)]
pub(crate) struct ControllerConfig {
    pub(crate) port: Address,
    pub(crate) stage: Stage,
    pub(crate) receiver: Receiver,
    /// Where poses arrive. `None` if GPS tells where the vehicle is.
    pub(crate) pose: Option<SocketAddr>,
    /// Where an optical flow module is. `None` without one.
    pub(crate) flow: Option<Address>,
    /// What must be earned. `None` up to the stage `bench`.
    pub(crate) permission: Option<Permission>,
}

/// A grant for a stage above `bench`. It names this drone and at least this stage.
#[derive(Debug, Clone)]
pub(crate) struct Permission {
    pub(crate) grant: Grant,
    pub(crate) stage: GrantedStage,
    /// Path of the controller's last check on the ground.
    pub(crate) kept: PathBuf,
}

impl File {
    /// The flight controller, if the drone has one. Checks that the vehicle fits the stage.
    pub(super) fn controller(&self) -> Result<Option<ControllerConfig>, BadInput> {
        let raw = &self.0.raw;
        let refuse = |at: std::ops::Range<usize>, message: &str| Err(self.0.error(at, message));
        let (stage, vehicle) = (&raw.stage, &raw.vehicle);
        let stage = match (stage.get_ref(), vehicle.get_ref()) {
            (_, VehicleName::Mavlink) => return Ok(None),
            (StageName::Sim, _) => Stage::Sim,
            (StageName::Bench, VehicleName::Msp) => Stage::Bench,
            (StageName::Tethered, VehicleName::Msp) => Stage::Tethered,
            (StageName::Flight, VehicleName::Msp) => Stage::Flight,
            (_, VehicleName::ClosedForm) => {
                let message = "`stage` needs \"sim\": a simulated vehicle flies in no other stage";
                return refuse(stage.span(), message);
            }
        };
        if *vehicle.get_ref() == VehicleName::ClosedForm {
            let port = raw.port.as_ref().map(Located::span);
            let receiver = raw.receiver.as_ref().map(Located::span);
            return match port.or(receiver).or(raw.sensor_span()) {
                Some(span) => refuse(
                    span,
                    "only a `vehicle = \"msp\"` has a port, a receiver, a pose and an optical flow module",
                ),
                None => Ok(None),
            };
        }
        let (Some(port), Some(receiver)) = (&raw.port, &raw.receiver) else {
            let message = "`vehicle = \"msp\"` needs `port` (\"serial:/dev/ttyACM0\", \"tcp:127.0.0.1:5761\") and \
                           `receiver` (\"sole\", \"override\")";
            return refuse(vehicle.span(), message);
        };
        let port = self.port(port, stage)?;
        if let Some(pose) = &raw.pose
            && !(pose.get_ref().ip().is_loopback() && pose.get_ref().port() > 0)
        {
            let message = "`pose` needs a loopback address and a fixed port: any sender that reaches it sets the drone's position";
            return refuse(pose.span(), message);
        }
        Ok(Some(ControllerConfig {
            permission: self.permission(receiver)?,
            pose: raw.pose.as_ref().map(|it| *it.get_ref()),
            flow: self.flow()?,
            port,
            stage,
            receiver: match receiver.get_ref() {
                ReceiverName::Sole => Receiver::Sole,
                ReceiverName::Override => Receiver::Override,
            },
        }))
    }

    /// The flight controller's port. In the stage `sim` no motor may hang on it.
    fn port(&self, port: &Located<String>, stage: Stage) -> Result<Address, BadInput> {
        let refuse = |message: &str| Err(self.0.error(port.span(), message));
        let address: Address = match port.get_ref().parse() {
            Ok(address) => address,
            Err(error) => return refuse(&error.to_string()),
        };
        if stage == Stage::Sim && matches!(address, Address::Serial { .. }) {
            return refuse(
                "in the stage \"sim\" `port` needs \"tcp:HOST:PORT\": motors may hang on a serial device",
            );
        }
        if stage == Stage::Sim && !address.is_on_this_host() {
            return refuse(
                "in the stage \"sim\" `port` needs an address of this host: who arms it must have started it",
            );
        }
        Ok(address)
    }

    /// The port of the optical flow module, if the drone has one.
    fn flow(&self) -> Result<Option<Address>, BadInput> {
        let Some(flow) = &self.0.raw.flow else {
            return Ok(None);
        };
        let address: Address = (flow.get_ref().parse()).map_err(|_| {
            let message = "`flow` needs \"serial:/dev/ttyUSB0@115200\" or \"tcp:127.0.0.1:9020\"";
            self.0.error(flow.span(), message)
        })?;
        if !address.is_on_this_host() {
            let message = "`flow` needs a serial device or an address of this host: any sender that reaches it sets the drone's velocity";
            return Err(self.0.error(flow.span(), message));
        }
        Ok(Some(address))
    }

    /// The grant that the stage needs, if it needs one. In the stage `bench` a grant is looked at if there is one.
    fn permission(&self, receiver: &Located<ReceiverName>) -> Result<Option<Permission>, BadInput> {
        let raw = &self.0.raw;
        let stage = match raw.stage.get_ref() {
            StageName::Sim => return Ok(None),
            StageName::Bench => GrantedStage::Bench,
            StageName::Tethered => GrantedStage::Tethered,
            StageName::Flight => GrantedStage::Flight,
        };
        if stage == GrantedStage::Bench {
            if let Some(path) = &raw.keys.grant {
                self.grant(path, stage)?;
            }
            return Ok(None);
        }
        if *receiver.get_ref() == ReceiverName::Sole {
            let message = format!(
                "the stage \"{stage}\" needs `receiver = \"override\"`: a pilot who arms and can take over"
            );
            return Err(self.0.error(receiver.span(), &message));
        }
        let Some(path) = &raw.keys.grant else {
            let message = format!(
                "the stage \"{stage}\" needs `keys.grant`, a file that `muster deploy promote` writes"
            );
            return Err(self.0.error(raw.stage.span(), &message));
        };
        Ok(Some(Permission {
            grant: self.grant(path, stage)?,
            stage,
            kept: kept_check(&self.0.resolve(&raw.journal), *raw.id.get_ref()),
        }))
    }

    /// The grant in a file, if it is for this drone and stage.
    fn grant(&self, path: &Located<PathBuf>, stage: GrantedStage) -> Result<Grant, BadInput> {
        let grant = Grant::load(&self.0.resolve(path.get_ref()), &self.fleet()?)?;
        match grant.is_for(NodeId(*self.0.raw.id.get_ref()), stage) {
            Ok(()) => Ok(grant),
            Err(refusal) => Err(self.0.error(path.span(), &refusal.to_string())),
        }
    }
}
