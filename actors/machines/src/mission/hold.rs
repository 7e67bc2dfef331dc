//! Holds: the swarm waits at a waypoint for a configured time once all have arrived.
//!
//! Only the master measures the time. Every drone knows the holds, as each may become the master.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{Mission, State};
use crate::time::Timestamp;
use crate::wire::HOLD_MAX;

/// Durations of the holds by waypoint: whole milliseconds, at most [`Holds::MAX`] each.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
pub struct Holds(BTreeMap<u16, Duration>);

/// A hold would exceed [`Holds::MAX`]. Nothing was changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("a hold of {} s exceeds the maximum of {} s", .hold.as_secs_f64(), Holds::MAX.as_secs())]
pub struct HoldTooLong {
    /// The refused duration.
    pub hold: Duration,
}

impl Holds {
    /// Maximum of a hold: longer than multicopters fly.
    pub const MAX: Duration = HOLD_MAX;

    /// The hold at a waypoint; zero if there is none.
    #[must_use]
    pub fn at(&self, waypoint: u16) -> Duration {
        self.0.get(&waypoint).copied().unwrap_or_default()
    }

    /// Extends the hold at a waypoint, rounded down to milliseconds.
    ///
    /// # Errors
    /// The sum exceeds [`Self::MAX`].
    pub fn add(&mut self, waypoint: u16, extra: Duration) -> Result<(), HoldTooLong> {
        let extra = extra - Duration::from_nanos(u64::from(extra.subsec_nanos() % 1_000_000));
        let hold = self.at(waypoint).saturating_add(extra);
        if hold > Self::MAX {
            return Err(HoldTooLong { hold });
        }
        if !hold.is_zero() {
            self.0.insert(waypoint, hold);
        }
        Ok(())
    }

    /// Whether there are no holds.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Waypoints with a hold and its duration, by waypoint.
    pub fn iter(&self) -> impl Iterator<Item = (u16, Duration)> {
        self.0.iter().map(|(waypoint, hold)| (*waypoint, *hold))
    }

    /// Sum of all holds.
    #[must_use]
    pub fn total(&self) -> Duration {
        self.0.values().sum()
    }

    /// The holds at `count` waypoints from `first` on; empty if all are zero.
    pub(super) fn part(&self, first: usize, count: usize) -> Vec<Duration> {
        let waypoints = (first..first + count).map(u16::try_from);
        let holds: Vec<_> = waypoints
            .map(|waypoint| waypoint.map_or(Duration::ZERO, |waypoint| self.at(waypoint)))
            .collect();
        if holds.iter().all(Duration::is_zero) {
            return Vec::new();
        }
        holds
    }

    /// Stores the holds at waypoints from `first` on, as returned by [`Self::part`].
    pub(super) fn add_part(&mut self, first: usize, holds: &[Duration]) {
        for (waypoint, hold) in (first..).zip(holds).filter(|(_, hold)| !hold.is_zero()) {
            if let Ok(waypoint) = u16::try_from(waypoint) {
                self.0.insert(waypoint, (*hold).min(Self::MAX));
            }
        }
    }
}

/// A hold that has begun, as measured by the master.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Hold {
    /// Number of the waypoint, from 0.
    pub waypoint: u16,
    /// End of the hold. `None` once it is over.
    pub until: Option<Timestamp>,
}

impl Mission {
    /// As master, once all awaited members are at a waypoint: begins the hold there. Returns whether it is over. A
    /// master elected during a hold begins it anew, as the remaining time is unknown.
    pub(super) fn advance_hold(&mut self, now: Timestamp, waypoint: u16) -> bool {
        let hold = self.durable.holds.at(waypoint);
        // The swarm changes formation after the hold.
        let is_over = self.durable.progress.changes > self.changes_before(waypoint);
        if hold.is_zero() || is_over {
            return true;
        }
        let Some(lead) = &mut self.durable.lead else {
            return true;
        };
        if let Some(begun) = lead.hold.filter(|begun| begun.waypoint == waypoint) {
            return begun.until.is_none();
        }
        let until = now + hold;
        lead.hold = Some(Hold {
            waypoint,
            until: Some(until),
        });
        // Members that return during the hold are awaited after it, for at most a leg.
        self.durable.deadlines.limit = Some(until + self.config.leg_limit);
        false
    }

    /// As master: end of the current hold. `None` if there is none.
    pub(super) fn hold_ends_at(&self) -> Option<Timestamp> {
        self.durable.lead.as_ref()?.hold?.until
    }

    /// As master: ends a hold that is due and continues.
    pub(super) fn end_hold_if_due(&mut self, now: Timestamp) {
        if self.hold_ends_at().is_none_or(|until| until > now) {
            return;
        }
        if let Some(hold) = self.durable.lead.as_mut().and_then(|it| it.hold.as_mut()) {
            hold.until = None;
        }
        if self.durable.state == State::Following {
            self.complete_following_leg(now);
        } else {
            self.advance(now);
        }
        self.checkpoint();
    }
}
