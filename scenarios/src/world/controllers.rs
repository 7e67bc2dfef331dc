//! Simulated flight controllers, and the ports that their drones reach them by.

use std::time::Duration;

use muster_controller::{Controller, Fault, Truth};
use muster_machines::identity::NodeId;
use muster_machines::msp::PortEvent;
use muster_machines::msp::controller::LOST_AFTER;
use muster_machines::time::Timestamp;
use muster_msp::{Conversation, Decoder, SetRawRc, Write};
use muster_runtime::plan::Plan;
use muster_runtime::vehicle::VehicleKind;
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::line::Line;
use crate::checkers::RcGaps;
use crate::controllers::config;
use crate::scenario::ControllerFault;

/// Interval at which the world looks at an aircraft in flight: meanwhile it strays by centimetres from a constant velocity.
pub const LOOK_EVERY: Duration = Duration::from_millis(100);

/// One drone's controller and its port.
#[derive(Debug)]
struct Attached {
    controller: Controller,
    line: Line,
    conversation: Conversation,
    decoder: Decoder,
    is_open: bool,
    is_identified: bool,
    /// When the port can be opened again.
    closed_until: Timestamp,
    /// When the firmware goes on. `None` if it runs.
    frozen_until: Option<Timestamp>,
    /// When the battery's voltage is back. `None` if it is there.
    sags_until: Option<Timestamp>,
    /// The newest answer of an armed controller.
    heard_at: Timestamp,
    /// The drone's process must stop RC until the controller disarms: its failsafe flies, or no answer came for too long.
    is_lost: bool,
    looked_at: Option<Timestamp>,
    was_armed: bool,
    gaps: RcGaps,
}

/// What the port of a drone's process does in a tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PortState {
    /// The process runs.
    Runs,
    /// The process runs, but its link to the controller hangs or has failed for good: no new RC frames come.
    WithoutLink,
    /// The process has ended or hangs.
    Still,
}

/// All controllers, by the numbers of their drones. Empty without any.
#[derive(Debug, Default)]
pub(super) struct Controllers(Vec<Option<Attached>>);

impl Controllers {
    /// The next drones are those of a plan. `sensors` and `lines` draw the seeds of their sensors and of their lines' faults.
    pub(super) fn extend(&mut self, plan: &Plan, sensors: &mut ChaCha8Rng, lines: &mut ChaCha8Rng) {
        for (place, id) in plan.start_positions().zip(0..) {
            let has_controller =
                plan.vehicle_kind == VehicleKind::Msp && id < plan.layout.formation().drones();
            self.0.push(has_controller.then(|| {
                let config = config(plan, place);
                Attached {
                    controller: Controller::new(config, sensors.next_u64(), Timestamp::ZERO),
                    line: Line::new(lines.next_u64()),
                    conversation: Conversation::default(),
                    decoder: Decoder::default(),
                    is_open: true,
                    is_identified: false,
                    closed_until: Timestamp::ZERO,
                    frozen_until: None,
                    sags_until: None,
                    heard_at: Timestamp::ZERO,
                    is_lost: false,
                    looked_at: None,
                    was_armed: false,
                    gaps: RcGaps::default(),
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
        attached.is_some_and(|it| it.is_frozen(now))
    }

    /// Whether a drone hears nothing from its controller, which is frozen or behind a closed port.
    pub(super) fn is_silent(&self, now: Timestamp, drone: NodeId) -> bool {
        let attached = self.0.get(drone.0 as usize).and_then(Option::as_ref);
        attached.is_some_and(|it| it.is_frozen(now) || now < it.closed_until)
    }

    /// A drone's link gives its newest RC frame; `None` stops RC.
    pub(super) fn set_rc(&mut self, now: Timestamp, drone: NodeId, rc: Option<SetRawRc>) {
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
            attached.conversation = Conversation::new(elapsed(now));
            attached.is_identified = false;
            attached.heard_at = now;
        }
    }

    /// What a link that starts now is told of its open port.
    pub(super) fn open_port(&mut self, drone: NodeId) -> Option<PortEvent> {
        let attached = self.get(drone)?;
        let identity = attached.conversation.identity().cloned()?;
        Some(PortEvent::Identified(Box::new(identity)))
    }

    /// Injects a fault.
    pub(super) fn fault(&mut self, now: Timestamp, drone: NodeId, fault: Fault) {
        if let Some(attached) = self.get(drone) {
            attached.controller.fault(now, fault);
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
        let until = now + lasts.unwrap_or(Duration::MAX);
        match fault {
            ControllerFault::Freeze => {
                attached.controller.fault(now, Fault::Frozen(true));
                attached.frozen_until = Some(until);
            }
            ControllerFault::ClosePort => attached.closed_until = until,
            ControllerFault::LoseBytes(share) => attached.line.lose(share, until),
            ControllerFault::CorruptBytes(share) => attached.line.corrupt(share, until),
            ControllerFault::DelayBytes(by) => attached.line.delay(by, until),
            ControllerFault::SagBattery(volts) => {
                attached.controller.fault(now, Fault::Sag(volts));
                attached.sags_until = Some(until);
            }
        }
    }

    /// A tick of a drone's port: reads what has come, writes one command. `tell` takes what its link is told. Returns the state
    /// of the aircraft, if it is time to look at it, and until when it holds.
    pub(super) fn tick(
        &mut self,
        now: Timestamp,
        drone: NodeId,
        state: PortState,
        mut tell: impl FnMut(PortEvent),
    ) -> Option<(Truth, Timestamp)> {
        let attached = self.get(drone)?;
        attached.recover(now);
        let sent = attached.controller.transmit(now);
        let received = attached.line.carry_in(now, sent);
        let mut written = Vec::new();
        if state != PortState::Still {
            attached.open_or_close(now, &mut tell);
            if attached.is_open {
                attached.read(now, &received, &mut tell);
                attached.write(now, &mut written);
            }
        }
        let arrived = attached.line.carry_out(now, written);
        if !arrived.is_empty() {
            attached.controller.receive(now, &arrived);
        }
        let truth = attached.controller.aircraft(now);
        attached.look_for_loss(now, &truth);
        let is_open = attached.is_identified && state == PortState::Runs;
        let rc_is_due = truth.is_armed && is_open && !attached.is_lost;
        attached.gaps.look(now, rc_is_due);
        let is_due = attached
            .looked_at
            .is_none_or(|at| now.since(at) >= LOOK_EVERY);
        let is_news = truth.is_armed != attached.was_armed;
        attached.was_armed = truth.is_armed;
        if is_news || truth.is_armed && is_due {
            attached.looked_at = Some(now);
            return Some((truth, now + LOOK_EVERY));
        }
        None
    }

    /// The longest gap between two RC frames of any drone, while it must have sent them.
    pub(super) fn rc_gaps(&self) -> impl Iterator<Item = (NodeId, &RcGaps)> {
        let all = (0..).map(NodeId).zip(&self.0);
        all.filter_map(|(id, attached)| Some((id, &attached.as_ref()?.gaps)))
    }
}

impl Attached {
    fn is_frozen(&self, now: Timestamp) -> bool {
        self.frozen_until.is_some_and(|until| now < until)
    }

    fn look_for_loss(&mut self, now: Timestamp, truth: &Truth) {
        if !truth.is_armed {
            self.heard_at = now;
            self.is_lost = false;
        }
        self.is_lost |= truth.is_failsafe || now.since(self.heard_at) >= LOST_AFTER;
    }

    /// Ends the faults of the controller that are over.
    fn recover(&mut self, now: Timestamp) {
        if self.frozen_until.take_if(|until| *until <= now).is_some() {
            self.controller.fault(now, Fault::Frozen(false));
        }
        if self.sags_until.take_if(|until| *until <= now).is_some() {
            self.controller.fault(now, Fault::Sag(0.0));
        }
    }

    /// Notices that the port is closed, or opens it again.
    fn open_or_close(&mut self, now: Timestamp, tell: &mut impl FnMut(PortEvent)) {
        let is_open = now >= self.closed_until;
        if is_open == self.is_open {
            return;
        }
        self.is_open = is_open;
        self.is_identified = false;
        self.conversation.reopen(elapsed(now));
        if is_open {
            self.decoder = Decoder::default();
        } else {
            tell(PortEvent::Closed);
        }
    }

    fn read(&mut self, now: Timestamp, received: &[u8], tell: &mut impl FnMut(PortEvent)) {
        let conversation = &mut self.conversation;
        self.decoder.read(received, |frame| {
            if let Some((_, Ok(Some(telemetry)))) = conversation.take(elapsed(now), &frame) {
                self.heard_at = now;
                tell(PortEvent::Told(telemetry));
            }
        });
        if !self.is_identified
            && let Some(identity) = self.conversation.identity()
        {
            self.is_identified = true;
            tell(PortEvent::Identified(Box::new(identity.clone())));
        }
    }

    fn write(&mut self, now: Timestamp, bytes: &mut Vec<u8>) {
        let Some(write) = self.conversation.tick(elapsed(now)) else {
            return;
        };
        if matches!(write, Write::Rc(_)) {
            self.gaps.sent(now);
        }
        write.encode(bytes);
    }
}

fn elapsed(now: Timestamp) -> Duration {
    now.since(Timestamp::ZERO)
}
