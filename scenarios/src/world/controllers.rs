//! Simulated flight controllers, and the ports that their drones reach them by.

use std::time::Duration;

use muster_controller::{Config, Controller, Fault, Settings, Truth};
use muster_machines::identity::NodeId;
use muster_machines::msp::PortEvent;
use muster_machines::time::Timestamp;
use muster_msp::{Conversation, Decoder, SetRawRc, Write};
use muster_runtime::plan::Plan;
use muster_runtime::vehicle::VehicleKind;
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use crate::checkers::RcGaps;

/// Capacity of a battery that is not to run empty, in mAh: the most that MSP can say.
const CAPACITY_MAX_MAH: f64 = 60_000.0;
/// Interval at which the world looks at an aircraft in flight: meanwhile it strays by centimetres from a constant velocity.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// One drone's controller and its port.
#[derive(Debug)]
struct Attached {
    controller: Controller,
    conversation: Conversation,
    decoder: Decoder,
    is_identified: bool,
    looked_at: Option<Timestamp>,
    was_armed: bool,
    gaps: RcGaps,
    bytes: Vec<u8>,
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
    /// The next drones are those of a plan. `rng` draws the seeds of their sensors.
    pub(super) fn extend(&mut self, plan: &Plan, rng: &mut ChaCha8Rng) {
        for (place, id) in plan.start_positions().zip(0..) {
            let has_controller =
                plan.vehicle_kind == VehicleKind::Msp && id < plan.layout.formation().drones();
            self.0.push(has_controller.then(|| {
                let mut config = Config::new(plan.home, Settings::sole());
                config.place = place;
                let hover_a = config.airframe.hover_a();
                let endurance = plan.endurance.map_or(f64::INFINITY, |it| it.as_secs_f64());
                let capacity_mah = (hover_a * endurance / 3.6).min(CAPACITY_MAX_MAH);
                config.airframe.battery.capacity_mah = capacity_mah;
                Attached {
                    controller: Controller::new(config, rng.next_u64(), Timestamp::ZERO),
                    conversation: Conversation::default(),
                    decoder: Decoder::default(),
                    is_identified: false,
                    looked_at: None,
                    was_armed: false,
                    gaps: RcGaps::default(),
                    bytes: Vec::new(),
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
        let received = attached.controller.transmit(now);
        if state != PortState::Still {
            attached.read(now, &received, &mut tell);
            attached.write(now);
        }
        let truth = attached.controller.aircraft(now);
        attached.gaps.look(
            now,
            truth.is_armed && !truth.is_failsafe && state == PortState::Runs,
        );
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
    fn read(&mut self, now: Timestamp, received: &[u8], tell: &mut impl FnMut(PortEvent)) {
        let conversation = &mut self.conversation;
        self.decoder.read(received, |frame| {
            if let Some((_, Ok(Some(telemetry)))) = conversation.take(elapsed(now), &frame) {
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

    fn write(&mut self, now: Timestamp) {
        let Some(write) = self.conversation.tick(elapsed(now)) else {
            return;
        };
        if matches!(write, Write::Rc(_)) {
            self.gaps.sent(now);
        }
        self.bytes.clear();
        let written = write.encode(&mut self.bytes);
        written.expect("all commands fit a frame of version 1");
        self.controller.receive(now, &self.bytes);
    }
}

fn elapsed(now: Timestamp) -> Duration {
    now.since(Timestamp::ZERO)
}
