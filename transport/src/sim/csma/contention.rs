use std::time::Duration;

use muster_machines::time::Timestamp;
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::timing::{DETECTION, DIFS, SLOT, WINDOW_MAX, WINDOW_MIN};

/// Channel access of one radio: when it may start to send.
///
/// This is the distributed coordination function (DCF) of 802.11. A radio sends once the medium has been idle for DIFS and
/// the slots of its back-off. Slots count down while the medium is idle and freeze while it is busy. A back-off is drawn
/// after each frame, even with an empty queue. Once it has elapsed, the next frame waits for DIFS only, also if another
/// radio starts meanwhile. That is the behaviour of ns-3; the standard draws another back-off. (With 50 radios in range of
/// each other and 100 frames a second each, it delivers 63 % instead of 62 %.)
/// **Invariant:** a start is set only while a frame is requested, and moves only while it can still be cancelled.
#[derive(Debug)]
pub(super) struct Contention {
    is_requested: bool,
    /// The back-off is drawn from 0 to this.
    window: u32,
    /// Remaining slots of the back-off after `idle_from`; `None` once it has elapsed.
    slots: Option<u32>,
    /// When the medium became idle, moved forward by the slots already counted; `None` while it is busy. In the future
    /// during a reservation.
    idle_from: Option<Timestamp>,
    reserved_until: Timestamp,
    start: Option<Timestamp>,
}

impl Contention {
    pub(super) const fn new() -> Self {
        Self {
            is_requested: false,
            window: WINDOW_MIN,
            slots: None,
            idle_from: Some(Timestamp::ZERO),
            reserved_until: Timestamp::ZERO,
            start: None,
        }
    }

    /// The planned start, if any.
    pub(super) const fn start(&self) -> Option<Timestamp> {
        self.start
    }

    /// Whether access is requested and not granted yet.
    pub(super) const fn is_requested(&self) -> bool {
        self.is_requested
    }

    /// Requests access for a frame.
    pub(super) fn request(&mut self, now: Timestamp, rng: &mut ChaCha8Rng) {
        self.is_requested = true;
        self.count_slots(now);
        match (self.idle_from, self.slots) {
            (Some(idle_from), None) => self.start = Some(idle_from.max(now) + DIFS),
            (Some(idle_from), Some(slots)) => self.start = Some(idle_from + DIFS + SLOT * slots),
            (None, None) => self.draw(rng),
            (None, Some(_)) => {}
        }
    }

    /// The medium becomes busy, perhaps by this radio. A start within the detection time is not cancelled.
    pub(super) fn busy(&mut self, now: Timestamp) {
        if self.idle_from.is_none() {
            return;
        }
        if self.start.is_none_or(|start| start >= now + DETECTION) {
            self.count_slots(now);
            self.start = None;
        }
        self.idle_from = None;
    }

    /// The medium becomes idle.
    pub(super) fn idle(&mut self, now: Timestamp) {
        let idle_from = now.max(self.reserved_until);
        self.idle_from = Some(idle_from);
        if self.is_requested {
            self.start = Some(idle_from + DIFS + SLOT * self.slots.unwrap_or(0));
        }
    }

    /// Reserves the medium for another radio until `until` (virtual carrier sense).
    pub(super) fn reserve(&mut self, now: Timestamp, until: Timestamp) {
        self.reserved_until = self.reserved_until.max(until);
        if self.idle_from.is_some() {
            self.idle(now);
        }
    }

    /// Grants access if now is the planned start; the request is then fulfilled.
    pub(super) fn try_start(&mut self, now: Timestamp) -> bool {
        let is_due = self.start == Some(now);
        if is_due {
            self.start = None;
            self.is_requested = false;
        }
        is_due
    }

    /// A frame is finished, delivered or not: resets the window and draws a back-off.
    pub(super) fn done(&mut self, now: Timestamp, rng: &mut ChaCha8Rng) {
        self.window = WINDOW_MIN;
        self.back_off(now, rng);
    }

    /// A frame must be retried: doubles the window and draws a back-off.
    pub(super) fn failed(&mut self, now: Timestamp, rng: &mut ChaCha8Rng) {
        self.window = (2 * self.window + 1).min(WINDOW_MAX);
        self.back_off(now, rng);
    }

    fn back_off(&mut self, now: Timestamp, rng: &mut ChaCha8Rng) {
        self.draw(rng);
        self.idle_from = self.idle_from.map(|idle_from| idle_from.max(now));
    }

    fn draw(&mut self, rng: &mut ChaCha8Rng) {
        // The window is a power of two minus one.
        self.slots = Some(rng.next_u32() & self.window);
    }

    /// Counts down the slots that have elapsed by now.
    fn count_slots(&mut self, now: Timestamp) {
        let (Some(idle_from), Some(slots)) = (self.idle_from, self.slots) else {
            return;
        };
        if now >= idle_from + DIFS + SLOT * slots {
            self.slots = None;
        } else {
            let elapsed = whole_slots(now.since(idle_from + DIFS));
            self.slots = Some(slots - elapsed);
            self.idle_from = Some(idle_from + SLOT * elapsed);
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
    fn frame_on_an_idle_medium_waits_for_difs() {
        let mut contention = Contention::new();
        contention.request(at(1_000), &mut rng());
        assert_eq!(contention.start(), Some(at(1_034)));
        assert!(!contention.try_start(at(1_033)));
        assert!(contention.try_start(at(1_034)));
        assert_eq!(contention.start(), None);
    }

    #[test]
    fn back_off_freezes_while_the_medium_is_busy() {
        let mut contention = with_slots(5);
        contention.request(at(0), &mut rng());
        assert_eq!(contention.start(), Some(at(34 + 45)));
        // Two slots and a part of the third have elapsed.
        contention.busy(at(34 + 20));
        assert_eq!(contention.start(), None);
        contention.idle(at(500));
        assert_eq!(contention.start(), Some(at(500 + 34 + 27)));
    }

    #[test]
    fn start_within_the_detection_time_is_not_cancelled() {
        let mut contention = with_slots(1);
        contention.request(at(0), &mut rng());
        contention.busy(at(40));
        assert!(contention.try_start(at(43)));
    }

    #[test]
    fn back_off_elapses_without_a_frame() {
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
    fn reserved_medium_is_not_idle() {
        let mut contention = with_slots(2);
        contention.busy(at(10));
        contention.request(at(20), &mut rng());
        contention.idle(at(100));
        contention.reserve(at(100), at(160));
        assert_eq!(contention.start(), Some(at(160 + 34 + 18)));
    }

    proptest! {
        #[test]
        fn no_start_before_the_medium_was_idle_for_difs(
            periods in prop::collection::vec((50_u64..400, 1_u64..300), 1..20), request_at in 0_u64..3_000, seed: u64,
        ) {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let mut contention = Contention::new();
            let (mut now, mut is_requested) = (0, false);
            for (busy, idle) in periods {
                contention.busy(at(now));
                // A start that could not be cancelled happens now.
                if let Some(start) = contention.start() {
                    prop_assert!(start < at(now) + DETECTION);
                    contention.try_start(start);
                }
                now += busy;
                contention.idle(at(now));
                if !is_requested && request_at <= now {
                    is_requested = true;
                    contention.request(at(now), &mut rng);
                }
                if let Some(start) = contention.start() {
                    prop_assert!(start >= at(now) + DIFS);
                    prop_assert!(start <= at(now) + DIFS + SLOT * WINDOW_MIN);
                    if start <= at(now + idle) {
                        contention.try_start(start);
                    }
                }
                now += idle;
            }
        }

        #[test]
        fn window_doubles_with_each_failure_up_to_its_maximum(failures in 0_u32..12, seed: u64) {
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
