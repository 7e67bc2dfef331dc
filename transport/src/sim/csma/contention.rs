use std::time::Duration;

use muster_machines::time::Timestamp;
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::timing::{DETECTION, DIFS, SLOT, WINDOW_MAX, WINDOW_MIN};

/// One radio's turn: when it may begin to send, given when its medium is busy and when it is idle.
///
/// The distributed coordination function of 802.11. A radio sends once the medium has been idle for DIFS and for the
/// slots of its back-off; slots count while the medium is idle and stand still while it is busy. After each frame a
/// back-off is drawn, whether another frame waits or not; when that has passed, the next frame has to wait for DIFS
/// only, and if somebody else begins meanwhile, for DIFS after them: as in ns-3, where the standard has a back-off
/// drawn. (Of 50 radios in earshot of each other with 100 frames a second each, that delivers 63 % and not 62 %.)
/// **Invariant:** an instant to start is set only while a frame is wanted, and moves only while it is far
/// enough ahead to be called off.
#[derive(Debug)]
pub(super) struct Contention {
    wants: bool,
    /// The back-off is drawn from 0 to this.
    window: u32,
    /// The slots that are left of the back-off since `idle_from`; nothing once it has passed.
    slots: Option<u32>,
    /// Since when the medium has been idle, or has been after the slots already taken off; nothing while it is busy.
    /// Later than now if somebody has reserved it.
    idle_from: Option<Timestamp>,
    reserved_until: Timestamp,
    start: Option<Timestamp>,
}

impl Contention {
    pub(super) const fn new() -> Self {
        Self {
            wants: false,
            window: WINDOW_MIN,
            slots: None,
            idle_from: Some(Timestamp::ZERO),
            reserved_until: Timestamp::ZERO,
            start: None,
        }
    }

    /// When to send, as far as is known.
    pub(super) const fn start(&self) -> Option<Timestamp> {
        self.start
    }

    /// Whether a turn has been asked for that did not come yet.
    pub(super) const fn is_wanted(&self) -> bool {
        self.wants
    }

    /// A frame is there to be sent.
    pub(super) fn request(&mut self, now: Timestamp, rng: &mut ChaCha8Rng) {
        self.wants = true;
        self.settle(now);
        match (self.idle_from, self.slots) {
            (Some(idle_from), None) => self.start = Some(idle_from.max(now) + DIFS),
            (Some(idle_from), Some(slots)) => self.start = Some(idle_from + DIFS + SLOT * slots),
            (None, None) => self.draw(rng),
            (None, Some(_)) => {}
        }
    }

    /// Somebody began to send, perhaps this radio. A start within the time that it takes to notice stands.
    pub(super) fn busy(&mut self, now: Timestamp) {
        if self.idle_from.is_none() {
            return;
        }
        if self.start.is_none_or(|start| start >= now + DETECTION) {
            self.settle(now);
            self.start = None;
        }
        self.idle_from = None;
    }

    /// Nobody sends any more.
    pub(super) fn idle(&mut self, now: Timestamp) {
        let idle_from = now.max(self.reserved_until);
        self.idle_from = Some(idle_from);
        if self.wants {
            self.start = Some(idle_from + DIFS + SLOT * self.slots.unwrap_or(0));
        }
    }

    /// The medium is kept for somebody else until `until`, even if nothing is heard.
    pub(super) fn reserve(&mut self, now: Timestamp, until: Timestamp) {
        self.reserved_until = self.reserved_until.max(until);
        if self.idle_from.is_some() {
            self.idle(now);
        }
    }

    /// Whether now is the time to send; if so the turn is spent.
    pub(super) fn take_turn(&mut self, now: Timestamp) -> bool {
        let is_due = self.start == Some(now);
        if is_due {
            self.start = None;
            self.wants = false;
        }
        is_due
    }

    /// A frame is done with, delivered or not: the next back-off is drawn from the first window.
    pub(super) fn done(&mut self, now: Timestamp, rng: &mut ChaCha8Rng) {
        self.window = WINDOW_MIN;
        self.back_off(now, rng);
    }

    /// A frame has to be sent again: the next back-off is drawn from a window twice as wide.
    pub(super) fn failed(&mut self, now: Timestamp, rng: &mut ChaCha8Rng) {
        self.window = (2 * self.window + 1).min(WINDOW_MAX);
        self.back_off(now, rng);
    }

    fn back_off(&mut self, now: Timestamp, rng: &mut ChaCha8Rng) {
        self.draw(rng);
        self.idle_from = self.idle_from.map(|idle_from| idle_from.max(now));
    }

    fn draw(&mut self, rng: &mut ChaCha8Rng) {
        // A window is a power of two, less one.
        self.slots = Some(rng.next_u32() & self.window);
    }

    /// Takes off the slots that have passed.
    fn settle(&mut self, now: Timestamp) {
        let (Some(idle_from), Some(slots)) = (self.idle_from, self.slots) else {
            return;
        };
        if now >= idle_from + DIFS + SLOT * slots {
            self.slots = None;
        } else {
            let passed = whole_slots(now.since(idle_from + DIFS));
            self.slots = Some(slots - passed);
            self.idle_from = Some(idle_from + SLOT * passed);
        }
    }
}

fn whole_slots(span: Duration) -> u32 {
    u32::try_from(span.as_nanos() / SLOT.as_nanos()).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use rand::SeedableRng;

    use super::*;

    fn at(micros: u64) -> Timestamp {
        Timestamp::from_nanos(micros * 1_000)
    }

    fn rng() -> ChaCha8Rng {
        ChaCha8Rng::seed_from_u64(1)
    }

    fn with_slots(slots: u32) -> Contention {
        Contention {
            slots: Some(slots),
            ..Contention::new()
        }
    }

    #[test]
    fn on_an_idle_medium_a_frame_waits_for_difs() {
        let mut contention = Contention::new();
        contention.request(at(1_000), &mut rng());
        assert_eq!(contention.start(), Some(at(1_034)));
        assert!(!contention.take_turn(at(1_033)));
        assert!(contention.take_turn(at(1_034)));
        assert_eq!(contention.start(), None);
    }

    #[test]
    fn the_slots_of_a_back_off_stand_still_while_the_medium_is_busy() {
        let mut contention = with_slots(5);
        contention.request(at(0), &mut rng());
        assert_eq!(contention.start(), Some(at(34 + 45)));
        // Two slots and a part of the third have passed.
        contention.busy(at(34 + 20));
        assert_eq!(contention.start(), None);
        contention.idle(at(500));
        assert_eq!(contention.start(), Some(at(500 + 34 + 27)));
    }

    #[test]
    fn a_start_too_near_to_be_called_off_stands() {
        let mut contention = with_slots(1);
        contention.request(at(0), &mut rng());
        contention.busy(at(40));
        assert!(contention.take_turn(at(43)));
    }

    #[test]
    fn a_back_off_passes_without_a_frame() {
        let mut contention = with_slots(5);
        contention.request(at(34 + 18), &mut rng());
        assert_eq!(
            contention.start(),
            Some(at(34 + 45)),
            "three slots are left"
        );
        let mut contention = with_slots(5);
        contention.request(at(34 + 46), &mut rng());
        assert_eq!(contention.start(), Some(at(34 + 46 + 34)), "none is left");
    }

    #[test]
    fn a_reserved_medium_is_not_idle() {
        let mut contention = with_slots(2);
        contention.busy(at(10));
        contention.request(at(20), &mut rng());
        contention.idle(at(100));
        contention.reserve(at(100), at(160));
        assert_eq!(contention.start(), Some(at(160 + 34 + 18)));
    }

    proptest! {
        #[test]
        fn nobody_starts_before_the_medium_was_idle_for_difs(
            spells in prop::collection::vec((50_u64..400, 1_u64..300), 1..20), asked in 0_u64..3_000, seed: u64,
        ) {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let mut contention = Contention::new();
            let (mut now, mut asked_yet) = (0, false);
            for (busy, idle) in spells {
                contention.busy(at(now));
                // What was too near to be called off goes out now.
                if let Some(start) = contention.start() {
                    prop_assert!(start < at(now) + DETECTION);
                    contention.take_turn(start);
                }
                now += busy;
                contention.idle(at(now));
                if !asked_yet && asked <= now {
                    asked_yet = true;
                    contention.request(at(now), &mut rng);
                }
                if let Some(start) = contention.start() {
                    prop_assert!(start >= at(now) + DIFS);
                    prop_assert!(start <= at(now) + DIFS + SLOT * WINDOW_MIN);
                    if start <= at(now + idle) {
                        contention.take_turn(start);
                    }
                }
                now += idle;
            }
        }

        #[test]
        fn the_window_doubles_with_each_failure_up_to_its_end(failures in 0_u32..12, seed: u64) {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let mut contention = Contention::new();
            for _ in 0..failures {
                contention.failed(at(0), &mut rng);
            }
            prop_assert_eq!(contention.window, ((WINDOW_MIN + 1) << failures.min(6)) - 1);
            prop_assert!(contention.slots.is_none_or(|slots| slots <= contention.window));
            contention.done(at(0), &mut rng);
            prop_assert_eq!(contention.window, WINDOW_MIN);
        }
    }
}
