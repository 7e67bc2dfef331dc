//! The serial line between a drone and its flight controller, and what goes wrong on it.

use std::collections::VecDeque;
use std::time::Duration;

use muster_machines::time::Timestamp;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Bytes on their way in one direction: 5.7 s at 115,200 baud. Further ones are lost.
const WAITING_MAX: usize = 65_536;

/// A disturbance that lasts until a time. The last one of a kind counts.
#[derive(Debug, Clone, Copy, Default)]
struct Lasting<T> {
    value: T,
    until: Timestamp,
}

impl<T: Copy + Default> Lasting<T> {
    fn at(self, now: Timestamp) -> T {
        if now < self.until {
            self.value
        } else {
            T::default()
        }
    }
}

/// Bytes on their way in one direction, by their arrival.
#[derive(Debug, Default)]
struct Direction {
    waiting: VecDeque<(Timestamp, Vec<u8>)>,
    bytes: usize,
}

/// A line: it may lose, alter or delay bytes, both ways alike. Bytes never overtake each other.
#[derive(Debug)]
pub struct Line {
    rng: ChaCha8Rng,
    lost: Lasting<f64>,
    corrupted: Lasting<f64>,
    delay: Lasting<Duration>,
    to_controller: Direction,
    to_companion: Direction,
}

impl Line {
    /// A line without faults. `seed` draws which bytes a fault meets.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self {
            rng: ChaCha8Rng::seed_from_u64(seed),
            lost: Lasting::default(),
            corrupted: Lasting::default(),
            delay: Lasting::default(),
            to_controller: Direction::default(),
            to_companion: Direction::default(),
        }
    }

    /// Loses this share of the bytes, 0 to 1.
    pub const fn lose(&mut self, share: f64, until: Timestamp) {
        self.lost = Lasting {
            value: share,
            until,
        };
    }

    /// Alters this share of the bytes, 0 to 1.
    pub const fn corrupt(&mut self, share: f64, until: Timestamp) {
        self.corrupted = Lasting {
            value: share,
            until,
        };
    }

    /// Delays all bytes.
    pub const fn delay(&mut self, by: Duration, until: Timestamp) {
        self.delay = Lasting { value: by, until };
    }

    /// The companion writes bytes, or none. Returns those that reach the controller now.
    pub fn carry_out(&mut self, now: Timestamp, bytes: Vec<u8>) -> Vec<u8> {
        let bytes = self.distort(now, bytes);
        self.to_controller.pass(now, self.delay.at(now), bytes)
    }

    /// The controller writes bytes, or none. Returns those that reach the companion now.
    pub fn carry_in(&mut self, now: Timestamp, bytes: Vec<u8>) -> Vec<u8> {
        let bytes = self.distort(now, bytes);
        self.to_companion.pass(now, self.delay.at(now), bytes)
    }

    /// When the next delayed bytes arrive; `None` if none are on their way.
    #[must_use]
    pub fn next_arrival(&self) -> Option<Timestamp> {
        let directions = [&self.to_controller, &self.to_companion];
        let first = directions.map(|it| it.waiting.front().map(|(at, _)| *at));
        first.into_iter().flatten().min()
    }

    fn distort(&mut self, now: Timestamp, mut bytes: Vec<u8>) -> Vec<u8> {
        let (lost, corrupted) = (self.lost.at(now), self.corrupted.at(now));
        let rng = &mut self.rng;
        if lost > 0.0 {
            bytes.retain(|_| rng.random::<f64>() >= lost);
        }
        if corrupted > 0.0 {
            for byte in &mut bytes {
                if rng.random::<f64>() < corrupted {
                    *byte ^= rng.random_range(1..=u8::MAX);
                }
            }
        }
        bytes
    }
}

impl Direction {
    fn pass(&mut self, now: Timestamp, delay: Duration, bytes: Vec<u8>) -> Vec<u8> {
        if delay.is_zero() && self.waiting.is_empty() {
            return bytes;
        }
        if !bytes.is_empty() && self.bytes + bytes.len() <= WAITING_MAX {
            let last = self.waiting.back().map_or(now, |(at, _)| *at);
            self.bytes += bytes.len();
            self.waiting.push_back(((now + delay).max(last), bytes));
        }
        let mut arrived = Vec::new();
        while self.waiting.front().is_some_and(|(at, _)| *at <= now) {
            let (_, bytes) = self.waiting.pop_front().expect("a front was seen");
            self.bytes -= bytes.len();
            arrived.extend(bytes);
        }
        arrived
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FOR_GOOD: Timestamp = Timestamp::from_nanos(u64::MAX);

    fn at(milliseconds: u64) -> Timestamp {
        Timestamp::from_nanos(milliseconds * 1_000_000)
    }

    fn line() -> Line {
        Line::new(1)
    }

    #[test]
    fn shares_of_bytes_are_lost_and_altered_until_the_fault_is_over() {
        let mut line = line();
        line.lose(0.1, at(10));
        let left = line.carry_out(at(9), vec![0; 100_000]).len();
        assert!((89_000..91_000).contains(&left), "{left}");
        line.corrupt(0.005, at(20));
        let bytes = line.carry_in(at(19), vec![0; 100_000]);
        let altered = bytes.iter().filter(|it| **it != 0).count();
        assert!(
            (400..600).contains(&altered),
            "{altered} of {}",
            bytes.len()
        );
        assert_eq!(line.carry_in(at(20), vec![7; 1_000]), [7; 1_000]);
    }

    #[test]
    fn late_bytes_keep_their_order_when_the_delay_ends() {
        let mut line = line();
        line.delay(Duration::from_millis(30), at(15));
        assert!(line.carry_out(at(10), vec![1]).is_empty());
        assert_eq!(line.next_arrival(), Some(at(40)));
        assert!(line.carry_out(at(20), vec![2]).is_empty());
        assert_eq!(line.carry_out(at(40), vec![3]), [1, 2, 3]);
        assert_eq!(line.next_arrival(), None);
        assert_eq!(line.carry_out(at(50), vec![4]), [4]);
    }

    #[test]
    fn bytes_beyond_the_limit_are_lost() {
        let mut line = line();
        line.delay(Duration::from_secs(60), FOR_GOOD);
        for now in 0..10 {
            line.carry_in(at(now), vec![0; WAITING_MAX / 4]);
        }
        assert_eq!(line.carry_in(at(70_000), Vec::new()).len(), WAITING_MAX);
    }
}
