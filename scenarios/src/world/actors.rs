//! The state of a drone's five actors.

use std::hint::black_box;

use muster_machines::node::Address;
use muster_machines::time::Timestamp;

/// Which of a drone's actors run, which of them hang, and their timers.
///
/// Invariant: of the wake-ups scheduled for an actor at most one counts, that of its current generation; an actor that is
/// down has no timer.
#[derive(Debug, Default)]
pub(super) struct Actors {
    all: [Actor; 5],
    /// How often a hang has begun or ended.
    hangs: u32,
}

#[derive(Debug, Clone, Copy, Default)]
struct Actor {
    /// When its timer expires, on the drone's clock.
    deadline: Option<Timestamp>,
    /// The wake-up that counts.
    generation: u32,
    /// The number of the hang that holds it.
    hung: Option<u32>,
    is_up: bool,
}

impl Actors {
    pub(super) const fn is_up(&self, address: Address) -> bool {
        self.all[address as usize].is_up
    }

    pub(super) const fn is_hung(&self, address: Address) -> bool {
        self.all[address as usize].hung.is_some()
    }

    /// Whether all five hang.
    pub(super) fn are_hung(&self) -> bool {
        self.all.iter().all(|actor| actor.hung.is_some())
    }

    /// Whether a hang still holds one of them.
    pub(super) fn are_held_by(&self, hang: u32) -> bool {
        self.all.iter().any(|actor| actor.hung == Some(hang))
    }

    /// A number that rises whenever a hang begins or ends.
    pub(super) const fn hangs(&self) -> u32 {
        self.hangs
    }

    pub(super) const fn bring_up(&mut self, address: Address) {
        self.all[address as usize].is_up = true;
    }

    /// Stops an actor and its timer.
    pub(super) fn take_down(&mut self, address: Address) {
        let actor = &mut self.all[address as usize];
        (actor.is_up, actor.hung) = (false, None);
        self.set_timer(address, None);
    }

    /// Stops all of them.
    pub(super) fn take_all_down(&mut self) {
        for address in Address::ALL {
            self.take_down(address);
        }
        self.hangs += 1;
    }

    /// Makes actors hang; returns the number of this hang.
    pub(super) fn hang(&mut self, addresses: &[Address]) -> u32 {
        self.hangs += 1;
        for address in addresses {
            self.all[*address as usize].hung = Some(self.hangs);
        }
        self.hangs
    }

    /// Ends a hang; returns the wake-ups of timers that expired during it, where the drone's clock shows `now`.
    pub(super) fn resume(
        &mut self,
        hang: u32,
        now: Timestamp,
    ) -> impl Iterator<Item = (Address, u32)> + use<> {
        self.hangs += 1;
        for actor in &mut self.all {
            actor.hung = actor.hung.filter(|it| *it != hang);
        }
        let all = self.all;
        Address::ALL.into_iter().filter_map(move |address| {
            let actor = &all[address as usize];
            let is_overdue = actor.deadline.is_some_and(|deadline| deadline <= now);
            is_overdue.then_some((address, actor.generation))
        })
    }

    pub(super) const fn deadline(&self, address: Address) -> Option<Timestamp> {
        self.all[address as usize].deadline
    }

    /// Sets a timer. Returns the generation of the wake-up to schedule; `None` if that is scheduled already.
    pub(super) fn set_timer(
        &mut self,
        address: Address,
        deadline: Option<Timestamp>,
    ) -> Option<u32> {
        let actor = &mut self.all[address as usize];
        if actor.deadline == deadline {
            return None;
        }
        actor.deadline = deadline;
        actor.generation = actor.generation.wrapping_add(1);
        Some(actor.generation)
    }

    /// Whether a wake-up counts and the actor does not hang; if so, its timer is cleared.
    pub(super) fn wake(&mut self, address: Address, generation: u32) -> bool {
        let actor = &mut self.all[address as usize];
        let counts =
            actor.generation == generation && actor.deadline.is_some() && actor.hung.is_none();
        if counts {
            actor.deadline = None;
        }
        counts
    }

    /// Loads what a frame for the drone will touch.
    pub(super) fn read_ahead(&self) {
        let [radio, routing, ..] = &self.all;
        black_box((radio.is_up, routing.deadline, routing.is_up));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn timers_that_expire_during_a_hang_wake_their_actors_after_it() {
        let (mut actors, due) = (Actors::default(), Timestamp::from_nanos(5));
        let later = Timestamp::from_nanos(9);
        actors.bring_up(Address::Radio);
        let generation = actors.set_timer(Address::Radio, Some(due)).unwrap();
        actors.set_timer(Address::Routing, Some(later));
        let hang = actors.hang(&[Address::Radio]);
        assert!(!actors.wake(Address::Radio, generation), "it hangs");
        let overdue: Vec<_> = actors.resume(hang, due).collect();
        assert_eq!(overdue, [(Address::Radio, generation)]);
        assert!(actors.wake(Address::Radio, generation));
        assert!(!actors.wake(Address::Radio, generation), "once");
    }

    #[test]
    fn a_wake_up_does_not_count_once_its_timer_was_set_again() {
        let mut actors = Actors::default();
        let deadline = Some(Timestamp::from_nanos(5));
        let first = actors.set_timer(Address::Mission, deadline).unwrap();
        assert_eq!(actors.set_timer(Address::Mission, deadline), None);
        actors.set_timer(Address::Mission, None);
        actors.set_timer(Address::Mission, deadline);
        assert!(!actors.wake(Address::Mission, first));
    }
}
