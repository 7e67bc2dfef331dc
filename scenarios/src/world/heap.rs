use std::cmp::Ordering;
use std::collections::BinaryHeap;

use muster_machines::time::Timestamp;

/// What will happen, in the order of time; at one instant, in the order in which it was planned.
#[derive(Debug)]
pub(crate) struct Heap<T> {
    entries: BinaryHeap<Entry<T>>,
    planned: u64,
}

#[derive(Debug)]
struct Entry<T> {
    at: Timestamp,
    sequence: u64,
    what: T,
}

impl<T> Heap<T> {
    pub(crate) const fn new() -> Self {
        Self {
            entries: BinaryHeap::new(),
            planned: 0,
        }
    }

    pub(crate) fn plan(&mut self, at: Timestamp, what: T) {
        let sequence = self.planned;
        self.planned += 1;
        self.entries.push(Entry { at, sequence, what });
    }

    pub(crate) fn pop(&mut self) -> Option<(Timestamp, T)> {
        self.entries.pop().map(|entry| (entry.at, entry.what))
    }
}

impl<T> PartialEq for Entry<T> {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl<T> Eq for Entry<T> {}

impl<T> PartialOrd for Entry<T> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl<T> Ord for Entry<T> {
    /// The earliest is the greatest, because the heap pops the greatest.
    fn cmp(&self, other: &Self) -> Ordering {
        (other.at, other.sequence).cmp(&(self.at, self.sequence))
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
