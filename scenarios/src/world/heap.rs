use std::cmp::Reverse;
use std::collections::BinaryHeap;

use muster_machines::time::Timestamp;

/// What will happen, in the order of time; at one instant, in the order in which it was planned.
///
/// What is planned stays where it was put until it happens: only its time and place are kept in order.
#[derive(Debug)]
pub(crate) struct Heap<T> {
    order: BinaryHeap<Reverse<(Timestamp, u64, u32)>>,
    planned: u64,
    places: Vec<Option<T>>,
    free: Vec<u32>,
}

impl<T> Heap<T> {
    pub(crate) const fn new() -> Self {
        Self {
            order: BinaryHeap::new(),
            planned: 0,
            places: Vec::new(),
            free: Vec::new(),
        }
    }

    pub(crate) fn plan(&mut self, at: Timestamp, what: T) {
        let place = match self.free.pop() {
            Some(place) => {
                self.places[place as usize] = Some(what);
                place
            }
            None => {
                self.places.push(Some(what));
                u32::try_from(self.places.len() - 1).expect("less is planned than memory holds")
            }
        };
        self.order.push(Reverse((at, self.planned, place)));
        self.planned += 1;
    }

    pub(crate) fn pop(&mut self) -> Option<(Timestamp, T)> {
        let Reverse((at, _, place)) = self.order.pop()?;
        self.free.push(place);
        let what = self.places[place as usize].take();
        Some((at, what.expect("each place is in the order once")))
    }
}

#[cfg(test)]
mod tests {
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
}
