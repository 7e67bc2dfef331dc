//! What became of the unicasts to one neighbour.

use std::ops::RangeInclusive;
use std::time::Duration;

use crate::routing::tree::quality::Quality;
use crate::time::Timestamp;

/// Odds at which a neighbour in range misses as many consecutive frames as make it unreachable.
const UNREACHABLE_ODDS: f64 = 1e-3;
/// Bounds of that number of frames.
const FAILED_DELIVERIES: RangeInclusive<u32> = 2..=12;

/// Longest time until the medium reports a delivery: eight tries over 802.11a with the longest back-off take about 30
/// ms.
const DELIVERY_REPORT_MAX: Duration = Duration::from_millis(60);

/// Unicasts to a neighbour, as the medium reports them.
///
/// Invariant: a delivery or a frame of the neighbour ends a row of failures. A report of the medium, good or bad, ends the wait
/// for it.
#[derive(Debug, Clone, Default)]
pub(in crate::routing::tree) struct Deliveries {
    /// Number of consecutive failed deliveries.
    failed: u32,
    /// When the frame was sent whose delivery the medium has not reported yet.
    sent_at: Option<Timestamp>,
}

impl Deliveries {
    /// A unicast was sent.
    pub(in crate::routing::tree) const fn record_send(&mut self, now: Timestamp) {
        self.sent_at = Some(now);
    }

    /// A unicast was not delivered.
    pub(in crate::routing::tree) const fn record_failure(&mut self) {
        self.sent_at = None;
        self.failed = self.failed.saturating_add(1);
    }

    /// A unicast was delivered.
    pub(in crate::routing::tree) const fn record_delivery(&mut self) {
        self.sent_at = None;
        self.failed = 0;
    }

    /// Forgets failures: the neighbour was heard, or is to be tried anew.
    pub(super) const fn forget_failures(&mut self) {
        self.failed = 0;
    }

    /// Marks the neighbour unreachable until it is heard again.
    pub(in crate::routing::tree) const fn mark_unreachable(&mut self) {
        self.failed = *FAILED_DELIVERIES.end();
    }

    /// Whether it counts a failure since the neighbour was last heard.
    pub(super) const fn has_failed(&self) -> bool {
        self.failed > 0
    }

    /// Whether the medium is still sending a unicast. Another one would queue behind it and delay all others.
    pub(in crate::routing::tree) fn is_in_flight(&self, now: Timestamp) -> bool {
        self.sent_at
            .is_some_and(|at| now.since(at) < DELIVERY_REPORT_MAX)
    }

    /// Whether a neighbour with this link quality can be reached, as far as this drone knows.
    pub(super) fn is_reachable(&self, quality: &Quality) -> bool {
        self.failed < *FAILED_DELIVERIES.start() || self.failed < failed_max(quality)
    }
}

/// Number of consecutive failures at which a neighbour counts as unreachable.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "within `FAILED_DELIVERIES`"
)]
fn failed_max(quality: &Quality) -> u32 {
    let lost = (1.0 - quality.round_trip()).max(f64::EPSILON);
    let frames = (libm::log(UNREACHABLE_ODDS) / libm::log(lost)).ceil() as u32;
    frames.clamp(*FAILED_DELIVERIES.start(), *FAILED_DELIVERIES.end())
}
