//! The autopilot that a drone's file names.

use muster_machines::msp::controller::Stage;
use muster_mavlink::Address;
use muster_runtime::diagnostic::{BadInput, TomlFile};
use muster_runtime::schema::Located;

use super::drone_file::{DroneFile, StageName, VehicleName};

/// An autopilot, as a drone's file names it.
#[derive(Debug)]
pub(crate) struct AutopilotConfig {
    pub(crate) port: Address,
    pub(crate) stage: Stage,
}

/// The autopilot, if the drone has one. Checks that it fits the stage.
pub(super) fn of(file: &TomlFile<DroneFile>) -> Result<Option<AutopilotConfig>, BadInput> {
    let raw = &file.raw;
    if *raw.vehicle.get_ref() != VehicleName::Mavlink {
        return Ok(None);
    }
    let stage = match raw.stage.get_ref() {
        StageName::Sim => Stage::Sim,
        StageName::Bench => Stage::Bench,
        StageName::Tethered | StageName::Flight => {
            let message = "with `vehicle = \"mavlink\"` `stage` needs \"sim\" or \"bench\": no higher stage is supported yet";
            return Err(file.error(raw.stage.span(), message));
        }
    };
    let receiver = raw.receiver.as_ref().map(Located::span);
    if let Some(span) = receiver.or(raw.sensor_span()) {
        let message =
            "only a `vehicle = \"msp\"` has a receiver, a pose and an optical flow module";
        return Err(file.error(span, message));
    }
    let Some(port) = &raw.port else {
        let message = "`vehicle = \"mavlink\"` needs `port` (\"udpin:127.0.0.1:14550\")";
        return Err(file.error(raw.vehicle.span(), message));
    };
    let address: Address =
        (port.get_ref().parse()).map_err(|error: muster_mavlink::AddressError| {
            file.error(port.span(), &error.to_string())
        })?;
    if stage == Stage::Sim && !address.is_loopback() {
        let message = "in the stage \"sim\" `port` needs a loopback address, as \"udpin:127.0.0.1:14550\": an aircraft may \
                       answer from elsewhere";
        return Err(file.error(port.span(), message));
    }
    Ok(Some(AutopilotConfig {
        port: address,
        stage,
    }))
}
