//! Whether one neighbour hears this drone.

use std::time::Duration;

use crate::time::Timestamp;

/// Whether a neighbour hears this drone, as its frames report or show.
///
/// Invariant: a symmetric link becomes one-way only after reports have omitted this drone for the stale time. One omission may
/// come from a restart or a lost frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::routing::tree) enum Hearing {
    /// It hears this drone.
    Symmetric,
    /// It heard this drone, but its reports have omitted it since this time.
    Omitted { since: Timestamp },
    /// It has not shown that it hears this drone, or reports that it does not.
    OneWay,
}

impl Hearing {
    /// Of a neighbour's first frame. `hears_own`: whether it hears this drone; `None` if the frame does not contain it.
    pub(super) fn of_first(hears_own: Option<bool>) -> Self {
        if hears_own == Some(true) {
            Self::Symmetric
        } else {
            Self::OneWay
        }
    }

    /// Records a further frame. Returns whether the link has become symmetric or one-way.
    #[inline]
    pub(super) fn record(
        &mut self,
        now: Timestamp,
        hears_own: Option<bool>,
        stale_time: impl FnOnce() -> Duration,
    ) -> bool {
        let before = *self;
        let omitted_since = match before {
            Self::OneWay => None,
            Self::Symmetric => Some(now),
            Self::Omitted { since } => Some(since),
        };
        *self = match (hears_own, omitted_since) {
            (None, _) => before,
            (Some(true), _) => Self::Symmetric,
            (Some(false), Some(since)) if now.since(since) < stale_time() => {
                Self::Omitted { since }
            }
            (Some(false), _) => Self::OneWay,
        };
        self.is_symmetric() != before.is_symmetric()
    }

    /// Whether the neighbour hears this drone, too. Only symmetric links are used.
    pub(in crate::routing::tree) const fn is_symmetric(self) -> bool {
        matches!(self, Self::Symmetric | Self::Omitted { .. })
    }

    /// Whether it may not hear this drone: it has not shown that it does, or reports that it no longer does.
    pub(in crate::routing::tree) const fn may_be_deaf(self) -> bool {
        !matches!(self, Self::Symmetric)
    }

    /// Whether it reports that it no longer hears this drone, over a link that still counts as symmetric.
    pub(in crate::routing::tree) const fn lost_this_drone(self) -> bool {
        matches!(self, Self::Omitted { .. })
    }
}
