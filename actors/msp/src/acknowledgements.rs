//! How many RC frames a controller acknowledges.

/// The newest RC frames that are counted: two seconds at 50 Hz.
pub const RC_COUNTED: u32 = 100;
/// RC frames from one count to the next.
const COUNTED_EVERY: u32 = 25;
/// The bits of the frames that are counted.
const COUNTED: u128 = (1 << RC_COUNTED) - 1;

/// Which of the newest RC frames were acknowledged. Acknowledgements have no numbers: each is taken for the newest frame that
/// has none.
#[derive(Debug)]
pub(crate) struct Acknowledgements {
    /// A bit a frame, the newest the lowest. Before the first frame none is missing.
    frames: u128,
    written: u32,
}

impl Default for Acknowledgements {
    fn default() -> Self {
        Self {
            frames: COUNTED,
            written: 0,
        }
    }
}

impl Acknowledgements {
    /// An RC frame was written.
    pub(crate) const fn write(&mut self) {
        self.frames <<= 1;
        self.written = self.written.saturating_add(1);
    }

    /// An RC frame was acknowledged.
    pub(crate) const fn take(&mut self) {
        self.frames |= self.frames.wrapping_add(1);
    }

    /// How many of the newest [`RC_COUNTED`] were acknowledged, once in [`COUNTED_EVERY`] frames.
    pub(crate) const fn count(&mut self) -> Option<u32> {
        if self.written < COUNTED_EVERY {
            return None;
        }
        self.written = 0;
        Some((self.frames & COUNTED).count_ones())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What was counted last, after 1,000 frames of which these are acknowledged, `late` frames later.
    fn counted(late: usize, is_acknowledged: impl Fn(usize) -> bool) -> Option<u32> {
        let mut acknowledgements = Acknowledgements::default();
        let mut last = None;
        for number in 0..1_000_usize {
            acknowledgements.write();
            if number.checked_sub(late).is_some_and(&is_acknowledged) {
                acknowledgements.take();
            }
            last = acknowledgements.count().or(last);
        }
        last
    }

    #[test]
    fn the_newest_hundred_frames_are_counted() {
        assert_eq!(counted(0, |_| true), Some(100));
        assert_eq!(counted(2, |_| true), Some(100));
        assert_eq!(counted(0, |it| it % 4 == 0), Some(25));
        assert_eq!(counted(1, |it| it % 2 == 0), Some(50));
        assert_eq!(counted(0, |it| it >= 500), Some(100));
        assert_eq!(counted(0, |it| it < 980), Some(80));
        assert_eq!(counted(0, |_| false), Some(0));
    }

    #[test]
    fn no_frame_is_missing_before_the_first() {
        let mut acknowledgements = Acknowledgements::default();
        for _ in 0..COUNTED_EVERY - 1 {
            acknowledgements.write();
            acknowledgements.take();
            assert_eq!(acknowledgements.count(), None);
        }
        acknowledgements.write();
        acknowledgements.take();
        assert_eq!(acknowledgements.count(), Some(100));
    }
}
