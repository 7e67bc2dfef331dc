use std::cmp::Reverse;
use std::collections::BinaryHeap;

use muster_machines::time::Timestamp;

/// How long a slice of time is, in nanoseconds, as a power of two: about as long as a frame takes, so that little is planned
/// for the slice that has begun.
const SLICE_BITS: u32 = 18;
/// How many slices are kept apart: of the next four seconds, in which a drone speaks again that speaks once a second, and
/// finds out whether it has heard another. What happens later is not put in one yet.
const SLICES: usize = 16_384;

/// What will happen, in the order of time; at one instant, in the order in which it was planned.
///
/// Most of what is planned happens soon, so the next seconds are cut into slices, and what happens in one is put in order
/// when it begins. What is planned stays where it was put until it happens: only its time and place are put in order.
#[derive(Debug)]
pub(crate) struct Heap<T> {
    /// What happens in the slice that has begun, or should have before it, the first at the end.
    begun: Vec<Entry>,
    /// The number of that slice.
    slice: u64,
    /// Whether it has begun since somebody asked.
    is_new: bool,
    /// What happens in each of the slices that follow: the place of what was planned last, or [`NOWHERE`]. That with
    /// number n is at n modulo [`SLICES`].
    slices: Vec<u32>,
    /// A bit for each of them, set where there is anything.
    filled: [u64; SLICES / 64],
    /// What happens after those.
    later: BinaryHeap<Reverse<Entry>>,
    planned: u64,
    places: Vec<Planned<T>>,
    /// Of each of these, what was planned for its slice before it: apart, so that they are not read one after another only to
    /// find the next.
    before: Vec<u32>,
    free: Vec<u32>,
}

/// When something happens, as the how manieth it was planned, and where it was put.
type Entry = (Timestamp, u64, u32);

/// Something that was planned.
#[derive(Debug)]
struct Planned<T> {
    at: Timestamp,
    /// As the how manieth.
    nth: u64,
    /// Nothing once it has happened.
    what: Option<T>,
}

const NOWHERE: u32 = u32::MAX;

const fn slice_of(at: Timestamp) -> u64 {
    at.as_nanos() >> SLICE_BITS
}

impl<T> Heap<T> {
    pub(crate) fn new() -> Self {
        Self {
            begun: Vec::new(),
            slice: 0,
            is_new: false,
            slices: vec![NOWHERE; SLICES],
            filled: [0; SLICES / 64],
            later: BinaryHeap::new(),
            planned: 0,
            places: Vec::new(),
            before: Vec::new(),
            free: Vec::new(),
        }
    }

    pub(crate) fn plan(&mut self, at: Timestamp, what: T) {
        let planned = Planned {
            at,
            nth: self.planned,
            what: Some(what),
        };
        self.planned += 1;
        let place = match self.free.pop() {
            Some(place) => {
                self.places[place as usize] = planned;
                place
            }
            None => {
                self.places.push(planned);
                self.before.push(NOWHERE);
                u32::try_from(self.places.len() - 1).expect("less is planned than memory holds")
            }
        };
        self.enter(place);
    }

    /// Puts what was planned in order.
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

    /// When the first thing happens that is planned.
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
        Some((at, what.expect("each place is in the order once")))
    }

    /// How much is still to happen in the slice that has begun; nothing if somebody has asked since it has.
    pub(crate) fn newly_begun(&mut self) -> usize {
        if std::mem::take(&mut self.is_new) {
            self.begun.len()
        } else {
            0
        }
    }

    /// What is still to happen in the slice that has begun.
    pub(crate) fn begun(&self) -> impl Iterator<Item = &T> {
        let places = self.begun.iter().map(|(.., place)| *place as usize);
        places.filter_map(|place| self.places[place].what.as_ref())
    }

    /// Goes on to the next slice in which anything happens, if anything does at all.
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

    /// The number of the first of the slices that follow in which anything happens.
    fn next_filled(&self) -> Option<u64> {
        let begin = Self::place_of(self.slice + 1);
        let (first_word, first_bit) = (begin / 64, begin % 64);
        let words = self.filled.len();
        // The word in which they begin comes twice: its upper bits first, its lower ones last.
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
    fn what_is_planned_for_one_instant_happens_in_the_order_of_planning() {
        let mut heap = Heap::new();
        for (at, what) in [(2, "c"), (1, "a"), (2, "d"), (1, "b")] {
            heap.plan(Timestamp::from_nanos(at), what);
        }
        let popped: Vec<_> = std::iter::from_fn(|| heap.pop())
            .map(|(_, what)| what)
            .collect();
        assert_eq!(popped, ["a", "b", "c", "d"]);
    }

    proptest! {
        #[test]
        fn whatever_is_planned_meanwhile_happens_in_the_order_of_time(
            // How long after what has just happened, as a power of two, and whether something happens then.
            steps in prop::collection::vec((0..34_u32, any::<u64>(), any::<bool>()), 1..400),
        ) {
            let (mut heap, mut sorted, mut now) = (Heap::new(), std::collections::BTreeSet::new(), 0);
            for (nth, (bits, random, pops)) in steps.into_iter().enumerate() {
                let at = now + (random & ((1 << bits) - 1));
                heap.plan(Timestamp::from_nanos(at), nth);
                sorted.insert((at, nth));
                if pops {
                    let (at, what) = heap.pop().unwrap();
                    now = at.as_nanos();
                    prop_assert_eq!(Some((now, what)), sorted.pop_first());
                }
            }
            let rest = std::iter::from_fn(|| heap.pop()).map(|(at, what)| (at.as_nanos(), what));
            prop_assert!(rest.eq(sorted));
        }
    }
}
