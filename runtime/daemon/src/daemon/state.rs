//! The state of a drone's process: actors, journal, network, vehicle, and how the flight ends.

use std::sync::Arc;

use muster_actors::Drone;
use muster_machines::mission::{self, LandingReason};
use muster_machines::msp::{self, FlightCommand, PortEvent, Telemetry};
use muster_machines::node::{Address, Checkpoint, Checkpoints, Effect, Envelope, Observation};
use muster_machines::time::Timestamp;
use muster_machines::{navigation, radio, routing};
use muster_runtime::identity::RevocationList;
use muster_runtime::journal::{WriteReport, Writer};
use muster_runtime::vehicle::VehicleState;
use muster_transport::quic::Stream;
use tokio::sync::mpsc::Receiver;

use super::actors::Actors;
use super::agent_calls::AgentCalls;
use super::durable::{Durable, Frame};
use super::monitor::Monitor;
use super::outcome::Outcome;
use super::own_drone::OwnDrone;
use super::process::Components;
use super::radio_link::{Polled, RadioLink};
use super::revocation::{OutdatedList, Revocations};
use super::service;
use super::vehicle::Vehicle;
use crate::clock::Clock;
use crate::control::Losses;

mod pending;
mod status;

use self::pending::{LandingOrder, PendingPortEvents};
pub(super) use self::status::{ANSWER_MAX, STATES};

/// The most datagrams that are taken in before the actors run.
const DRAIN_MAX: usize = 64;

pub(super) struct State {
    own: OwnDrone,
    clock: Clock,
    actors: Actors,
    durable: Durable,
    link: RadioLink,
    revocations: Revocations,
    vehicle: Vehicle,
    monitor: Monitor,
    outcome: Outcome,
    landing_order: LandingOrder,
    port_events: PendingPortEvents,
    /// When the timer task wakes.
    wakes: Option<Timestamp>,
}

impl State {
    pub(super) fn new(components: Components) -> Self {
        let outcome = components.checkpoints.iter().find_map(|it| match it {
            Checkpoint::Mission(it) => Some(Outcome::of(&it)),
            _ => None,
        });
        let seed = components.clock.now().as_nanos();
        Self {
            own: components.own,
            clock: components.clock,
            actors: Actors::new(components.hang_max),
            durable: Durable::new(components.checkpoints, components.journal),
            link: RadioLink::new(components.network, seed),
            revocations: components.revocations,
            vehicle: components.vehicle,
            monitor: components.monitor,
            outcome: outcome.unwrap_or_default(),
            landing_order: LandingOrder::default(),
            port_events: PendingPortEvents::default(),
            wakes: None,
        }
    }

    pub(super) const fn actors(&mut self) -> &mut Actors {
        &mut self.actors
    }

    pub(super) fn is_up(&self, address: Address) -> bool {
        self.actors.seat(address).is_up
    }

    pub(super) const fn checkpoints(&self) -> &Checkpoints {
        self.durable.checkpoints()
    }

    /// Counts slow calls of the agent. `None` without an agent.
    pub(super) fn agent_calls(&self) -> Option<Arc<AgentCalls>> {
        self.monitor.agent_calls()
    }

    pub(super) const fn outcome(&self) -> &Outcome {
        &self.outcome
    }

    /// Whether the process may end.
    pub(super) fn is_done(&self) -> bool {
        let has_no_link = self.outcome.gave_up() && !self.is_up(Address::Msp);
        let is_disarmed = has_no_link && self.vehicle.is_disarmed_by_port();
        self.outcome
            .is_done(self.vehicle.is_armed() && !is_disarmed)
    }

    /// The process that started this one is gone.
    pub(super) const fn abandon(&mut self) {
        self.outcome.abandon();
    }

    /// All five actors run.
    pub(super) fn start(&mut self, drone: Drone) {
        self.actors.start(self.clock.now(), drone);
    }

    /// Executes one effect of a step.
    pub(super) fn execute(&mut self, now: Timestamp, effect: Effect) {
        match effect {
            Effect::Post(envelope) => {
                if let Envelope::Routing(routing::Input::Received {
                    sender, payload, ..
                }) = &envelope
                {
                    self.monitor
                        .counts
                        .admitted_for_routing(now, *sender, payload);
                }
                if let Envelope::Navigation(input) = &envelope
                    && let navigation::Input::Telemetry(telemetry) = &**input
                {
                    self.vehicle.update_telemetry(*telemetry);
                }
                self.actors.post(now, envelope);
            }
            Effect::Send {
                to,
                frame,
                keep_alive,
            } => {
                let frame = Frame {
                    to,
                    bytes: frame,
                    keep_alive,
                };
                if let Some(frame) = self.durable.hold(frame) {
                    self.send(now, &frame);
                }
            }
            Effect::LearnAddress { sender, source } => {
                self.monitor.counts.admitted += 1;
                self.monitor.counts.proven.insert(sender);
                self.link.network.transport().learn(sender, source);
            }
            Effect::Command(command) => {
                self.monitor.reporter.commanded(now, &command);
                let telemetry = self.vehicle.execute(now, command);
                self.report_telemetry(now, telemetry);
            }
            Effect::Rc(rc) => self.vehicle.set_rc(rc),
            Effect::Order(order) => self.vehicle.order(order),
            Effect::StoreCheckpoint(checkpoint) => {
                if let Err(error) = self.durable.keep(&checkpoint) {
                    self.journal_failed(&error);
                }
            }
            Effect::KeepList(list) => {
                let is_revoked = self.revocations.keep(&list);
                self.list_in_force(is_revoked);
            }
            Effect::Observe(seen) => self.observe(now, &seen),
        }
    }

    fn send(&mut self, now: Timestamp, frame: &Frame) {
        self.monitor.counts.sent(&frame.bytes, frame.keep_alive);
        self.link.send(now, self.own.id, frame);
    }

    pub(super) fn post(&mut self, envelope: Envelope) {
        self.actors.post(self.clock.now(), envelope);
    }

    /// An actor starts or is started again.
    pub(super) fn starting(&mut self, address: Address) {
        self.actors.set_up(address);
        match address {
            Address::Msp => self.port_events.link_starts(),
            Address::Mission => self.landing_order.mission_starts(),
            _ => {}
        }
    }

    /// Delivers to the link the events of its port that wait.
    fn deliver_port_events(&mut self, now: Timestamp) {
        let (vehicle, actors) = (&self.vehicle, &mut self.actors);
        let introduction = || vehicle.introduction(now);
        let post = |event| actors.post(now, for_link(event));
        self.port_events.deliver(introduction, post);
    }

    /// An event of the port to the flight controller or the autopilot.
    pub(super) fn handle_port_event(&mut self, now: Timestamp, event: PortEvent) {
        self.deliver_port_events(now);
        if self.vehicle.handle_port_event(now, &event) {
            let actors = &mut self.actors;
            let post = |event| actors.post(now, for_link(event));
            self.port_events.post(event, post);
        }
    }

    fn report_telemetry(&mut self, now: Timestamp, telemetry: Option<Telemetry>) {
        if let Some(telemetry) = telemetry {
            let telemetry = Box::new(msp::Input::Telemetry(telemetry));
            self.actors.post(now, Envelope::Msp(telemetry));
        }
    }

    /// Sends the frames that a report of the journal releases.
    pub(super) fn journal_reported(&mut self, now: Timestamp, report: &WriteReport) {
        for frame in self.durable.release(report) {
            self.send(now, &frame);
        }
        if let WriteReport::Failed { error, .. } = report {
            self.journal_failed(error);
        }
    }

    /// A drone that can't write its journal lands: its next incarnation would not know what it has sent.
    fn journal_failed(&mut self, error: &dyn std::error::Error) {
        if self.durable.fails_first() {
            tracing::error!(%error, "the journal can't be written: the drone lands");
            self.order_landing(LandingReason::JournalLost);
        }
    }

    /// Stores no further checkpoints and lists. Dropping the returned writer waits for the journal.
    pub(super) fn close(&mut self) -> Option<Writer> {
        self.revocations.close();
        self.durable.close()
    }

    /// Orders the mission to land. It gets the order as soon as it runs and has room, and again whenever it is started again.
    pub(super) fn order_landing(&mut self, reason: LandingReason) {
        self.landing_order.give(reason);
        self.deliver_landing_order(self.clock.now());
    }

    fn deliver_landing_order(&mut self, now: Timestamp) {
        // After giving up, the drone is landing already.
        if !self.outcome.gave_up() {
            let actors = &mut self.actors;
            self.landing_order.deliver(|reason| {
                actors.post(now, Envelope::Mission(mission::Input::Abort(reason)))
            });
        }
    }

    fn observe(&mut self, now: Timestamp, seen: &Observation) {
        match seen {
            Observation::Mission(mission::Event::State(state)) => {
                service::status(&state.to_string());
                self.outcome.is_finished |= *state == mission::State::Finished;
            }
            Observation::Mission(mission::Event::Landing(reason)) => self.outcome.lands(*reason),
            _ => {}
        }
        self.monitor.observe(now, seen);
    }

    /// Puts the operator's revocation list in force. The radio gets it as soon as it runs and has room.
    ///
    /// # Errors
    /// If the list is older than the known one, which is kept.
    pub(super) fn replace_list(&mut self, list: RevocationList) -> Result<(), OutdatedList> {
        let is_revoked = self.revocations.replace(list)?;
        self.list_in_force(is_revoked);
        self.deliver_list(self.clock.now());
        Ok(())
    }

    /// A revocation list is in force, for radios that start from now on, too. `is_revoked`: the drone itself is on it.
    fn list_in_force(&mut self, is_revoked: bool) {
        self.durable.set_revoked(self.revocations.revoked());
        if is_revoked {
            self.order_landing(LandingReason::Recalled);
        }
    }

    fn deliver_list(&mut self, now: Timestamp) {
        let actors = &mut self.actors;
        self.revocations.deliver(|list| {
            let list = radio::Input::Revoked(Box::new(list));
            actors.post(now, Envelope::Radio(list))
        });
    }

    /// Logs for programs how many frames were sent and admitted since the last time.
    pub(super) fn report_traffic(&mut self, now: Timestamp) {
        self.monitor.report_traffic(now);
    }

    /// Sets the share of received frames to drop, for each sender.
    pub(super) fn set_losses(&mut self, losses: Losses) {
        self.link.losses = losses;
    }

    /// Replaces the state of the simulated vehicle. Its times count from `epoch`.
    pub(super) fn set_vehicle(&mut self, now: Timestamp, state: VehicleState, epoch: Timestamp) {
        self.vehicle.resume(state, epoch, now);
        let telemetry = self.vehicle.execute(now, FlightCommand::Report);
        self.report_telemetry(now, telemetry);
    }

    /// Takes in datagrams; returns whether there were any.
    pub(super) fn drain_some(&mut self) -> bool {
        let before = self.link.taken;
        self.drain();
        self.link.taken != before
    }

    /// Takes in datagrams, as many as the radio has room for. Returns whether the network has none left.
    pub(super) fn drain(&mut self) -> bool {
        let now = self.clock.now();
        for _ in 0..self.room_for_datagrams() {
            match self.link.poll() {
                Polled::Input(input) => _ = self.actors.post(now, Envelope::Radio(input)),
                Polled::Lost => {}
                Polled::Idle { is_drained } => return is_drained,
            }
        }
        false
    }

    /// How many datagrams may be taken in. While the radio has no room they stay in the network's buffers; while it is down
    /// they are taken and counted.
    fn room_for_datagrams(&self) -> usize {
        let room = self.actors.book().and_then(|book| {
            // Half of the queue is for what the drone itself sends.
            Some((book.waiting_max() / 2).saturating_sub(book.waiting(Address::Radio)?))
        });
        room.unwrap_or(DRAIN_MAX).min(DRAIN_MAX)
    }

    /// Does what is due by `now`; returns the next deadline.
    pub(super) fn wake(&mut self, now: Timestamp) -> Option<Timestamp> {
        self.actors.fire_timers(now);
        self.deliver_landing_order(now);
        self.deliver_list(now);
        self.deliver_port_events(now);
        let telemetry = self.vehicle.handle_timeout(now);
        self.report_telemetry(now, telemetry);
        self.actors.restart_due(now);
        self.wakes = self.deadline();
        self.wakes
    }

    fn deadline(&self) -> Option<Timestamp> {
        let actors = self.actors.deadline();
        actors.into_iter().chain(self.vehicle.next_timeout()).min()
    }

    /// Whether the timer task must wake earlier than it is set to.
    pub(super) fn must_wake_sooner(&mut self) -> bool {
        let next = self.deadline();
        let is_sooner = next.is_some_and(|next| self.wakes.is_none_or(|wakes| next < wakes));
        if is_sooner {
            self.wakes = next;
        }
        is_sooner
    }

    /// An actor failed too often.
    pub(super) fn give_up(&mut self) {
        self.outcome.give_up();
    }

    /// Operators' streams, for the first caller. `None` if the transport has none.
    pub(super) fn streams(&mut self) -> Option<Receiver<Stream>> {
        self.link.network.streams()
    }

    /// Whether the drone is on the ground and takes part in no flight: it has heard of no master, or its flight is over.
    pub(super) fn is_idle(&self) -> bool {
        !self.vehicle.is_armed() && !self.checkpoints().is_flight_ongoing()
    }

    /// Closes the network's connections; returns once the others know, or can't.
    pub(super) fn farewell(&self) -> impl Future<Output = ()> + use<> {
        self.link.network.farewell()
    }

    /// Logs all counters.
    pub(super) fn report(&self) {
        self.monitor.counts.report(
            &self.link,
            &self.actors,
            self.durable.failures,
            self.monitor.lines_lost(),
        );
    }
}

fn for_link(event: PortEvent) -> Envelope {
    Envelope::Msp(Box::new(msp::Input::Port(event)))
}
