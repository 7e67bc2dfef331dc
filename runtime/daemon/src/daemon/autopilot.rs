//! An autopilot behind a port.

use std::io;

use muster_machines::msp::autopilot::{AutopilotReport, LOST_AFTER};
use muster_machines::msp::controller::Stage;
use muster_machines::msp::{PortEvent, Telemetry};
use muster_mavlink::{Event, Port};
use tokio::sync::mpsc;

use super::vehicle::{EVENTS_MAX, PortEvents, UNKNOWN, Vehicle};
use crate::config::AutopilotConfig;
use crate::status::PortStatus;

/// An autopilot behind a port.
pub(super) struct Piloted {
    pub(super) port: Port,
    /// Newest telemetry for the navigation.
    pub(super) telemetry: Telemetry,
}

/// Heartbeats of an autopilot that does not report a simulation, until that is a warning.
const SILENT_ON_SIMULATION: u32 = 5;

/// Opens a port. Returns its events.
///
/// # Errors
/// If its address is not free, or the system starts no thread.
pub(super) fn open(config: &AutopilotConfig) -> io::Result<(Vehicle, PortEvents)> {
    let (sender, events) = mpsc::channel(EVENTS_MAX);
    let mut refused = 0_u64;
    let mut is_asked_for_simulation = config.stage == Stage::Sim;
    let mut heartbeats = 0_u32;
    let port = Port::open(config.port, move |event| {
        match event {
            Event::Report(AutopilotReport::Simulated) => is_asked_for_simulation = false,
            Event::Report(AutopilotReport::Heartbeat { .. }) if is_asked_for_simulation => {
                heartbeats += 1;
            }
            _ => {}
        }
        if is_asked_for_simulation && heartbeats == SILENT_ON_SIMULATION {
            is_asked_for_simulation = false;
            tracing::warn!(
                "the autopilot does not report a simulation (SIM_STATE): it gets no command"
            );
        }
        match event {
            // While the link is behind, a report is dropped: the next one is newer.
            Event::Report(report) => drop(sender.try_send(PortEvent::Autopilot(report))),
            Event::Refused(why) => {
                refused += 1;
                if refused.is_power_of_two() {
                    tracing::warn!(refused, "the autopilot refuses a command: {why}");
                }
            }
        }
        !sender.is_closed()
    })?;
    let piloted = Piloted {
        port,
        telemetry: UNKNOWN,
    };
    Ok((Vehicle::Piloted(Box::new(piloted)), events))
}

impl Piloted {
    pub(super) fn status(&self) -> PortStatus {
        let status = self.port.status();
        let port = muster_port::Status {
            state: match status.silent_for {
                None => muster_port::State::Identifying,
                Some(silence) if silence > LOST_AFTER => muster_port::State::Silent,
                Some(_) => muster_port::State::Open,
            },
            opened: 1,
            refused: status.refused,
            ..muster_port::Status::default()
        };
        PortStatus {
            bad_frames: status.ignored,
            ..port.into()
        }
    }
}

#[cfg(test)]
mod tests {
    use std::net::UdpSocket;

    use super::*;

    /// HEARTBEAT of an armed ArduCopter in GUIDED, as a frame of MAVLink 2.
    const ARMED: [u8; 21] = [
        0xFD, 0x09, 0x00, 0x00, 0x00, 0x01, 0x01, 0x00, 0x00, 0x00, 0x04, 0x00, 0x00, 0x00, 0x02,
        0x03, 0x81, 0x04, 0x03, 0x03, 0x56,
    ];

    #[tokio::test]
    async fn a_process_that_starts_in_flight_learns_that_its_autopilot_is_armed() {
        let free = UdpSocket::bind("127.0.0.1:0").unwrap();
        let address = free.local_addr().unwrap();
        drop(free);
        let config = AutopilotConfig {
            port: format!("udpin:{address}").parse().unwrap(),
            stage: Stage::Sim,
        };
        let (mut vehicle, _events) = open(&config).unwrap();
        let autopilot = UdpSocket::bind("127.0.0.1:0").unwrap();
        autopilot.send_to(&ARMED, address).unwrap();
        vehicle.learn_whether_armed().await;
        assert!(vehicle.is_armed());
    }
}
