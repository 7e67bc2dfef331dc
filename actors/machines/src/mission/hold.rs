//! How long the swarm waits at its waypoints once all are there, as the mission's file says. Only the master counts the
//! time, and every drone knows the holds, as any may come to lead.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{Mission, State};
use crate::time::Timestamp;

/// At which waypoints the swarm waits once all have arrived, and for how long: whole milliseconds, at most [`Holds::MAX`]
/// at each.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
pub struct Holds(BTreeMap<u16, Duration>);

/// The swarm would wait at a waypoint for longer than [`Holds::MAX`]; nothing was changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("a hold of {} s is longer than {} s", .hold.as_secs_f64(), Holds::MAX.as_secs())]
pub struct HoldTooLong {
    /// For how long it would wait.
    pub hold: Duration,
}

impl Holds {
    /// The longest hold at one waypoint: longer than multicopters fly.
    pub const MAX: Duration = Duration::from_secs(3_600);

    /// How long the swarm waits at a waypoint; zero if it flies on.
    #[must_use]
    pub fn at(&self, waypoint: u16) -> Duration {
        self.0.get(&waypoint).copied().unwrap_or_default()
    }

    /// Lets the swarm wait at a waypoint for so much longer; of a millisecond, parts don't count.
    ///
    /// # Errors
    /// When that comes to more than [`Self::MAX`].
    pub fn add(&mut self, waypoint: u16, longer: Duration) -> Result<(), HoldTooLong> {
        let longer = longer - Duration::from_nanos(u64::from(longer.subsec_nanos() % 1_000_000));
        let hold = self.at(waypoint).saturating_add(longer);
        if hold > Self::MAX {
            return Err(HoldTooLong { hold });
        }
        if !hold.is_zero() {
            self.0.insert(waypoint, hold);
        }
        Ok(())
    }

    /// Whether the swarm waits nowhere.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Each waypoint at which the swarm waits, and for how long, in order.
    pub fn iter(&self) -> impl Iterator<Item = (u16, Duration)> {
        self.0.iter().map(|(waypoint, hold)| (*waypoint, *hold))
    }

    /// How long the swarm waits at all waypoints together.
    #[must_use]
    pub fn total(&self) -> Duration {
        self.0.values().sum()
    }

    /// The holds at `count` waypoints from `first` on; empty if the swarm waits at none of them.
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

    /// Takes in the holds at waypoints from `first` on, as [`Self::part`] gives them.
    pub(super) fn add_part(&mut self, first: usize, holds: &[Duration]) {
        for (waypoint, hold) in (first..).zip(holds).filter(|(_, hold)| !hold.is_zero()) {
            if let Ok(waypoint) = u16::try_from(waypoint) {
                self.0.insert(waypoint, (*hold).min(Self::MAX));
            }
        }
    }
}

/// A wait of the swarm at a waypoint, as its master counts it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Hold {
    /// Which waypoint.
    pub waypoint: u16,
    /// Until when; `None` once it is over.
    pub until: Option<Timestamp>,
}

impl Mission {
    /// As master, once all that it waits for are at a waypoint: whether the hold there is over. It begins where it has not
    /// yet; who was elected amid one does not know how much is left of it, and begins it anew.
    pub(super) fn has_held(&mut self, now: Timestamp, waypoint: u16) -> bool {
        let hold = self.durable.holds.at(waypoint);
        // The swarm changes formation after the hold.
        let changes_already = self.durable.changes > self.changes_before(waypoint);
        if hold.is_zero() || changes_already {
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
        // A drone that comes back amid the hold is waited for after it.
        self.durable.limit = Some(until + self.config.leg_limit);
        false
    }

    /// As master: until when the swarm waits, if it does.
    pub(super) fn holds_until(&self) -> Option<Timestamp> {
        self.durable.lead.as_ref()?.hold?.until
    }

    pub(super) fn end_hold_if_due(&mut self, now: Timestamp) {
        if self.holds_until().is_none_or(|until| until > now) {
            return;
        }
        if let Some(hold) = self.durable.lead.as_mut().and_then(|it| it.hold.as_mut()) {
            hold.until = None;
        }
        if self.durable.state == State::Following {
            self.arrived_as_followed(now);
        } else {
            self.react(now);
        }
        self.checkpoint();
    }
}
