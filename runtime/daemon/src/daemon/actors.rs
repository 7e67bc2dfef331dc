//! The drone's five actors as its process runs them: message delivery, timers, restarts and hang detection.

use std::time::Duration;

use muster_actors::{AddressBook, Drone, Message};
use muster_machines::machine::Stimulus;
use muster_machines::node::{Address, Envelope, StepOutput};
use muster_machines::radio;
use muster_machines::time::Timestamp;

/// Pause before waking an actor whose deadline is still in the past after its timeout. Such an actor has a defect; without
/// the pause it would occupy a core. Timers of tokio are no finer.
const OVERDUE_PAUSE: Duration = Duration::from_millis(1);

/// The five actors, and what the process keeps about each.
///
/// Invariant: an actor that is down has no timer, and no message waits for it.
pub(super) struct Actors {
    /// `None` until all five run.
    drone: Option<Drone>,
    /// Messages that were posted before that.
    held: Vec<Envelope>,
    seats: [Seat; 5],
    /// Restarts that wait for the end of their back-off.
    restarts: Vec<(Timestamp, Address)>,
    /// The longest time for an actor to handle no message while one waits.
    hang_max: Duration,
    pub(super) refused: Refused,
}

/// Messages for which an actor's queue was full or the actor was down.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Refused {
    /// Received frames, for the radio.
    pub(super) frames: u64,
    /// All other messages.
    pub(super) messages: u64,
}

/// What the process keeps about one actor.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Seat {
    pub(super) is_up: bool,
    deadline: Option<Timestamp>,
    starts: u64,
    pub(super) failures: u64,
    /// How often its deadline was in the past after a timeout.
    pub(super) overdue: u64,
    /// The deadline for which it was woken, until that is handled.
    woken_for: Option<Timestamp>,
    /// The longest time from a deadline until it was handled.
    late_max: Duration,
    /// Since when messages wait and the actor has handled none. `None` if no message waits.
    waiting_since: Option<Timestamp>,
}

impl Seat {
    pub(super) const fn restarts(&self) -> u64 {
        self.starts.saturating_sub(1)
    }

    /// How long messages have waited without the actor handling one.
    pub(super) fn waiting_for(&self, now: Timestamp) -> Duration {
        self.waiting_since
            .map_or(Duration::ZERO, |since| now.since(since))
    }

    /// Sets the timer to the deadline of the actor's last step, to `now` if that was earlier, or after a pause if it is
    /// overdue.
    fn set_timer(&mut self, now: Timestamp, output: &StepOutput) {
        self.deadline = output.deadline.map(|deadline| deadline.max(now));
        if output.is_overdue {
            self.overdue += 1;
            self.deadline = Some(now + OVERDUE_PAUSE);
        }
    }
}

impl Actors {
    pub(super) fn new(hang_max: Duration) -> Self {
        Self {
            drone: None,
            held: Vec::new(),
            seats: [Seat::default(); 5],
            restarts: Vec::new(),
            hang_max,
            refused: Refused::default(),
        }
    }

    /// All five run: they get the messages that were posted before.
    pub(super) fn start(&mut self, now: Timestamp, drone: Drone) {
        self.drone = Some(drone);
        for envelope in std::mem::take(&mut self.held) {
            self.post(now, envelope);
        }
    }

    pub(super) fn seat(&self, address: Address) -> &Seat {
        &self.seats[address as usize]
    }

    /// The actors' mailboxes. `None` until all five run.
    pub(super) fn book(&self) -> Option<&AddressBook> {
        self.drone.as_ref().map(Drone::book)
    }

    /// The longest time from a deadline of an actor to the end of its step.
    pub(super) fn late_max(&self) -> Duration {
        let late = self.seats.iter().map(|seat| seat.late_max);
        late.max().unwrap_or_default()
    }

    pub(super) fn failures(&self) -> u64 {
        self.seats.iter().map(|seat| seat.failures).sum()
    }

    /// Sends a message to the actor it is for. Returns false if that is down or has no room; the message is dropped then.
    pub(super) fn post(&mut self, now: Timestamp, envelope: Envelope) -> bool {
        self.cast(now, envelope.address(), Stimulus::Input(envelope))
    }

    /// Makes an actor handle its timeouts now, which does no harm if none is due.
    pub(super) fn poke(&mut self, now: Timestamp, address: Address) -> bool {
        self.cast(now, address, Stimulus::Timeout)
    }

    fn cast(&mut self, now: Timestamp, address: Address, stimulus: Stimulus<Envelope>) -> bool {
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
        match drone.book().cast(address, Message::Step(stimulus)) {
            Ok(()) => {
                self.seats[address as usize]
                    .waiting_since
                    .get_or_insert(now);
                true
            }
            Err(error) => {
                self.refused.frames += u64::from(is_frame);
                self.refused.messages += u64::from(!is_frame);
                // At debug level: an attacker may cause one for each frame.
                tracing::debug!("{error}");
                false
            }
        }
    }

    /// Sends an actor a message that injects a fault. It has no effect on an actor that is down.
    pub(super) fn inject(&self, address: Address, message: Message) {
        if let Some(book) = self.book() {
            let _ = book.cast(address, message);
        }
    }

    /// Wakes actors whose timers are due. A timer whose message is refused for lack of room is set anew.
    pub(super) fn fire_timers(&mut self, now: Timestamp) {
        self.fire_timers_with(now, |actors, address| actors.poke(now, address));
    }

    /// As [`Self::fire_timers`]. `wake` returns whether the actor had room for the message.
    fn fire_timers_with(
        &mut self,
        now: Timestamp,
        mut wake: impl FnMut(&mut Self, Address) -> bool,
    ) {
        for address in Address::ALL {
            let seat = &mut self.seats[address as usize];
            let Some(due) = seat.deadline.take_if(|deadline| *deadline <= now) else {
                continue;
            };
            seat.woken_for.get_or_insert(due);
            if !wake(self, address) && self.seat(address).is_up {
                self.seats[address as usize].deadline = Some(now + OVERDUE_PAUSE);
            }
        }
    }

    /// Restarts actors whose back-off has ended.
    pub(super) fn restart_due(&mut self, now: Timestamp) {
        let Some(drone) = &self.drone else {
            return;
        };
        self.restarts.retain(|(at, address)| {
            let is_due = *at <= now;
            if is_due {
                drone.restart(*address);
            }
            !is_due
        });
    }

    /// The next timer or restart.
    pub(super) fn deadline(&self) -> Option<Timestamp> {
        let timers = self.seats.iter().filter_map(|seat| seat.deadline);
        timers.chain(self.restarts.iter().map(|(at, _)| *at)).min()
    }

    /// Sets an actor's timer after a step.
    pub(super) fn set_timer(&mut self, now: Timestamp, address: Address, output: &StepOutput) {
        let seat = &mut self.seats[address as usize];
        // A message that was queued before may be handled first.
        let is_handled = |due: &mut Timestamp| output.deadline.is_none_or(|next| next > *due);
        if let Some(due) = seat.woken_for.take_if(is_handled) {
            seat.late_max = seat.late_max.max(now.since(due));
        }
        seat.set_timer(now, output);
        if output.is_overdue && seat.overdue == 1 {
            tracing::error!(
                actor = %address,
                "an actor's deadline was still in the past after its timeout; it is woken after {OVERDUE_PAUSE:?}"
            );
        }
    }

    /// An actor has handled a message.
    pub(super) fn has_stepped(&mut self, now: Timestamp, address: Address) {
        let waiting = self.book().and_then(|book| book.waiting(address));
        self.seats[address as usize].waiting_since =
            waiting.filter(|waiting| *waiting > 0).map(|_| now);
    }

    /// An actor is being started.
    pub(super) const fn set_up(&mut self, address: Address) {
        let seat = &mut self.seats[address as usize];
        seat.is_up = true;
        seat.starts += 1;
    }

    /// An actor has failed: its timer and its messages are gone.
    pub(super) const fn set_down(&mut self, address: Address) {
        let seat = &mut self.seats[address as usize];
        seat.is_up = false;
        seat.deadline = None;
        seat.waiting_since = None;
        seat.woken_for = None;
        seat.failures += 1;
    }

    /// Restarts an actor at `at`.
    pub(super) fn restart_at(&mut self, at: Timestamp, address: Address) {
        self.restarts.push((at, address));
    }

    /// Reports hung actors to their supervisor: messages wait, and for `hang_max` none was handled.
    pub(super) fn report_hung(&mut self, now: Timestamp) {
        for address in Address::ALL {
            let seat = &mut self.seats[address as usize];
            let hangs = |since: &mut Timestamp| now.since(*since) >= self.hang_max;
            if seat.is_up
                && let Some(since) = seat.waiting_since.take_if(hangs)
                && let Some(drone) = &self.drone
            {
                let (at_ns, waited_ms) = (now.as_nanos(), now.since(since).as_secs_f64() * 1e3);
                tracing::error!(actor = %address, at_ns, waited_ms, "an actor hangs");
                drone.report_hung(address);
            }
        }
    }

    /// The whole process stood still: no actor hangs because of that.
    pub(super) fn forgive_stall(&mut self, now: Timestamp) {
        for seat in &mut self.seats {
            seat.waiting_since = seat.waiting_since.map(|_| now);
        }
    }

    /// Whether each actor that runs has handled a message within `answer_max`. Each gets another one.
    pub(super) fn check_liveness(&mut self, now: Timestamp, answer_max: Duration) -> bool {
        let are_alive =
            (self.seats.iter()).all(|seat| !seat.is_up || seat.waiting_for(now) <= answer_max);
        for address in Address::ALL {
            let seat = self.seat(address);
            if seat.is_up && seat.waiting_since.is_none() {
                self.poke(now, address);
            }
        }
        are_alive
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(ms: u64) -> Timestamp {
        Timestamp::from_nanos(ms * 1_000_000)
    }

    fn due_at(ms: u64) -> StepOutput {
        StepOutput {
            deadline: Some(at(ms)),
            ..StepOutput::default()
        }
    }

    #[test]
    fn overdue_actor_is_counted_and_woken_after_pause() {
        let mut seat = Seat::default();
        let overdue = StepOutput {
            is_overdue: true,
            ..due_at(4_000)
        };
        seat.set_timer(at(5_000), &overdue);
        let paused = at(5_000) + OVERDUE_PAUSE;
        assert_eq!((seat.deadline, seat.overdue), (Some(paused), 1));
    }

    #[test]
    fn timer_fires_again_after_its_message_was_refused() {
        let mut actors = Actors::new(Duration::from_secs(1));
        actors.set_up(Address::Mission);
        actors.set_timer(at(4_000), Address::Mission, &due_at(5_000));
        for refused_ms in 5_000..5_010 {
            assert_eq!(actors.deadline(), Some(at(refused_ms)));
            actors.fire_timers_with(at(refused_ms), |_, _| false);
        }
        let mut woken = Vec::new();
        actors.fire_timers_with(at(5_010), |_, address| {
            woken.push(address);
            true
        });
        assert_eq!((woken, actors.deadline()), (vec![Address::Mission], None));
    }

    #[test]
    fn refused_timer_of_an_actor_that_is_down_is_not_set_anew() {
        let mut actors = Actors::new(Duration::from_secs(1));
        actors.set_timer(at(5_000), Address::Mission, &due_at(5_000));
        actors.fire_timers_with(at(5_000), |_, _| false);
        assert_eq!(actors.deadline(), None);
    }

    #[test]
    fn deadline_that_a_message_sets_in_the_past_is_due_at_once_and_not_late() {
        let mut actors = Actors::new(Duration::from_secs(1));
        actors.set_timer(at(5_000), Address::Routing, &due_at(4_000));
        let due = actors.deadline();
        assert_eq!(
            (due, actors.seat(Address::Routing).overdue),
            (Some(at(5_000)), 0)
        );
        actors.fire_timers_with(at(5_001), |_, _| true);
        actors.set_timer(at(5_003), Address::Routing, &due_at(6_000));
        assert_eq!(actors.late_max(), Duration::from_millis(3));
    }
}
