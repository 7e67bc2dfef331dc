//! Times at which firmware stood still.

use std::time::Duration;

use muster_runtime::text::{figure, plural};
use serde::Serialize;

/// Times at which a flight controller's firmware, or its aircraft, stood still while it was armed, as on a busy host. The
/// aircraft waits for up to half a second each time.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct FirmwareStalls {
    /// How many.
    pub count: usize,
    /// The longest, in seconds.
    pub longest_s: f64,
}

impl FirmwareStalls {
    /// Notes how long one lasts already.
    pub fn note(&mut self, is_new: bool, lasts: Duration) {
        self.count += usize::from(is_new);
        self.longest_s = self.longest_s.max(lasts.as_secs_f64());
    }

    /// These and others.
    #[must_use]
    pub const fn joined(self, other: Self) -> Self {
        Self {
            count: self.count + other.count,
            longest_s: self.longest_s.max(other.longest_s),
        }
    }

    /// As people read it. `None` if there was none.
    #[must_use]
    pub fn text(self) -> Option<String> {
        let longest_ms = figure(self.longest_s * 1e3, 0);
        let times = plural(self.count, "time");
        (self.count > 0).then(|| format!("stood still {times}, at most {longest_ms} ms"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_is_named_and_none_says_nothing() {
        let mut stalls = FirmwareStalls::default();
        assert_eq!(stalls.text(), None);
        stalls.note(true, Duration::from_millis(20));
        stalls.note(false, Duration::from_millis(212));
        stalls.note(true, Duration::from_millis(30));
        let text = stalls.text();
        assert_eq!(text.as_deref(), Some("stood still 2 times, at most 212 ms"));
    }
}
