use std::time::Duration;

use muster_machines::cell::{Address, Checkpoints};
use muster_machines::time::Timestamp;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// What the world keeps for one drone: its random source, its journal, its timers, which of its actors run.
#[derive(Debug)]
pub(crate) struct Drone {
    pub(crate) rng: ChaCha8Rng,
    pub(crate) checkpoints: Checkpoints,
    /// Whether one of its actors could not be kept alive.
    pub(crate) given_up: bool,
    timers: [Timer; 5],
    up: [bool; 5],
    motion: u32,
}

#[derive(Debug, Clone, Copy, Default)]
struct Timer {
    deadline: Option<Timestamp>,
    /// Which of the planned wake-ups is the one that counts.
    generation: u32,
}

impl Drone {
    pub(crate) fn new(rng: ChaCha8Rng) -> Self {
        Self {
            rng,
            checkpoints: Checkpoints::default(),
            given_up: false,
            timers: [Timer::default(); 5],
            up: [false; 5],
            motion: 0,
        }
    }

    pub(crate) const fn is_up(&self, address: Address) -> bool {
        self.up[address as usize]
    }

    pub(crate) const fn bring_up(&mut self, address: Address) {
        self.up[address as usize] = true;
    }

    pub(crate) fn take_down(&mut self, address: Address) {
        self.up[address as usize] = false;
        self.set_timer(address, None);
    }

    /// Whether a wake-up still counts; if so the timer is spent.
    pub(crate) fn wake(&mut self, address: Address, generation: u32) -> bool {
        let timer = &mut self.timers[address as usize];
        let counts = timer.generation == generation && timer.deadline.is_some();
        if counts {
            timer.deadline = None;
        }
        counts
    }

    /// Sets a timer; the generation of the wake-up to plan, unless that is planned already.
    pub(crate) fn set_timer(
        &mut self,
        address: Address,
        deadline: Option<Timestamp>,
    ) -> Option<u32> {
        let timer = &mut self.timers[address as usize];
        if timer.deadline == deadline {
            return None;
        }
        timer.deadline = deadline;
        timer.generation = timer.generation.wrapping_add(1);
        Some(timer.generation)
    }

    /// How long its vehicle takes to come to rest at the end of a leg, where it takes `most` at most.
    pub(crate) fn draw_settling(&mut self, most: Duration) -> Option<Duration> {
        (most > Duration::ZERO).then(|| self.rng.random_range(Duration::ZERO..=most))
    }

    /// The number of the motion that the vehicle has just begun.
    pub(crate) const fn next_motion(&mut self) -> u32 {
        self.motion = self.motion.wrapping_add(1);
        self.motion
    }

    pub(crate) const fn is_current_motion(&self, generation: u32) -> bool {
        self.motion == generation
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn settling_is_drawn_anew_for_each_leg_and_is_no_longer_than_the_longest() {
        let mut drone = Drone::new(ChaCha8Rng::seed_from_u64(1));
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
    fn nothing_is_drawn_for_a_vehicle_that_settles_at_once() {
        let rng = ChaCha8Rng::seed_from_u64(1);
        let mut drone = Drone::new(rng.clone());
        assert_eq!(drone.draw_settling(Duration::ZERO), None);
        assert_eq!(drone.rng, rng);
    }
}
