//! The queue of scheduled events.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use muster_machines::time::Timestamp;

/// Length of a slice in nanoseconds, as a power of two: about the duration of a frame, so that few events are scheduled for
/// the current slice.
const SLICE_BITS: u32 = 18;
/// Number of slices: the next four seconds, which cover the next heartbeat of a drone and its timeouts. Later events are put
/// into a slice only then.
const SLICES: usize = 16_384;

/// Events in the order of time; those of one instant in the order in which they were pushed.
///
/// Most events happen soon. So the next seconds are cut into slices, and the events of a slice are sorted when it begins. An
/// event stays in its place until it happens; only its time and place are sorted.
///
/// Invariant: each event is in exactly one of `begun`, `slices` and `later`, and `filled` has a bit for each slice that holds
/// any.
#[derive(Debug)]
pub(crate) struct EventQueue<T> {
    /// Events of the current slice or before it, sorted, the first at the end.
    begun: Vec<Entry>,
    /// The number of the current slice.
    slice: u64,
    /// Whether it has begun since [`EventQueue::newly_begun`] was called.
    is_new: bool,
    /// For each of the slices that follow, the place of the event pushed last, or [`NOWHERE`]. Slice n is at n modulo
    /// [`SLICES`].
    slices: Vec<u32>,
    /// A bit for each of them, set if it holds any event.
    filled: [u64; SLICES / 64],
    /// Events after those slices.
    later: BinaryHeap<Reverse<Entry>>,
    pushed: u64,
    places: Vec<Planned<T>>,
    /// For each place, the event pushed for its slice before it. Apart from the events, which are not read to find the next.
    before: Vec<u32>,
    free: Vec<u32>,
}

/// The time of an event, its number in the order of pushing, and its place.
type Entry = (Timestamp, u64, u32);

/// An event in its place.
#[derive(Debug)]
struct Planned<T> {
    at: Timestamp,
    /// Its number in the order of pushing.
    nth: u64,
    /// `None` once it has happened.
    what: Option<T>,
}

const NOWHERE: u32 = u32::MAX;

const fn slice_of(at: Timestamp) -> u64 {
    at.as_nanos() >> SLICE_BITS
}

impl<T> EventQueue<T> {
    pub(crate) fn new() -> Self {
        Self {
            begun: Vec::new(),
            slice: 0,
            is_new: false,
            slices: vec![NOWHERE; SLICES],
            filled: [0; SLICES / 64],
            later: BinaryHeap::new(),
            pushed: 0,
            places: Vec::new(),
            before: Vec::new(),
            free: Vec::new(),
        }
    }

    pub(crate) fn push(&mut self, at: Timestamp, what: T) {
        let planned = Planned {
            at,
            nth: self.pushed,
            what: Some(what),
        };
        self.pushed += 1;
        let place = match self.free.pop() {
            Some(place) => {
                self.places[place as usize] = planned;
                place
            }
            None => {
                self.places.push(planned);
                self.before.push(NOWHERE);
                u32::try_from(self.places.len() - 1)
                    .expect("fewer events are scheduled than memory holds")
            }
        };
        self.enter(place);
    }

    /// Puts an event into its slice.
    fn enter(&mut self, place: u32) {
        let planned = &self.places[place as usize];
        let entry = (planned.at, planned.nth, place);
        let slice = slice_of(planned.at);
        match slice.saturating_sub(self.slice) {
            0 => {
                let behind = self.begun.partition_point(|other| *other > entry);
                self.begun.insert(behind, entry);
            }
            ahead if ahead < SLICES as u64 => {
                let at = Self::place_of(slice);
                self.before[place as usize] = std::mem::replace(&mut self.slices[at], place);
                self.filled[at / 64] |= 1 << (at % 64);
            }
            _ => self.later.push(Reverse(entry)),
        }
    }

    #[expect(
        clippy::cast_possible_truncation,
        reason = "the remainder is a small number"
    )]
    const fn place_of(slice: u64) -> usize {
        (slice % SLICES as u64) as usize
    }

    /// The time of the first event.
    pub(crate) fn next_at(&mut self) -> Option<Timestamp> {
        while self.begun.is_empty() {
            self.begin_slice()?;
        }
        self.begun.last().map(|(at, ..)| *at)
    }

    pub(crate) fn pop(&mut self) -> Option<(Timestamp, T)> {
        while self.begun.is_empty() {
            self.begin_slice()?;
        }
        let (at, _, place) = self.begun.pop()?;
        self.free.push(place);
        let what = self.places[place as usize].what.take();
        Some((at, what.expect("each place is sorted once")))
    }

    /// How many events are still to come in the current slice; 0 if called before in this slice.
    pub(crate) fn newly_begun(&mut self) -> usize {
        if std::mem::take(&mut self.is_new) {
            self.begun.len()
        } else {
            0
        }
    }

    /// The events still to come in the current slice.
    pub(crate) fn begun(&self) -> impl Iterator<Item = &T> {
        let places = self.begun.iter().map(|(.., place)| *place as usize);
        places.filter_map(|place| self.places[place].what.as_ref())
    }

    /// Begins the next slice that holds an event. `None` if there is none.
    fn begin_slice(&mut self) -> Option<()> {
        let first_later = self.later.peek().map(|Reverse((at, ..))| slice_of(*at));
        self.slice = self.next_filled().into_iter().chain(first_later).min()?;
        let at = Self::place_of(self.slice);
        let mut place = std::mem::replace(&mut self.slices[at], NOWHERE);
        self.filled[at / 64] &= !(1 << (at % 64));
        while place != NOWHERE {
            let planned = &self.places[place as usize];
            self.begun.push((planned.at, planned.nth, place));
            place = self.before[place as usize];
        }
        while let Some(Reverse(entry)) = self.later.peek()
            && slice_of(entry.0) == self.slice
        {
            self.begun.push(*entry);
            self.later.pop();
        }
        self.is_new = true;
        self.begun.sort_unstable_by(|a, b| b.cmp(a));
        Some(())
    }

    /// The number of the first slice that holds an event.
    fn next_filled(&self) -> Option<u64> {
        let begin = Self::place_of(self.slice + 1);
        let (first_word, first_bit) = (begin / 64, begin % 64);
        let words = self.filled.len();
        // The first word comes twice: its upper bits first, its lower ones last.
        let place = (0..=words).find_map(|nth| {
            let word = (first_word + nth) % words;
            let mask = match nth {
                0 => u64::MAX << first_bit,
                nth if nth == words => !(u64::MAX << first_bit),
                _ => u64::MAX,
            };
            let filled = self.filled[word] & mask;
            (filled != 0).then(|| word * 64 + filled.trailing_zeros() as usize)
        })?;
        let ahead = (place + SLICES - begin) % SLICES;
        Some(self.slice + 1 + ahead as u64)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn events_of_one_instant_happen_in_the_order_of_pushing() {
        let mut queue = EventQueue::new();
        for (at, what) in [(2, "c"), (1, "a"), (2, "d"), (1, "b")] {
            queue.push(Timestamp::from_nanos(at), what);
        }
        let popped: Vec<_> = std::iter::from_fn(|| queue.pop())
            .map(|(_, what)| what)
            .collect();
        assert_eq!(popped, ["a", "b", "c", "d"]);
    }

    proptest! {
        #[test]
        fn events_pushed_meanwhile_happen_in_the_order_of_time(
            // The delay after the last event, as a power of two, and whether the next event is taken.
            steps in prop::collection::vec((0..34_u32, any::<u64>(), any::<bool>()), 1..400),
        ) {
            let (mut queue, mut sorted, mut now) = (EventQueue::new(), std::collections::BTreeSet::new(), 0);
            for (nth, (bits, random, pops)) in steps.into_iter().enumerate() {
                let at = now + (random & ((1 << bits) - 1));
                queue.push(Timestamp::from_nanos(at), nth);
                sorted.insert((at, nth));
                if pops {
                    let (at, what) = queue.pop().unwrap();
                    now = at.as_nanos();
                    prop_assert_eq!(Some((now, what)), sorted.pop_first());
                }
            }
            let rest = std::iter::from_fn(|| queue.pop()).map(|(at, what)| (at.as_nanos(), what));
            prop_assert!(rest.eq(sorted));
        }
    }
}
