use std::collections::VecDeque;
use std::hint::black_box;
use std::time::Duration;

use muster_machines::node::{Address, Checkpoint, Checkpoints};
use muster_machines::time::Timestamp;
use muster_runtime::journal::Journal;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::Message;
use super::clock::Clock;
use super::disk::Disk;

/// A simulated disk refuses nothing.
const NEVER_FAILS: &str = "a simulated disk never fails";

/// What the world keeps for one drone: its random source, its journal, its timers, which of its actors run.
#[derive(Debug)]
pub(super) struct Drone {
    pub(crate) rng: Box<ChaCha8Rng>,
    pub(crate) checkpoints: Checkpoints,
    /// What outlives its process, in a world in which processes start anew.
    journal: Option<Box<Journal<Disk>>>,
    /// Whether its process runs.
    pub(crate) runs: bool,
    /// How often its process has ended; what was planned for an earlier life does not happen.
    pub(crate) incarnations: u32,
    /// Whether one of its actors could not be kept alive.
    pub(crate) given_up: bool,
    seats: [Seat; 5],
    /// What waits for actors that hang.
    pub(super) backlog: VecDeque<Message>,
    /// How often a hang has begun or ended.
    pub(crate) hangs: u32,
    pub(super) clock: Clock,
    motion: u32,
    /// When it was last stepped, and the number of its steps at that instant.
    steps: (Timestamp, u64),
}

/// What is kept of one of a drone's actors.
#[derive(Debug, Clone, Copy, Default)]
struct Seat {
    /// When its timer goes off.
    deadline: Option<Timestamp>,
    /// Which of the wake-ups planned for that is the one that counts.
    generation: u32,
    /// By which hang it hangs.
    hung: Option<u32>,
    is_up: bool,
    /// How many messages wait to be handed to it.
    waiting: u32,
}

impl Drone {
    /// A drone before its actors are built; with a journal in a world in which processes start anew.
    pub(crate) fn new(rng: ChaCha8Rng, has_journal: bool) -> Self {
        let opened = has_journal.then(|| Journal::open(Disk::default()).expect(NEVER_FAILS));
        let (journal, checkpoints) = opened.unzip();
        Self {
            rng: Box::new(rng),
            checkpoints: checkpoints.unwrap_or_default(),
            journal: journal.map(Box::new),
            runs: true,
            incarnations: 0,
            given_up: false,
            seats: [Seat::default(); 5],
            backlog: VecDeque::new(),
            hangs: 0,
            clock: Clock::default(),
            motion: 0,
            steps: (Timestamp::ZERO, 0),
        }
    }

    /// Counts a step; the number of its steps at this instant, this one included.
    pub(crate) fn count_step(&mut self, now: Timestamp) -> u64 {
        if self.steps.0 != now {
            self.steps = (now, 0);
        }
        self.steps.1 += 1;
        self.steps.1
    }

    /// Reads what a frame for it will touch, as [`Cell::read_ahead`](muster_machines::node::Cell::read_ahead) does.
    pub(super) fn read_ahead(&self) {
        let [radio, routing, ..] = &self.seats;
        black_box((radio.is_up, routing.deadline, routing.is_up, self.clock));
    }

    pub(crate) const fn is_up(&self, address: Address) -> bool {
        self.seats[address as usize].is_up
    }

    pub(crate) const fn is_hung(&self, address: Address) -> bool {
        self.seats[address as usize].hung.is_some()
    }

    /// Whether a hang still holds some of its actors.
    pub(crate) fn is_held_by(&self, hang: u32) -> bool {
        self.seats.iter().any(|seat| seat.hung == Some(hang))
    }

    /// Whether it can do what it is told: its process runs and does not hang as a whole.
    pub(crate) fn is_sound(&self) -> bool {
        let hangs = Address::ALL.iter().all(|it| self.is_hung(*it));
        self.runs && !self.given_up && !hangs
    }

    /// Keeps what a machine is built anew from.
    pub(crate) fn keep(&mut self, checkpoint: Checkpoint) {
        let Some(journal) = &mut self.journal else {
            self.checkpoints.keep(checkpoint);
            return;
        };
        let must_last = self.checkpoints.keep(checkpoint.clone());
        journal
            .add(&checkpoint, &self.checkpoints)
            .expect(NEVER_FAILS);
        if must_last {
            journal.sync().expect(NEVER_FAILS);
        }
    }

    /// Its process ends, and the power with it: nothing of it is left but what its journal holds.
    pub(crate) fn end(&mut self) {
        for address in Address::ALL {
            self.take_down(address);
        }
        self.runs = false;
        self.incarnations += 1;
        self.hangs += 1;
        self.backlog.clear();
        if let Some(journal) = self.journal.take() {
            let mut disk = journal.into_storage();
            disk.lose_power(&mut *self.rng);
            let (journal, checkpoints) = Journal::open(disk).expect(NEVER_FAILS);
            self.journal = Some(Box::new(journal));
            self.checkpoints = checkpoints;
        }
    }

    /// Its process is there again.
    pub(crate) const fn begin(&mut self) {
        self.runs = true;
        self.given_up = false;
    }

    /// Some of its actors do nothing any more, until they go on; the number of this hang.
    pub(crate) fn hang(&mut self, addresses: &[Address]) -> u32 {
        self.hangs += 1;
        for address in addresses {
            self.seats[*address as usize].hung = Some(self.hangs);
        }
        self.hangs
    }

    /// Whom a hang holds goes on.
    pub(crate) fn go_on(&mut self, hang: u32) {
        self.hangs += 1;
        for seat in &mut self.seats {
            seat.hung = seat.hung.filter(|it| *it != hang);
        }
    }

    /// One more message waits for an actor; how many do.
    pub(crate) const fn queue(&mut self, address: Address) -> usize {
        let seat = &mut self.seats[address as usize];
        seat.waiting += 1;
        seat.waiting as usize
    }

    /// One less does.
    pub(crate) const fn unqueue(&mut self, address: Address) {
        self.seats[address as usize].waiting -= 1;
    }

    /// None does.
    pub(crate) const fn clear_queue(&mut self, address: Address) {
        self.seats[address as usize].waiting = 0;
    }

    pub(crate) const fn bring_up(&mut self, address: Address) {
        self.seats[address as usize].is_up = true;
    }

    pub(crate) fn take_down(&mut self, address: Address) {
        let seat = &mut self.seats[address as usize];
        (seat.is_up, seat.hung) = (false, None);
        self.backlog.retain(|it| it.envelope.address() != address);
        self.set_timer(address, None);
    }

    /// When an actor wants to be woken, by the drone's own clock.
    pub(crate) const fn deadline(&self, address: Address) -> Option<Timestamp> {
        self.seats[address as usize].deadline
    }

    /// The timer of an actor that hung at its time, by the drone's own clock.
    pub(crate) fn overdue(&self, address: Address, now: Timestamp) -> Option<u32> {
        let seat = self.seats[address as usize];
        seat.deadline
            .filter(|deadline| *deadline <= now)
            .map(|_| seat.generation)
    }

    /// Whether a wake-up still counts and the actor does not hang; if so the timer is spent.
    pub(crate) fn wake(&mut self, address: Address, generation: u32) -> bool {
        let seat = &mut self.seats[address as usize];
        let counts =
            seat.generation == generation && seat.deadline.is_some() && seat.hung.is_none();
        if counts {
            seat.deadline = None;
        }
        counts
    }

    /// Sets a timer, by the drone's own clock; the generation of the wake-up to plan, unless that is planned already.
    pub(crate) fn set_timer(
        &mut self,
        address: Address,
        deadline: Option<Timestamp>,
    ) -> Option<u32> {
        let seat = &mut self.seats[address as usize];
        if seat.deadline == deadline {
            return None;
        }
        seat.deadline = deadline;
        seat.generation = seat.generation.wrapping_add(1);
        Some(seat.generation)
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
    fn nothing_is_drawn_for_a_vehicle_that_settles_at_once() {
        let rng = ChaCha8Rng::seed_from_u64(1);
        let mut drone = Drone::new(rng.clone(), false);
        assert_eq!(drone.draw_settling(Duration::ZERO), None);
        assert_eq!(*drone.rng, rng);
    }
}
