//! A simulated drone's process.

use std::hint::black_box;
use std::time::Duration;

use muster_machines::node::Address;
use muster_machines::time::Timestamp;
use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;

use super::actors::Actors;
use super::checkpoints::CheckpointStore;
use super::clock::Clock;

/// A drone's process, the computer that it runs on, and its random generator.
///
/// Invariant: no actor is up while the process does not run. The incarnation rises whenever the process ends, so that
/// events scheduled for an earlier one are void.
#[derive(Debug)]
pub(super) struct Drone {
    rng: Box<ChaCha8Rng>,
    pub(super) checkpoints: CheckpointStore,
    runs: bool,
    incarnation: u32,
    /// Whether one of its actors could not be kept alive.
    pub(super) given_up: bool,
    pub(super) actors: Actors,
    pub(super) clock: Clock,
    /// When it was last stepped, and the number of its steps at that instant.
    steps: (Timestamp, u64),
}

impl Drone {
    /// A drone whose actors have yet to be built; with a journal in a world in which processes are restarted.
    pub(super) fn new(rng: ChaCha8Rng, has_journal: bool) -> Self {
        Self {
            rng: Box::new(rng),
            checkpoints: CheckpointStore::new(has_journal),
            runs: true,
            incarnation: 0,
            given_up: false,
            actors: Actors::default(),
            clock: Clock::default(),
            steps: (Timestamp::ZERO, 0),
        }
    }

    /// Whether its process runs.
    pub(super) const fn runs(&self) -> bool {
        self.runs
    }

    /// How often its process has ended.
    pub(super) const fn incarnation(&self) -> u32 {
        self.incarnation
    }

    /// Whether it can follow commands: its process runs and does not hang as a whole.
    pub(super) fn is_sound(&self) -> bool {
        self.runs && !self.given_up && !self.actors.are_hung()
    }

    /// Counts a step; returns the number of its steps at this instant, this one included.
    pub(super) fn count_step(&mut self, now: Timestamp) -> u64 {
        if self.steps.0 != now {
            self.steps = (now, 0);
        }
        self.steps.1 += 1;
        self.steps.1
    }

    /// Ends its process. Only its journal outlives it.
    pub(super) fn end(&mut self) {
        self.actors.take_all_down();
        self.runs = false;
        self.incarnation += 1;
        self.checkpoints.lose_power(&mut *self.rng);
    }

    /// Starts its process.
    pub(super) const fn start(&mut self) {
        self.runs = true;
        self.given_up = false;
    }

    /// Sets a timer, on the drone's clock. Returns the time of the wake-up to schedule and its generation; `None` if there
    /// is none to schedule.
    pub(super) fn set_timer(
        &mut self,
        address: Address,
        deadline: Option<Timestamp>,
    ) -> Option<(Timestamp, u32)> {
        let generation = self.actors.set_timer(address, deadline)?;
        Some((self.clock.when(deadline?), generation))
    }

    /// Draws the seed of the next machine to be built.
    pub(super) fn draw_seed(&mut self) -> u64 {
        self.rng.next_u64()
    }

    /// Draws how long its vehicle takes to come to rest at the end of a leg, up to `most`. `None` if that is zero.
    pub(super) fn draw_settling(&mut self, most: Duration) -> Option<Duration> {
        (most > Duration::ZERO).then(|| self.rng.random_range(Duration::ZERO..=most))
    }

    /// Loads what a frame for it will touch, as
    /// [`NodeMachine::read_ahead`](muster_machines::node::NodeMachine::read_ahead) does.
    pub(super) fn read_ahead(&self) {
        self.actors.read_ahead();
        black_box(self.clock);
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn settling_time_is_drawn_for_each_leg_up_to_the_longest() {
        let mut drone = Drone::new(ChaCha8Rng::seed_from_u64(1), false);
        let most = Duration::from_millis(800);
        let draws: Vec<_> = (0..100)
            .map(|_| drone.draw_settling(most).unwrap())
            .collect();
        assert!(draws.iter().all(|time| *time <= most));
        let above = |time| draws.iter().filter(|draw| **draw > time).count();
        assert!((15..=35).contains(&above(most * 3 / 4)), "{draws:?}");
        assert!((65..=85).contains(&above(most / 4)), "{draws:?}");
    }

    #[test]
    fn no_settling_time_is_drawn_where_the_longest_is_zero() {
        let rng = ChaCha8Rng::seed_from_u64(1);
        let mut drone = Drone::new(rng.clone(), false);
        assert_eq!(drone.draw_settling(Duration::ZERO), None);
        assert_eq!(*drone.rng, rng);
    }
}
