//! What a drone's process holds: its journal, its end of the network, its vehicle, its timers, and what has become of it.

use std::sync::Arc;
use std::time::Duration;

use bytes::Bytes;
use muster_actors::{Drone, Message};
use muster_machines::identity::{NodeId, SwarmId};
use muster_machines::machine::Stimulus;
use muster_machines::mission::{self, LandingReason};
use muster_machines::msp::{self, FlightCommand, Telemetry};
use muster_machines::node::{
    Address, Checkpoint, Checkpoints, Effect, Envelope, Observation, StepOutput,
};
use muster_machines::routing::Routes;
use muster_machines::time::Timestamp;
use muster_machines::{radio, routing, wire};
use muster_runtime::identity::Ed25519Authenticator;
use muster_runtime::journal::{Writer, Written};
use muster_runtime::vehicle::{SimulatedVehicle, VehicleState};
use muster_transport::quic::Stream;
use muster_transport::{Destination, Event};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tokio::sync::mpsc::Receiver;

use super::counts::Counts;
use super::lists::Keeper;
use super::network::Network;
use super::process::Components;
use super::reporter::Reporter;
use super::resting::Resting;
use super::service;
use crate::clock::Clock;
use crate::control::Losses;
use crate::log::Lost;

mod tell;

pub(super) use self::tell::STATES;

/// How many datagrams are taken in before the actors get their turn.
const DRAIN_MAX: usize = 64;

/// The least pause before an actor is woken again that handled a timeout and has a deadline that is not after it. Such an actor
/// has a defect; without the pause it would take a core for itself. The timers of tokio are no finer than this.
const OVERDUE_PAUSE: Duration = Duration::from_millis(1);

/// A frame to be sent: to whom, if not to all, and whether it is no more than a sign of life.
type Frame = (Option<NodeId>, Bytes, bool);

pub(super) struct State {
    id: NodeId,
    swarm: SwarmId,
    is_relay: bool,
    clock: Clock,
    /// How long an actor may do nothing while something waits for it.
    hang_max: Duration,
    checkpoints: Checkpoints,
    /// Until the process ends.
    journal: Option<Writer>,
    resting: Resting<Frame>,
    network: Network,
    authenticator: Arc<Ed25519Authenticator>,
    /// Keeps lists of the expelled for the next life, up to the end of this one.
    keeper: Option<Keeper>,
    vehicle: SimulatedVehicle,
    reporter: Reporter,
    /// The actors, once all five run.
    drone: Option<Drone>,
    /// What was posted before that.
    held: Vec<Envelope>,
    seats: [Seat; 5],
    restarts: Vec<(Timestamp, Address)>,
    /// When those who keep time wake.
    wakes: Option<Timestamp>,
    /// How many datagrams were taken in.
    taken_in: u64,
    /// When the actors were last asked whether they are there.
    asked_at: Option<Timestamp>,
    /// The way to the master.
    routes: Routes,
    counts: Counts,
    /// Lines of the log that were lost.
    lines_lost: Lost,
    /// Whose frames are not let in, as if they were out of range.
    losses: Losses,
    rng: ChaCha8Rng,
    /// Why it is to come down, until its mission has been told.
    called_down: Option<LandingReason>,
    /// Why it began to come down first.
    landing: Option<LandingReason>,
    /// Whether its mission says that it is on the ground for good.
    is_finished: bool,
    /// Whether an actor could not be kept alive.
    gave_up: bool,
    /// Whether whoever started the process is gone.
    is_abandoned: bool,
}

/// What is kept of one of the five actors.
#[derive(Debug, Clone, Copy, Default)]
struct Seat {
    is_up: bool,
    deadline: Option<Timestamp>,
    /// Whether it has done anything since it was last asked.
    has_answered: bool,
    starts: u64,
    failures: u64,
    /// How often it was overdue.
    overdue: u64,
    /// Since when something waits for it, and it has done nothing.
    idle_since: Option<Timestamp>,
}

impl Seat {
    const fn restarts(&self) -> u64 {
        self.starts.saturating_sub(1)
    }

    /// Sets its timer as its step wants it; no sooner than after a pause if it is overdue.
    fn set_timer(&mut self, now: Timestamp, output: &StepOutput) {
        self.deadline = output.deadline;
        if output.is_overdue {
            self.overdue += 1;
            self.deadline = Some(now + OVERDUE_PAUSE);
        }
    }
}

impl State {
    pub(super) fn new(components: Components) -> Self {
        let missions = components.checkpoints.iter();
        let is_finished = missions.into_iter().any(|it| match it {
            Checkpoint::Mission(mission) => mission.state == mission::State::Finished,
            _ => false,
        });
        Self {
            id: components.id,
            swarm: components.swarm,
            is_relay: components.is_relay,
            clock: components.clock,
            hang_max: components.hang_max,
            checkpoints: components.checkpoints,
            journal: Some(components.journal),
            resting: Resting::default(),
            network: components.network,
            authenticator: components.authenticator,
            keeper: Some(components.keeper),
            vehicle: components.vehicle,
            reporter: Reporter::new(components.id, components.for_programs),
            drone: None,
            held: Vec::new(),
            seats: [Seat::default(); 5],
            restarts: Vec::new(),
            wakes: None,
            taken_in: 0,
            asked_at: None,
            routes: Routes::default(),
            counts: Counts::default(),
            lines_lost: components.lines_lost,
            losses: Losses::default(),
            rng: ChaCha8Rng::seed_from_u64(components.clock.now().as_nanos()),
            called_down: None,
            landing: None,
            is_finished,
            gave_up: false,
            is_abandoned: false,
        }
    }

    pub(super) const fn checkpoints(&self) -> &Checkpoints {
        &self.checkpoints
    }

    pub(super) const fn landing(&self) -> Option<LandingReason> {
        self.landing
    }

    /// Whether there is nothing more that it could do: it is down for good, or nobody is there for whom it flies.
    pub(super) const fn is_done(&self) -> bool {
        // A mission that does not know that it flies is done with it before the vehicle is down.
        let is_over = self.is_finished || self.gave_up;
        self.is_abandoned || (is_over && !self.vehicle.is_armed())
    }

    /// Nobody is there any more for whom a simulated drone flies.
    pub(super) const fn abandon(&mut self) {
        self.is_abandoned = true;
    }

    pub(super) const fn is_abandoned(&self) -> bool {
        self.is_abandoned
    }

    pub(super) fn begin(&mut self, drone: Drone) {
        self.drone = Some(drone);
        for envelope in std::mem::take(&mut self.held) {
            self.post(envelope);
        }
    }

    /// Does one thing that a step asked for.
    pub(super) fn effect(&mut self, now: Timestamp, effect: Effect) {
        match effect {
            Effect::Post(envelope) => {
                if let Envelope::Routing(routing::Input::Heard {
                    sender, payload, ..
                }) = &envelope
                {
                    self.counts.let_in(now, *sender, payload);
                }
                self.post(envelope);
            }
            Effect::Send {
                to,
                frame,
                keep_alive,
            } => {
                if let Some(frame) = self.resting.take((to, frame, keep_alive)) {
                    self.send(now, &frame);
                }
            }
            Effect::Locate { sender, source } => {
                self.counts.admitted += 1;
                self.network.transport().learn(sender, source);
            }
            Effect::Command(command) => self.command(now, command),
            Effect::Keep(checkpoint) => self.keep(&checkpoint),
            Effect::Observe(seen) => self.observe(now, &seen),
        }
    }

    fn send(&mut self, now: Timestamp, (to, frame, keep_alive): &Frame) {
        self.counts.sent(frame, *keep_alive);
        let to = to.map_or(Destination::Broadcast, Destination::To);
        self.network
            .transport()
            .send(now, self.id, to, frame)
            .expect("a radio sends no more than a datagram, and in its own name");
    }

    pub(super) fn post(&mut self, envelope: Envelope) {
        self.cast(envelope.address(), Stimulus::Input(envelope));
    }

    /// Hands something to an actor; whether it is there and has room, or will get it once all five run.
    fn cast(&mut self, address: Address, stimulus: Stimulus<Envelope>) -> bool {
        let Some(drone) = &self.drone else {
            if let Stimulus::Input(envelope) = stimulus {
                self.held.push(envelope);
            }
            return true;
        };
        let is_frame = matches!(
            stimulus,
            Stimulus::Input(Envelope::Radio(radio::Input::Received { .. }))
        );
        let cast = drone.book().cast(address, Message::Step(stimulus));
        if cast.is_ok() {
            let now = self.clock.now();
            self.seats[address as usize].idle_since.get_or_insert(now);
        }
        if let Err(refused) = &cast {
            // Frames at line rate may be among them.
            self.counts.no_room += u64::from(is_frame);
            self.counts.refused += u64::from(!is_frame);
            tracing::debug!("{refused}");
        }
        cast.is_ok()
    }

    fn command(&mut self, now: Timestamp, command: FlightCommand) {
        self.reporter.commanded(now, &command);
        let telemetry = self.vehicle.obey(now, command);
        self.tell(telemetry);
    }

    /// Hands the link what the vehicle says of itself.
    fn tell(&mut self, telemetry: Option<Telemetry>) {
        if let Some(telemetry) = telemetry {
            self.post(Envelope::Msp(Box::new(msp::Input::Telemetry(telemetry))));
        }
    }

    /// Keeps what a machine is built anew from, in the journal too: what is said from now on rests on it, if it must last.
    fn keep(&mut self, checkpoint: &Checkpoint) {
        if self.checkpoints.holds(checkpoint) {
            return;
        }
        let must_last = self.checkpoints.keep(checkpoint.clone());
        if let Some(journal) = &mut self.journal {
            let number = journal.keep(checkpoint.clone(), must_last);
            if must_last {
                self.resting.rests_on(number);
            }
        }
    }

    /// Something has become of what was kept. A drone whose journal can't be written comes down: should its process start anew,
    /// it would not know what it has said.
    pub(super) fn written(&mut self, now: Timestamp, written: &Written) {
        for frame in self.resting.written(written) {
            self.send(now, &frame);
        }
        let Written::Failed { error, .. } = written else {
            return;
        };
        self.counts.unwritten += 1;
        if self.counts.unwritten == 1 {
            tracing::error!(%error, "the journal can't be written: the drone comes down");
            self.come_down(LandingReason::JournalLost);
        }
    }

    /// The process ends: what was kept is to be written, by whoever lets go of what is returned.
    pub(super) fn take_journal(&mut self) -> Option<Writer> {
        self.journal.take()
    }

    /// The drone is to come down: its mission is told or, while that is built anew, will be.
    pub(super) fn come_down(&mut self, reason: LandingReason) {
        self.called_down.get_or_insert(reason);
        self.tell_to_come_down();
    }

    fn tell_to_come_down(&mut self) {
        // Where the mission can't be kept alive the drone is on its way down already.
        if let Some(reason) = self.called_down.filter(|_| !self.gave_up) {
            let envelope = Envelope::Mission(mission::Input::ComeDown(reason));
            if self.cast(envelope.address(), Stimulus::Input(envelope)) {
                self.called_down = None;
            }
        }
    }

    fn observe(&mut self, now: Timestamp, seen: &Observation) {
        match seen {
            Observation::Radio(radio::Event::Dropped(reason)) => self.counts.dropped(*reason),
            Observation::Routing(routing::Event::Routes(routes)) => self.routes.clone_from(routes),
            Observation::Routing(routing::Event::Ignored(_)) => self.counts.ignored += 1,
            Observation::Mission(mission::Event::Refused) => self.counts.orders_refused += 1,
            Observation::Radio(radio::Event::RevocationList { .. }) => self.has_new_list(),
            Observation::Mission(mission::Event::State(state)) => {
                self.say_talk(now);
                service::status(&state.to_string());
                self.is_finished |= *state == mission::State::Finished;
            }
            Observation::Mission(mission::Event::Landing(reason)) => {
                self.landing.get_or_insert(*reason);
            }
            _ => {}
        }
        self.reporter.saw(now, seen);
    }

    /// There is a newer list of the expelled, which is obeyed already: it is passed on, and kept for the next life.
    pub(super) fn has_new_list(&mut self) {
        let list = self.authenticator.revoked();
        let number = list.number();
        let can_be_passed_on = list.can_be_passed_on();
        if let Some(keeper) = &self.keeper {
            keeper.take(list);
        }
        if !can_be_passed_on {
            tracing::warn!(
                number,
                "the list of the revoked is too long to be passed on to others"
            );
        }
        if self.authenticator.is_revoked() {
            tracing::error!(number, "this drone was revoked: it comes down");
            self.come_down(LandingReason::Recalled);
        }
        self.cast(Address::Radio, Stimulus::Timeout);
    }

    /// The process ends: what it was told to keep is all.
    pub(super) fn take_no_more_lists(&mut self) {
        self.keeper = None;
    }

    /// Says to programs how much was sent and let in since this was last said.
    pub(super) fn say_talk(&mut self, now: Timestamp) {
        self.reporter.talked(now, self.counts.talk());
    }

    /// From now on so much of what others send is not let in.
    pub(super) fn lose(&mut self, losses: Losses) {
        self.losses = losses;
    }

    /// The vehicle does something else than it was told.
    pub(super) fn overrule(&mut self, now: Timestamp, state: VehicleState, epoch: Timestamp) {
        self.vehicle.resume(state, epoch, now);
        let telemetry = self.vehicle.obey(now, FlightCommand::Report);
        self.tell(telemetry);
    }

    /// Whether a datagram is one of those that would not have got here.
    fn is_lost(&mut self, datagram: &[u8]) -> bool {
        let sender = wire::decode_frame(datagram).map(|frame| frame.header.sender);
        let loss = sender.map_or(0.0, |sender| self.losses.from(sender));
        loss > 0.0 && self.rng.random_bool(loss.min(1.0))
    }

    /// Takes in datagrams; whether there were any.
    pub(super) fn drain_some(&mut self) -> bool {
        let before = self.taken_in;
        self.drain();
        self.taken_in != before
    }

    /// Takes in datagrams, no more than the radio has room for; whether there are no more for now.
    pub(super) fn drain(&mut self) -> bool {
        for _ in 0..self.room_for_datagrams() {
            let Some(event) = self.network.transport().poll_event() else {
                return self.network.is_drained();
            };
            self.taken_in = self.taken_in.wrapping_add(1);
            let input = match event {
                Event::Arrival(arrival) if self.is_lost(&arrival.datagram) => {
                    self.counts.out_of_range += 1;
                    continue;
                }
                Event::Arrival(arrival) => radio::Input::Received {
                    datagram: arrival.datagram,
                    source: arrival.source,
                    peer: arrival.peer,
                },
                Event::Outcome(outcome) => radio::Input::Outcome {
                    to: outcome.to,
                    delivered: outcome.fate == muster_transport::Fate::Delivered,
                    frame: outcome.datagram,
                },
            };
            self.post(Envelope::Radio(input));
        }
        false
    }

    /// How many datagrams may be taken in: what does not come off the network is not lost, as long as it has room there.
    /// While the radio is built anew they come off, and are counted.
    fn room_for_datagrams(&self) -> usize {
        let book = self.drone.as_ref().map(Drone::book);
        let room = book.and_then(|book| {
            // Half of it is for what the drone itself sends.
            Some((book.waiting_max() / 2).saturating_sub(book.waiting(Address::Radio)?))
        });
        room.unwrap_or(DRAIN_MAX).min(DRAIN_MAX)
    }

    /// Does what is due; when something will be next.
    pub(super) fn wake(&mut self, now: Timestamp) -> Option<Timestamp> {
        for address in Address::ALL {
            let deadline = &mut self.seats[address as usize].deadline;
            let is_due = deadline.take_if(|deadline| *deadline <= now).is_some();
            if is_due && !self.cast(address, Stimulus::Timeout) && self.is_up(address) {
                // It had no room.
                self.seats[address as usize].deadline = Some(now + OVERDUE_PAUSE);
            }
        }
        self.tell_to_come_down();
        let telemetry = self.vehicle.handle_timeout(now);
        self.tell(telemetry);
        let (due, later) = (self.restarts.iter().copied()).partition(|(at, _)| *at <= now);
        self.restarts = later;
        let due: Vec<_> = due;
        if let Some(drone) = &self.drone {
            due.into_iter()
                .for_each(|(_, address)| drone.restart(address));
        }
        self.wakes = self.next_deadline();
        self.wakes
    }

    fn next_deadline(&self) -> Option<Timestamp> {
        let seats = self.seats.iter().filter_map(|seat| seat.deadline);
        let restarts = self.restarts.iter().map(|(at, _)| *at);
        seats
            .chain(restarts)
            .chain(self.vehicle.next_timeout())
            .min()
    }

    /// Whether somebody waits for an earlier time than those who keep time wake at.
    pub(super) fn wakes_sooner(&mut self) -> bool {
        let next = self.next_deadline();
        let is_sooner = next.is_some_and(|next| self.wakes.is_none_or(|wakes| next < wakes));
        if is_sooner {
            self.wakes = next;
        }
        is_sooner
    }

    pub(super) fn set_timer(&mut self, now: Timestamp, address: Address, output: &StepOutput) {
        let seat = &mut self.seats[address as usize];
        seat.set_timer(now, output);
        if output.is_overdue && seat.overdue == 1 {
            tracing::error!(
                actor = %address,
                "an actor handled a timeout and has a deadline that is not after it: it is woken again after {OVERDUE_PAUSE:?}"
            );
        }
    }

    pub(super) fn restart(&mut self, at: Timestamp, address: Address) {
        self.restarts.push((at, address));
    }

    pub(super) const fn is_up(&self, address: Address) -> bool {
        self.seats[address as usize].is_up
    }

    pub(super) const fn bring_up(&mut self, address: Address) {
        let seat = &mut self.seats[address as usize];
        seat.is_up = true;
        seat.starts += 1;
    }

    pub(super) const fn take_down(&mut self, address: Address) {
        let seat = &mut self.seats[address as usize];
        seat.is_up = false;
        seat.deadline = None;
        seat.has_answered = false;
        seat.idle_since = None;
        seat.failures += 1;
    }

    pub(super) fn give_up(&mut self) {
        self.gave_up = true;
        self.landing.get_or_insert(LandingReason::ActorGivenUp);
    }

    pub(super) fn answered(&mut self, now: Timestamp, address: Address) {
        let book = self.drone.as_ref().map(Drone::book);
        let waiting = book.and_then(|it| it.waiting(address));
        let seat = &mut self.seats[address as usize];
        seat.has_answered = true;
        seat.idle_since = waiting.filter(|it| *it > 0).map(|_| now);
    }

    /// Tells the supervisor of actors that have done nothing for too long, though something waits for them.
    pub(super) fn mend_what_hangs(&mut self, now: Timestamp) {
        for address in Address::ALL {
            let seat = &mut self.seats[address as usize];
            let hangs = |since: &mut Timestamp| now.since(*since) >= self.hang_max;
            if seat.is_up
                && seat.idle_since.take_if(hangs).is_some()
                && let Some(drone) = &self.drone
            {
                tracing::error!(actor = %address, "an actor hangs");
                drone.hangs(address);
            }
        }
    }

    /// The process stood still: that an actor did nothing meanwhile is no sign that it hangs.
    pub(super) fn stood_still(&mut self, now: Timestamp) {
        for seat in &mut self.seats {
            seat.idle_since = seat.idle_since.map(|_| now);
        }
    }

    /// Injects a fault into an actor.
    pub(super) fn inject(&self, address: Address, message: Message) {
        if let Some(drone) = &self.drone {
            // One that is not there can't be harmed.
            let _ = drone.book().cast(address, message);
        }
    }

    /// Whether all actors that run have done something since this was last asked; then they are asked again. What is due
    /// is all that they do when they are woken, so to be woken early does no harm.
    pub(super) fn ask_actors(&mut self, now: Timestamp) -> bool {
        let up = self.seats.iter().filter(|seat| seat.is_up);
        let have_answered = up.clone().all(|seat| seat.has_answered);
        if have_answered {
            self.asked_at = Some(now);
        }
        for address in Address::ALL {
            if have_answered && self.is_up(address) {
                self.seats[address as usize].has_answered = false;
                self.cast(address, Stimulus::Timeout);
            }
        }
        have_answered
    }

    /// What operators have to say, where they can, for whoever asks first.
    pub(super) fn streams(&mut self) -> Option<Receiver<Stream>> {
        self.network.streams()
    }

    /// Whether the drone stands on the ground and takes part in no flight: it has not heard of a master, or is there for
    /// good.
    pub(super) fn rests(&self) -> bool {
        !self.vehicle.is_armed() && !self.checkpoints.are_of_a_flight()
    }

    /// Lets the others know that nothing more comes from here; returns once they do, or can't.
    pub(super) fn farewell(&self) -> impl Future<Output = ()> + use<> {
        self.network.farewell()
    }

    pub(super) fn report(&self) {
        let failures = self.seats.iter().map(|seat| seat.failures).sum();
        self.counts
            .report(&self.network, failures, self.lines_lost());
    }

    fn lines_lost(&self) -> u64 {
        self.lines_lost.lines()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(now_ms: u64, deadline_ms: u64, is_overdue: bool) -> Seat {
        let at = |ms: u64| Timestamp::from_nanos(ms * 1_000_000);
        let output = StepOutput {
            deadline: Some(at(deadline_ms)),
            is_overdue,
            ..StepOutput::default()
        };
        let mut seat = Seat::default();
        seat.set_timer(at(now_ms), &output);
        seat
    }

    #[test]
    fn an_actor_that_is_overdue_is_counted_and_woken_after_a_pause() {
        let seat = set(5_000, 4_000, true);
        let paused = Timestamp::from_nanos(5_000_000_000) + OVERDUE_PAUSE;
        assert_eq!((seat.deadline, seat.overdue), (Some(paused), 1));
    }

    #[test]
    fn a_message_may_set_a_deadline_that_has_passed_already() {
        let seat = set(5_000, 4_000, false);
        let passed = Timestamp::from_nanos(4_000_000_000);
        assert_eq!((seat.deadline, seat.overdue), (Some(passed), 0));
    }
}
