//! What a drone's process flies: a simulated vehicle, or a flight controller or an autopilot behind a port.

use std::io;
use std::sync::mpsc::Sender;
use std::sync::{Arc, PoisonError};
use std::time::Duration;

use muster_machines::geometry::{Ned, Velocity};
use muster_machines::msp::autopilot::Order;
use muster_machines::msp::controller::{Receiver, Stage};
use muster_machines::msp::{FlightCommand, Introduction, PortEvent, Telemetry};
use muster_machines::time::Timestamp;
use muster_msp::SetRawRc;
use muster_msp::check::{Finding, ReceiverMode};
use muster_port::{Event, Link, listen_flow};
use muster_runtime::vehicle::{SimulatedVehicle, VehicleState};
use tokio::sync::mpsc;

use super::autopilot::Piloted;
use super::permission::{Arming, Checker, Refused};
use crate::config::ControllerConfig;
use crate::pose;
use crate::status::PortStatus;

/// Events of a port that wait for the drone's thread. While they are full the port drops its oldest.
pub(super) const EVENTS_MAX: usize = 64;
/// How long the thread that passes events on waits before it looks whether the process has ended.
const WAIT: Duration = Duration::from_millis(200);

/// Time for a flight controller or an autopilot to report whether it is armed; after it the process takes it for disarmed. A
/// flight controller answers within half a second, an autopilot reports once a second.
const ARMED_REPORT_TIMEOUT: Duration = Duration::from_secs(2);
/// From one look whether it has reported that to the next.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// What a drone's process flies.
pub(super) enum Vehicle {
    /// In closed form.
    Simulated(Box<SimulatedVehicle>),
    /// A flight controller behind a port.
    Controlled(Box<Controlled>),
    /// An autopilot behind a port.
    Piloted(Box<Piloted>),
}

/// A flight controller behind a port.
pub(super) struct Controlled {
    port: Arc<Link>,
    /// In the stage `bench` it flies nothing, and any settings will do.
    stage: Stage,
    /// Why its stage has fallen to `bench`.
    refused: Refused,
    /// Newest telemetry for the navigation.
    telemetry: Telemetry,
    introduction: Introduction,
    /// Tells the thread of the port that the process has started.
    begin: Sender<()>,
}

/// Telemetry before the link has reported any.
pub(super) const UNKNOWN: Telemetry = Telemetry {
    position: Ned::HOME,
    position_lost_for: Some(Duration::ZERO),
    velocity: Velocity::ZERO,
    stop: Ned::HOME,
    at_rest: true,
    armed: false,
    landing: false,
    landing_cause: None,
    target: None,
    charge: 1.0,
};

impl Vehicle {
    /// The process has started: the port's controller may be checked from now on. So what the grant allows is in the log after
    /// the start that it is for.
    pub(super) fn begin(&self) {
        if let Self::Controlled(controlled) = self {
            // The thread is gone if the port is.
            let _ = controlled.begin.send(());
        }
    }

    /// Waits until a flight controller or an autopilot has reported whether it is armed, but not for long: it may be off.
    pub(super) async fn learn_whether_armed(&mut self) {
        if let Self::Simulated(_) = self {
            return;
        }
        let reported = async {
            loop {
                if let Some(armed) = self.is_armed_by_port() {
                    return armed;
                }
                tokio::time::sleep(LOOK_EVERY).await;
            }
        };
        if let Ok(armed) = tokio::time::timeout(ARMED_REPORT_TIMEOUT, reported).await {
            self.update_telemetry(Telemetry { armed, ..UNKNOWN });
        }
    }

    /// Whether the port says that the vehicle is armed. `None` if it has not said so yet.
    fn is_armed_by_port(&self) -> Option<bool> {
        match self {
            Self::Simulated(_) => None,
            Self::Controlled(controlled) => controlled.port.is_armed(),
            Self::Piloted(piloted) => piloted.port.status().armed,
        }
    }

    pub(super) fn is_armed(&self) -> bool {
        match self {
            Self::Simulated(vehicle) => vehicle.is_armed(),
            Self::Controlled(controlled) => controlled.telemetry.armed,
            Self::Piloted(piloted) => piloted.telemetry.armed,
        }
    }

    /// Whether the port says that the vehicle is disarmed, for a drone whose link to it has failed for good.
    pub(super) fn is_disarmed_by_port(&self) -> bool {
        match self {
            Self::Simulated(_) => false,
            Self::Controlled(controlled) => controlled.port.is_disarmed(),
            Self::Piloted(piloted) => piloted.port.status().armed == Some(false),
        }
    }

    pub(super) fn telemetry(&self, now: Timestamp) -> Telemetry {
        match self {
            Self::Simulated(vehicle) => vehicle.telemetry(now),
            Self::Controlled(controlled) => controlled.telemetry,
            Self::Piloted(piloted) => piloted.telemetry,
        }
    }

    /// State of the port; `None` without one.
    pub(super) fn port(&self) -> Option<PortStatus> {
        match self {
            Self::Simulated(_) => None,
            Self::Controlled(controlled) => Some(controlled.port.status().into()),
            Self::Piloted(piloted) => Some(piloted.status()),
        }
    }

    /// Sends an order of the link to an autopilot.
    pub(super) fn order(&self, order: Order) {
        if let Self::Piloted(piloted) = self {
            piloted.port.send(order);
        }
    }

    /// Executes a command of the link of a simulated vehicle. Returns telemetry, unless the vehicle moves.
    pub(super) fn execute(&mut self, now: Timestamp, command: FlightCommand) -> Option<Telemetry> {
        match self {
            Self::Simulated(vehicle) => vehicle.execute(now, command),
            // Its own link commands it by RC or by orders. Without the link these end, and its failsafe lands it.
            Self::Controlled(_) | Self::Piloted(_) => None,
        }
    }

    /// Gives the port the newest RC frame; `None` stops RC.
    pub(super) fn set_rc(&self, rc: Option<SetRawRc>) {
        match (self, rc) {
            (Self::Controlled(controlled), Some(rc)) => controlled.port.set_channels(rc),
            (Self::Controlled(controlled), None) => controlled.port.release(),
            (Self::Simulated(_) | Self::Piloted(_), _) => {}
        }
    }

    /// The link reports telemetry to the navigation.
    pub(super) fn update_telemetry(&mut self, telemetry: Telemetry) {
        match self {
            Self::Simulated(_) => {}
            Self::Controlled(controlled) => controlled.telemetry = telemetry,
            Self::Piloted(piloted) => piloted.telemetry = telemetry,
        }
    }

    /// An event of the port. Returns whether it is for the link.
    pub(super) fn handle_port_event(&mut self, now: Timestamp, event: &PortEvent) -> bool {
        let is_for_link = *event == PortEvent::Closed || self.refused().is_empty();
        if let Self::Controlled(controlled) = self
            && is_for_link
        {
            controlled.introduction.take(now, event);
        }
        is_for_link
    }

    /// Why the stage has fallen to `bench`. `None` if it has not.
    pub(super) fn ungranted(&self) -> Option<String> {
        match self {
            Self::Controlled(controlled) => {
                let refused = controlled.refused.lock();
                refused.unwrap_or_else(PoisonError::into_inner).clone()
            }
            Self::Simulated(_) | Self::Piloted(_) => None,
        }
    }

    /// Why the flight controller is refused: it is not fit to fly. Its link does not learn who it is, so that it sends no RC.
    /// Empty if it is not refused.
    pub(super) fn refused(&self) -> Vec<Finding> {
        match self {
            Self::Controlled(controlled) => {
                let mut unfit = controlled.port.status().unfit;
                unfit.retain(|finding| match controlled.stage {
                    Stage::Bench => false,
                    Stage::Sim => !finding.is_override_held(),
                    Stage::Tethered | Stage::Flight => true,
                });
                unfit
            }
            Self::Simulated(_) | Self::Piloted(_) => Vec::new(),
        }
    }

    /// Events of its port for a link that has just started.
    pub(super) fn introduction(&self, now: Timestamp) -> impl Iterator<Item = PortEvent> + use<> {
        let events = match self {
            // An autopilot repeats all that it reports.
            Self::Simulated(_) | Self::Piloted(_) => None,
            Self::Controlled(controlled) => Some(controlled.introduction.events(now)),
        };
        events.into_iter().flatten()
    }

    /// Replaces the state of a simulated vehicle. Its times count from `epoch`.
    pub(super) fn resume(&mut self, state: VehicleState, epoch: Timestamp, now: Timestamp) {
        if let Self::Simulated(vehicle) = self {
            vehicle.resume(state, epoch, now);
        }
    }

    /// When [`Self::handle_timeout`] must be called next.
    pub(super) fn next_timeout(&self) -> Option<Timestamp> {
        match self {
            Self::Simulated(vehicle) => vehicle.next_timeout(),
            Self::Controlled(_) | Self::Piloted(_) => None,
        }
    }

    pub(super) fn handle_timeout(&mut self, now: Timestamp) -> Option<Telemetry> {
        match self {
            Self::Simulated(vehicle) => vehicle.handle_timeout(now),
            Self::Controlled(_) | Self::Piloted(_) => None,
        }
    }
}

/// Events of a port.
pub(super) type PortEvents = mpsc::Receiver<PortEvent>;

/// Opens a port, and keeps it open. Returns its events.
///
/// # Errors
/// If the system starts no threads, or the address for poses is not free.
pub(super) fn controlled(config: &ControllerConfig) -> io::Result<(Vehicle, PortEvents)> {
    let mode = match config.receiver {
        Receiver::Sole => ReceiverMode::Sole,
        Receiver::Override => ReceiverMode::Override,
    };
    let port = Arc::new(Link::start(config.port.clone(), Some(mode))?);
    let (sender, events) = mpsc::channel(EVENTS_MAX);
    if let Some(address) = config.pose {
        pose::listen(address, sender.clone())?;
    }
    if let Some(address) = &config.flow {
        let readings = sender.clone();
        let take = move |reading| {
            // While the link is behind, a measurement is dropped: the next one is newer.
            drop(readings.try_send(PortEvent::Flow(reading)));
            !readings.is_closed()
        };
        listen_flow(address.clone(), take, |error| {
            tracing::warn!(%error, "the port of the optical flow module is closed");
        })?;
    }
    let source = Arc::downgrade(&port);
    let mut checker = Checker::new(config.permission.clone());
    let refused = checker.refused();
    let (begin, begun) = std::sync::mpsc::channel();
    std::thread::Builder::new()
        .name("port-events".to_owned())
        .spawn(move || {
            if begun.recv().is_err() {
                return;
            }
            let mut arming = Arming::default();
            while let Some(port) = source.upgrade()
                && !sender.is_closed()
            {
                let event = port.next_event(WAIT);
                let fallen = arming
                    .begins(port.is_armed() == Some(true), port.is_disarmed())
                    .then(|| fallen(&port.status(), &mut checker))
                    .flatten();
                let event = event.and_then(|event| log_event(event, &port, &mut checker));
                drop(port);
                for event in fallen.into_iter().chain(event) {
                    if sender.blocking_send(event).is_err() {
                        return;
                    }
                }
            }
        })?;
    let controlled = Controlled {
        port,
        stage: config.stage,
        refused,
        telemetry: UNKNOWN,
        introduction: Introduction::default(),
        begin,
    };
    let vehicle = Vehicle::Controlled(Box::new(controlled));
    Ok((vehicle, events))
}

/// Event for a link when its controller is being armed and its stage has fallen since it was looked at: the grant has ended.
fn fallen(status: &muster_port::Status, checker: &mut Checker) -> Option<PortEvent> {
    let granted = checker.fallen(status.found.clone())?;
    let identity = Box::new(status.identity.clone()?);
    Some(PortEvent::Identified { identity, granted })
}

/// Logs an event, and returns it for the link.
fn log_event(event: Event, port: &Link, checker: &mut Checker) -> Option<PortEvent> {
    Some(match event {
        Event::Unfit(findings) => {
            for finding in findings {
                tracing::warn!("the flight controller is not fit to fly: {finding}");
            }
            return None;
        }
        Event::Identified(identity) => {
            let (board, version) = (identity.board.board, &identity.version);
            tracing::info!(%board, major = version.major, minor = version.minor, "flight controller");
            PortEvent::Identified {
                identity: Box::new(identity),
                granted: checker.granted(port.status().found),
            }
        }
        Event::Closed(error) => {
            tracing::warn!(error, "the port of the flight controller is closed");
            PortEvent::Closed
        }
        Event::Telemetry(telemetry) => PortEvent::Telemetry(telemetry),
    })
}
