//! Numbers that a drone has seen of another one.

/// Number of numbers behind the highest that are told apart; older ones count as seen. A drone numbers fewer frames, or
/// messages, while a frame or a whole message lives: 40 messages a second for some 40 s.
const WINDOW: u32 = 2_048;

/// The numbers that were seen in one session.
///
/// Invariant: bits of numbers that are not in the window are clear.
#[derive(Debug, Clone)]
struct Session {
    session: u32,
    highest: u32,
    /// The bit of a number is at its remainder by the window.
    bits: [u64; (WINDOW / 64) as usize],
}

impl Session {
    const fn new(session: u32) -> Self {
        Self {
            session,
            highest: 0,
            bits: [0; (WINDOW / 64) as usize],
        }
    }

    const fn place(number: u32) -> (usize, u64) {
        let place = number % WINDOW;
        ((place / 64) as usize, 1 << (place % 64))
    }

    fn contains(&self, number: u32) -> bool {
        if number > self.highest {
            return false;
        }
        let (word, bit) = Self::place(number);
        self.highest - number >= WINDOW || self.bits[word] & bit != 0
    }

    fn insert(&mut self, number: u32) {
        if number > self.highest {
            if number - self.highest >= WINDOW {
                self.bits.fill(0);
            } else {
                for passed in self.highest + 1..=number {
                    let (word, bit) = Self::place(passed);
                    self.bits[word] &= !bit;
                }
            }
            self.highest = number;
        }
        let (word, bit) = Self::place(number);
        self.bits[word] |= bit;
    }
}

/// The numbers that were seen in the last two sessions of a drone. A session before these counts as new.
#[derive(Debug, Clone, Default)]
pub(super) struct Seen {
    sessions: Vec<Session>,
}

impl Seen {
    /// Whether a number was seen, or is too old to tell.
    pub(super) fn contains(&self, session: u32, number: u32) -> bool {
        self.find(session).is_some_and(|it| it.contains(number))
    }

    /// Records a number. Returns whether it is new: neither seen nor too old to tell.
    pub(super) fn insert(&mut self, session: u32, number: u32) -> bool {
        if let Some(known) = self.sessions.iter_mut().find(|it| it.session == session) {
            let is_new = !known.contains(number);
            if is_new {
                known.insert(number);
            }
            return is_new;
        }
        let mut new = Session::new(session);
        new.insert(number);
        self.sessions.insert(0, new);
        self.sessions.truncate(2);
        true
    }

    /// The 32 numbers before `number`: bit i stands for `number` − 1 − i.
    pub(super) fn before(&self, session: u32, number: u32) -> u32 {
        let Some(known) = self.find(session) else {
            return 0;
        };
        let is_seen = |back: &u32| {
            let earlier = number.checked_sub(1 + back).filter(|it| *it > 0);
            earlier.is_some_and(|earlier| known.contains(earlier))
        };
        (0..32).filter(is_seen).map(|back| 1 << back).sum()
    }

    fn find(&self, session: u32) -> Option<&Session> {
        self.sessions.iter().find(|it| it.session == session)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn window_behaves_like_a_set_that_forgets_old_numbers(
            steps in prop::collection::vec((0_u32..400, any::<bool>()), 1..60),
        ) {
            let (mut seen, mut set, mut top) = (Seen::default(), BTreeSet::new(), 1_u32);
            for (step, is_back) in steps {
                let number = if is_back { top.saturating_sub(step).max(1) } else { top + step };
                let highest = set.last().copied().unwrap_or(0);
                let is_old = highest >= number && highest - number >= WINDOW;
                prop_assert_eq!(seen.contains(7, number), set.contains(&number) || is_old);
                if !is_old {
                    seen.insert(7, number);
                    set.insert(number);
                    top = top.max(number);
                }
            }
            let last = set.last().copied().unwrap_or(0);
            let before = seen.before(7, last);
            for back in 0..32 {
                let earlier = last.checked_sub(1 + back);
                let is_seen = earlier.is_some_and(|it| set.contains(&it));
                prop_assert_eq!(before & (1 << back) != 0, is_seen, "{} back", back);
            }
        }
    }

    #[test]
    fn sessions_are_distinguished_and_two_are_remembered() {
        let mut seen = Seen::default();
        seen.insert(1, 5);
        seen.insert(2, 5);
        assert!(seen.contains(1, 5) && seen.contains(2, 5) && !seen.contains(3, 5));
        seen.insert(3, 5);
        assert!(!seen.contains(1, 5), "two sessions are remembered");
    }
}
