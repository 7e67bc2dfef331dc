//! Simulated flight controllers, and the ports that their drones reach them by.

use std::time::Duration;

use muster_controller::{Contact, Controller, Fault, PoseSensor, Sticks, Truth};
use muster_machines::identity::NodeId;
use muster_machines::msp::controller::{
    ACKNOWLEDGED_MIN, HEIGHT_LOST_AFTER, LOST_AFTER, Receiver, Stage, UNTOLD_AFTER,
};
use muster_machines::msp::{Introduction, PortEvent};
use muster_machines::time::Timestamp;
use muster_msp::{
    Conversation, Decoder, Direction, Frame, Identity, Message, SetRawRc, Telemetry as Told, Write,
};
use muster_runtime::vehicle::VehicleKind;
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::faulty::FaultyController;
use super::pilot::Pilot;
use crate::checkers::{ArmSwitch, RC_GAP_MAX, RcGaps, Violation, Wrecks};
use crate::controllers::{config, pose_errors};
use crate::report::ControlSeries;
use crate::scenario::{ControllerFault, Scenario};

/// Interval at which the world looks at an aircraft in flight: meanwhile it strays by centimetres from a constant velocity.
pub const LOOK_EVERY: Duration = Duration::from_millis(100);

/// One drone's controller and its port.
#[derive(Debug)]
struct Attached {
    faulty: FaultyController,
    conversation: Conversation,
    decoder: Decoder,
    introduction: Introduction,
    /// `None` without a pilot's receiver.
    pilot: Option<Pilot>,
    /// Measures where the aircraft is. `None` if GPS does.
    pose: Option<PoseSensor>,
    is_open: bool,
    is_identified: bool,
    /// The newest answer of an armed controller.
    heard_at: Timestamp,
    /// The newest that was not too late to be used.
    told_at: Timestamp,
    /// The newest height, by the controller or a pose.
    height_at: Timestamp,
    /// The drone's process must stop RC until the controller disarms: its failsafe flies, no answer or no height came for
    /// too long, or too few RC frames were acknowledged.
    is_lost: bool,
    looked_at: Option<Timestamp>,
    was_armed: bool,
    wreck: Wrecks,
    gaps: RcGaps,
    arm_switch: ArmSwitch,
    figures: PortFigures,
    series: ControlSeries,
}

/// What a port has counted since the start of the run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct PortFigures {
    /// How often it was opened.
    pub(crate) opened: u64,
    /// Frames read.
    pub(crate) frames: u64,
    /// Bad frames read.
    pub(crate) bad_frames: u64,
    /// Bytes read that belong to no frame.
    pub(crate) noise_bytes: u64,
    /// Questions without an answer.
    pub(crate) questions_lost: u64,
    /// RC frames written.
    pub(crate) rc_sent: u64,
    /// RC frames that the controller acknowledged.
    pub(crate) rc_acknowledged: u64,
    /// Longest time between two RC frames that were due.
    pub(crate) rc_gap_max: Duration,
}

/// What the port of a drone's process does in a tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum PortState {
    /// The process runs.
    Runs,
    /// The process runs, but its link to the controller hangs or has failed for good: no new RC frames come.
    WithoutLink,
    /// The process has ended or hangs.
    Still,
}

/// All controllers, by the numbers of their drones. Empty without any.
#[derive(Debug, Default)]
pub(crate) struct Controllers(Vec<Option<Attached>>);

impl Controllers {
    /// The next drones are those of a scenario. `sensors` and `lines` draw the seeds of their sensors and of their lines' faults.
    pub(crate) fn extend(
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
                Attached {
                    faulty: FaultyController::new(
                        Controller::new(config, seed, Timestamp::ZERO),
                        lines.next_u64(),
                    ),
                    pose: pose.map(|errors| PoseSensor::new(errors, seed, Timestamp::ZERO)),
                    conversation: Conversation::default(),
                    decoder: Decoder::default(),
                    introduction: Introduction::default(),
                    pilot: (plan.receiver == Receiver::Override).then(Pilot::default),
                    is_open: true,
                    is_identified: false,
                    heard_at: Timestamp::ZERO,
                    told_at: Timestamp::ZERO,
                    height_at: Timestamp::ZERO,
                    is_lost: false,
                    looked_at: None,
                    was_armed: false,
                    wreck: Wrecks::default(),
                    gaps: RcGaps::default(),
                    arm_switch: ArmSwitch::default(),
                    figures: PortFigures {
                        opened: 1,
                        ..PortFigures::default()
                    },
                    series: ControlSeries::default(),
                }
            }));
        }
    }

    /// The drones that have a controller.
    pub(super) fn drones(&self) -> impl Iterator<Item = NodeId> + '_ {
        let all = (0..).map(NodeId).zip(&self.0);
        all.filter_map(|(id, attached)| attached.as_ref().map(|_| id))
    }

    pub(super) fn has(&self, drone: NodeId) -> bool {
        self.0.get(drone.0 as usize).is_some_and(Option::is_some)
    }

    fn get(&mut self, drone: NodeId) -> Option<&mut Attached> {
        self.0.get_mut(drone.0 as usize)?.as_mut()
    }

    /// Whether a drone's controller is frozen.
    pub(super) fn is_frozen(&self, now: Timestamp, drone: NodeId) -> bool {
        let attached = self.0.get(drone.0 as usize).and_then(Option::as_ref);
        attached.is_some_and(|it| it.faulty.is_frozen(now))
    }

    /// Whether a drone hears nothing from its controller, which is frozen or behind a closed port.
    pub(super) fn is_silent(&self, now: Timestamp, drone: NodeId) -> bool {
        let attached = self.0.get(drone.0 as usize).and_then(Option::as_ref);
        attached.is_some_and(|it| it.faulty.is_frozen(now) || it.faulty.is_closed(now))
    }

    /// A drone's link gives its newest RC frame; `None` stops RC.
    pub(crate) fn set_rc(&mut self, now: Timestamp, drone: NodeId, rc: Option<SetRawRc>) {
        if let Some(attached) = self.get(drone) {
            match rc {
                Some(rc) => attached.conversation.set_channels(elapsed(now), rc),
                None => attached.conversation.release(),
            }
        }
    }

    /// A drone's process has ended, and its port with it.
    pub(super) fn close(&mut self, now: Timestamp, drone: NodeId) {
        if let Some(attached) = self.get(drone) {
            attached.figures.questions_lost += attached.conversation.lost();
            attached.conversation = Conversation::new(elapsed(now));
            attached.introduction = Introduction::default();
            attached.is_identified = false;
            attached.heard_at = now;
        }
    }

    /// What a link that starts now is told of its port.
    pub(super) fn introduction(
        &self,
        now: Timestamp,
        drone: NodeId,
    ) -> impl Iterator<Item = PortEvent> + use<> {
        let attached = self.0.get(drone.0 as usize).and_then(Option::as_ref);
        let events = attached.map(|it| it.introduction.events(now));
        events.into_iter().flatten()
    }

    /// A drone's pilot, if there is one, sees whether the drone is to take off.
    pub(crate) fn show_pilot(&mut self, drone: NodeId, is_to_take_off: bool) {
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
    pub(crate) fn tick(
        &mut self,
        now: Timestamp,
        drone: NodeId,
        state: PortState,
        tell: impl FnMut(PortEvent),
    ) -> Option<(Truth, Timestamp)> {
        let attached = self.get(drone)?;
        // The link's timer ends before it is told what arrives now.
        attached.is_lost |= attached.was_armed && attached.is_silent(now);
        let truth = attached.exchange(now, state, tell);
        attached.look_for_loss(now, &truth);
        attached.wreck.look(truth.contact == Contact::Wreck);
        let is_open = attached.is_identified && state == PortState::Runs;
        let rc_is_due = truth.is_armed && is_open && !attached.is_lost;
        attached.gaps.look(now, rc_is_due);
        attached.fly_by_hand(now, &truth);
        let is_due = attached
            .looked_at
            .is_none_or(|at| now.since(at) >= LOOK_EVERY);
        let is_news = truth.is_armed != attached.was_armed;
        attached.was_armed = truth.is_armed;
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
        let attached = self.0.get(drone.0 as usize)?.as_ref()?;
        Some(attached.series.clone())
    }

    /// Whether a drone's controller has waited for RC for too long or was armed too early, or its aircraft has broken.
    pub(crate) fn check(&self, now: Timestamp, drone: NodeId) -> Option<Violation> {
        let attached = self.0.get(drone.0 as usize)?.as_ref()?;
        (attached.arm_switch.check(now, drone))
            .or_else(|| attached.gaps.check(now, drone))
            .or_else(|| attached.wreck.check(now, drone))
    }

    /// What the port of a drone's flight controller has counted; `None` without one.
    pub(super) fn figures(&self, drone: NodeId) -> Option<PortFigures> {
        let attached = self.0.get(drone.0 as usize)?.as_ref()?;
        let counts = attached.decoder.counts();
        Some(PortFigures {
            frames: counts.frames,
            bad_frames: counts.bad(),
            noise_bytes: counts.noise_bytes,
            questions_lost: attached.figures.questions_lost + attached.conversation.lost(),
            rc_gap_max: attached.gaps.longest(),
            ..attached.figures
        })
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
            let mut events = Vec::new();
            self.open_or_close(now, &mut events);
            if self.is_open {
                self.read(now, &received, &mut events);
                self.write(now, &mut written);
            }
            for event in events {
                self.introduction.take(now, &event);
                tell(event);
            }
            self.measure_pose(now, &mut tell);
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
                self.height_at = now;
                tell(PortEvent::Pose(pose));
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

    fn look_for_loss(&mut self, now: Timestamp, truth: &Truth) {
        if !truth.is_armed {
            (self.heard_at, self.told_at, self.height_at) = (now, now, now);
            self.is_lost = false;
        }
        self.is_lost |= truth.is_failsafe || self.is_silent(now);
    }

    fn is_silent(&self, now: Timestamp) -> bool {
        // Of the heights that came, the link may have doubted the newest.
        now.since(self.heard_at) >= LOST_AFTER
            || now.since(self.told_at) >= UNTOLD_AFTER
            || now.since(self.height_at) >= HEIGHT_LOST_AFTER - RC_GAP_MAX
    }

    /// Notices that the port is closed, or opens it again.
    fn open_or_close(&mut self, now: Timestamp, events: &mut Vec<PortEvent>) {
        let is_open = !self.faulty.is_closed(now);
        if is_open == self.is_open {
            return;
        }
        self.is_open = is_open;
        self.is_identified = false;
        self.figures.opened += u64::from(is_open);
        self.figures.questions_lost += self.conversation.lost();
        self.conversation = Conversation::new(elapsed(now));
        if !is_open {
            events.push(PortEvent::Closed);
        }
    }

    fn read(&mut self, now: Timestamp, received: &[u8], events: &mut Vec<PortEvent>) {
        let (conversation, figures) = (&mut self.conversation, &mut self.figures);
        let mut take = |frame: Frame<'_>| {
            let is_rc = frame.command == SetRawRc::COMMAND && frame.direction == Direction::Reply;
            if is_rc {
                figures.rc_acknowledged += 1;
                conversation.acknowledged();
            } else if let Some(Ok(Some(telemetry))) =
                conversation.take(elapsed(now), &frame).map(|it| it.told)
            {
                self.heard_at = now;
                if telemetry != Told::Late {
                    self.told_at = now;
                }
                if let Told::Altitude(_) = telemetry {
                    self.height_at = now;
                }
                events.push(PortEvent::Told(telemetry));
            }
        };
        self.decoder.read(received, &mut take);
        self.decoder.expire(elapsed(now), &mut take);
        if let Some(told) = conversation.count_acknowledged() {
            if let Told::Acknowledged(count) = told {
                self.is_lost |= self.was_armed && count < ACKNOWLEDGED_MIN;
            }
            events.push(PortEvent::Told(told));
        }
        if !self.is_identified
            && let Some(identity) = self.conversation.identity()
        {
            self.is_identified = true;
            events.push(PortEvent::Identified {
                identity: Box::new(identity.clone()),
                granted: Stage::Bench,
            });
        }
    }

    fn write(&mut self, now: Timestamp, bytes: &mut Vec<u8>) {
        let Some(write) = self.conversation.tick(elapsed(now)) else {
            return;
        };
        if let Write::Rc(rc) = &write {
            let identity = self.conversation.identity();
            self.arm_switch
                .sent(rc, identity.is_some_and(Identity::is_simulation));
            self.gaps.sent(now);
            self.figures.rc_sent += 1;
        }
        write.encode(bytes);
    }
}

fn elapsed(now: Timestamp) -> Duration {
    now.since(Timestamp::ZERO)
}

#[cfg(test)]
mod tests;
