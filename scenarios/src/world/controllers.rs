//! Simulated flight controllers, and the ports that their drones reach them by.

use std::time::Duration;

use muster_controller::{Controller, Fault, FlowSensor, PoseSensor, Sticks, Truth};
use muster_machines::identity::NodeId;
use muster_machines::msp::PortEvent;
use muster_machines::msp::controller::Receiver;
use muster_machines::time::Timestamp;
use muster_msp::SetRawRc;
use muster_runtime::vehicle::VehicleKind;
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::faulty::FaultyController;
use super::pilot::Pilot;
use super::port::{Port, PortFigures, PortState};
use crate::checkers::{Violation, Wrecks};
use crate::controllers::{config, flow_errors, pose_errors};
use crate::report::ControlSeries;
use crate::scenario::{ControllerFault, Scenario};

/// Interval at which the world looks at an aircraft in flight: meanwhile it strays by centimetres from a constant velocity.
pub const LOOK_EVERY: Duration = Duration::from_millis(100);

/// One drone's controller and its port.
#[derive(Debug)]
struct Attached {
    faulty: FaultyController,
    port: Port,
    /// `None` without a pilot's receiver.
    pilot: Option<Pilot>,
    /// Measures where the aircraft is. `None` if GPS does.
    pose: Option<PoseSensor>,
    flow: Option<FlowSensor>,
    looked_at: Option<Timestamp>,
    wreck: Wrecks,
    series: ControlSeries,
}

/// All controllers, by the numbers of their drones.
#[derive(Debug, Default)]
pub struct Controllers(Vec<Option<Box<Attached>>>);

impl Controllers {
    /// The next drones are those of a scenario. `sensors` and `lines` draw the seeds of their sensors and of their lines' faults.
    pub fn extend(
        &mut self,
        scenario: &Scenario,
        sensors: &mut ChaCha8Rng,
        lines: &mut ChaCha8Rng,
    ) {
        let plan = &scenario.plan;
        for (place, id) in plan.start_positions().zip(0..) {
            let has_controller =
                plan.vehicle_kind == VehicleKind::Msp && id < plan.layout.formation().drones();
            self.0.push(has_controller.then(|| {
                let config = config(scenario, place);
                let seed = sensors.next_u64();
                let pose = plan.pose.map(pose_errors);
                let flow = plan.flow.map(flow_errors);
                Box::new(Attached {
                    faulty: FaultyController::new(
                        Controller::new(config, seed, Timestamp::ZERO),
                        lines.next_u64(),
                    ),
                    pose: pose.map(|errors| PoseSensor::new(errors, seed, Timestamp::ZERO)),
                    flow: flow.map(|errors| FlowSensor::new(errors, seed, Timestamp::ZERO)),
                    port: Port::new(),
                    pilot: (plan.receiver == Receiver::Override).then(Pilot::default),
                    looked_at: None,
                    wreck: Wrecks::default(),
                    series: ControlSeries::default(),
                })
            }));
        }
    }

    /// The drones that have a controller.
    pub(super) fn drones(&self) -> impl Iterator<Item = NodeId> + '_ {
        let all = (0..).map(NodeId).zip(&self.0);
        all.filter_map(|(id, attached)| attached.as_ref().map(|_| id))
    }

    pub(super) fn has(&self, drone: NodeId) -> bool {
        self.of(drone).is_some()
    }

    fn of(&self, drone: NodeId) -> Option<&Attached> {
        self.0.get(drone.0 as usize)?.as_deref()
    }

    fn get(&mut self, drone: NodeId) -> Option<&mut Attached> {
        self.0.get_mut(drone.0 as usize)?.as_deref_mut()
    }

    /// Whether a drone's controller is frozen.
    pub(super) fn is_frozen(&self, now: Timestamp, drone: NodeId) -> bool {
        let attached = self.of(drone);
        attached.is_some_and(|it| it.faulty.is_frozen(now))
    }

    /// Whether a drone hears nothing from its controller, which is frozen or behind a closed port.
    pub(super) fn is_silent(&self, now: Timestamp, drone: NodeId) -> bool {
        let attached = self.of(drone);
        attached.is_some_and(|it| it.faulty.is_frozen(now) || it.faulty.is_closed(now))
    }

    /// A drone's link gives its newest RC frame; `None` stops RC.
    pub fn set_rc(&mut self, now: Timestamp, drone: NodeId, rc: Option<SetRawRc>) {
        if let Some(attached) = self.get(drone) {
            attached.port.set_rc(now, rc);
        }
    }

    /// A drone's process has ended, and its port with it.
    pub(super) fn close(&mut self, now: Timestamp, drone: NodeId) {
        if let Some(attached) = self.get(drone) {
            attached.port.end(now);
        }
    }

    /// What a link that starts now is told of its port.
    pub(super) fn introduction(
        &self,
        now: Timestamp,
        drone: NodeId,
    ) -> impl Iterator<Item = PortEvent> + use<> {
        let attached = self.of(drone);
        let events = attached.map(|it| it.port.introduction(now));
        events.into_iter().flatten()
    }

    /// A drone's pilot, if there is one, sees whether the drone is to take off.
    pub fn show_pilot(&mut self, drone: NodeId, is_to_take_off: bool) {
        if let Some(pilot) = self.get(drone).and_then(|it| it.pilot.as_mut()) {
            pilot.is_to_take_off = is_to_take_off;
        }
    }

    /// Loses what tells where a drone is, its GPS or its pose sensor, or finds it again.
    pub(super) fn lose_position(&mut self, now: Timestamp, drone: NodeId, is_lost: bool) {
        if let Some(attached) = self.get(drone) {
            attached.faulty.controller.fault(now, Fault::NoFix(is_lost));
            if let Some(pose) = &mut attached.pose {
                pose.lose(is_lost);
            }
        }
    }

    /// Breaks a drone's aircraft.
    pub(super) fn wreck(&mut self, now: Timestamp, drone: NodeId) {
        if let Some(attached) = self.get(drone) {
            attached.wreck.excuse();
            attached.faulty.controller.fault(now, Fault::Wreck);
        }
    }

    /// Injects a fault of the plan, for so long or for good.
    pub(super) fn affect(
        &mut self,
        now: Timestamp,
        drone: NodeId,
        fault: ControllerFault,
        lasts: Option<Duration>,
    ) {
        let Some(attached) = self.get(drone) else {
            return;
        };
        if let (ControllerFault::TakeOver, Some(pilot)) = (fault, &mut attached.pilot) {
            pilot.take_over();
        }
        if fault.may_break_aircraft() {
            attached.wreck.excuse();
        }
        attached.faulty.affect(now, fault, lasts);
    }

    /// A tick of a drone's port: reads what has come, writes one command. `tell` takes what its link is told. Returns the state
    /// of the aircraft, if it is time to look at it, and until when it holds.
    pub fn tick(
        &mut self,
        now: Timestamp,
        drone: NodeId,
        state: PortState,
        tell: impl FnMut(PortEvent),
    ) -> Option<(Truth, Timestamp)> {
        let attached = self.get(drone)?;
        attached.port.loss.begin(now);
        let truth = attached.exchange(now, state, tell);
        let is_news = truth.is_armed != attached.port.loss.was_armed;
        attached.port.look(now, &truth, state);
        attached.wreck.look(&truth);
        attached.fly_by_hand(now, &truth);
        let is_due = attached
            .looked_at
            .is_none_or(|at| now.since(at) >= LOOK_EVERY);
        if is_news || truth.is_armed && is_due {
            attached.looked_at = Some(now);
            let sticks = attached.faulty.controller.take_sticks(now);
            attached.series.look(now, &truth, Some(sticks));
            return Some((truth, now + LOOK_EVERY));
        }
        None
    }

    /// A controller elsewhere flies a drone's aircraft like this.
    pub(super) fn flew(
        &mut self,
        now: Timestamp,
        drone: NodeId,
        truth: &Truth,
        sticks: Option<Sticks>,
    ) {
        if let Some(attached) = self.get(drone) {
            attached.series.look(now, truth, sticks);
        }
    }

    /// How a drone was flown; `None` without a controller.
    pub(super) fn series(&self, drone: NodeId) -> Option<ControlSeries> {
        let attached = self.of(drone)?;
        Some(attached.series.clone())
    }

    /// Whether a drone's controller has waited for RC for too long or was armed too early, or its aircraft has broken or lost its
    /// motors in the air.
    pub(crate) fn check(&self, now: Timestamp, drone: NodeId) -> Option<Violation> {
        let attached = self.of(drone)?;
        let port = attached.port.check(now, drone);
        port.or_else(|| attached.wreck.check(now, drone))
    }

    /// What a rule finds wrong with a drone's RC or aircraft, in words.
    #[must_use]
    pub fn broken_rule(&self, now: Timestamp, drone: NodeId) -> Option<String> {
        self.check(now, drone).map(|violation| violation.what)
    }

    /// What the port of a drone's flight controller has counted; `None` without one.
    pub(super) fn figures(&self, drone: NodeId) -> Option<PortFigures> {
        let attached = self.of(drone)?;
        Some(attached.port.figures())
    }
}

impl Attached {
    /// Carries bytes both ways. Returns the state of the aircraft after it.
    fn exchange(
        &mut self,
        now: Timestamp,
        state: PortState,
        mut tell: impl FnMut(PortEvent),
    ) -> Truth {
        self.faulty.recover(now);
        let sent = self.faulty.controller.transmit(now);
        let received = self.faulty.line.carry_in(now, sent);
        let mut written = Vec::new();
        if state != PortState::Still {
            let is_open = !self.faulty.is_closed(now);
            written = self.port.tick(now, is_open, &received, &mut tell);
            self.measure_pose(now, &mut tell);
            self.measure_flow(now, &mut tell);
        }
        let arrived = self.faulty.line.carry_out(now, written);
        if !arrived.is_empty() {
            self.faulty.controller.receive(now, &arrived);
        }
        self.faulty.controller.aircraft(now)
    }

    fn measure_pose(&mut self, now: Timestamp, tell: &mut impl FnMut(PortEvent)) {
        if let Some(sensor) = &mut self.pose {
            let position = self.faulty.controller.aircraft(now).position;
            sensor.measure(now, position);
            while let Some(pose) = sensor.arrived(now) {
                self.port.loss.height_at = now;
                tell(PortEvent::Pose(pose));
            }
        }
    }

    fn measure_flow(&mut self, now: Timestamp, tell: &mut impl FnMut(PortEvent)) {
        if let Some(sensor) = &mut self.flow {
            let truth = self.faulty.controller.aircraft(now);
            let readings = sensor.measure(now, &truth);
            for reading in readings.into_iter().flatten() {
                tell(PortEvent::Flow(reading));
            }
        }
    }

    /// The pilot sees the aircraft, and moves sticks and switches.
    fn fly_by_hand(&mut self, now: Timestamp, truth: &Truth) {
        let moved = self.pilot.as_mut().and_then(|it| it.moves(now, truth));
        if let Some(channels) = moved {
            self.faulty.controller.pilot(now, Some(&channels));
        }
    }
}

#[cfg(test)]
mod tests;
