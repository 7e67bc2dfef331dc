//! When a patrol that can't go on ends.

use std::time::Duration;

use muster_machines::indoor::{Checkpoint, EarlyLanding};
use muster_machines::time::Timestamp;

/// A drone that no sonar leads turns to find something that echoes: a full turn takes 7 s. After so long it lands.
const NO_SONAR_MAX: Duration = Duration::from_secs(10);
/// Odometry comes 20 times a second. Without it the drone hovers after this time: it doesn't know how it moves.
const ODOMETRY_HOLDS: Duration = Duration::from_millis(500);
/// After so long without odometry it lands.
const NO_ODOMETRY_MAX: Duration = Duration::from_secs(10);

/// Since when a patrol has had what it can't go on without. A restart goes on from the same times; the time between processes
/// counts for none.
#[derive(Debug)]
pub(super) struct Deadlines {
    /// When a sonar last led the drone.
    heard: Timestamp,
    /// When odometry last came.
    moved: Timestamp,
    began: Timestamp,
}

impl Deadlines {
    pub(super) fn new(now: Timestamp, checkpoint: Option<&Checkpoint>) -> Self {
        let ago = |time: fn(&Checkpoint) -> Duration| {
            before(now, checkpoint.map_or(Duration::ZERO, time))
        };
        Self {
            heard: ago(|it| it.unheard),
            moved: ago(|it| it.unmoved),
            began: ago(|it| it.lasted),
        }
    }

    /// A sonar leads the drone.
    pub(super) const fn hear(&mut self, now: Timestamp) {
        self.heard = now;
    }

    /// Odometry came.
    pub(super) const fn moved(&mut self, now: Timestamp) {
        self.moved = now;
    }

    /// Whether odometry came lately.
    pub(super) fn has_odometry(&self, now: Timestamp) -> bool {
        now.since(self.moved) < ODOMETRY_HOLDS
    }

    /// Why the patrol ends now; `None` if it goes on.
    pub(super) fn passed(&self, now: Timestamp, lasts_max: Duration) -> Option<EarlyLanding> {
        if self.unheard(now) >= NO_SONAR_MAX {
            Some(EarlyLanding::NoSonar)
        } else if self.unmoved(now) >= NO_ODOMETRY_MAX {
            Some(EarlyLanding::NoOdometry)
        } else if self.lasted(now) >= lasts_max {
            Some(EarlyLanding::TimeOver)
        } else {
            None
        }
    }

    pub(super) const fn unheard(&self, now: Timestamp) -> Duration {
        now.since(self.heard)
    }

    pub(super) const fn unmoved(&self, now: Timestamp) -> Duration {
        now.since(self.moved)
    }

    pub(super) const fn lasted(&self, now: Timestamp) -> Duration {
        now.since(self.began)
    }
}

/// The time so long before `now`; the epoch at the earliest.
fn before(now: Timestamp, ago: Duration) -> Timestamp {
    let ago = u64::try_from(ago.as_nanos()).unwrap_or(u64::MAX);
    Timestamp::from_nanos(now.as_nanos().saturating_sub(ago))
}
