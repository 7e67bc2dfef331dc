//! Where the autopilot is, in the drone's local frame.

use std::time::Duration;

use crate::geodetic::{Geodetic, local_ned};
use crate::geometry::{Ned, Velocity};
use crate::time::Timestamp;

/// Age of a position from which on it is lost. It is reported ten times a second.
const FRESH: Duration = Duration::from_millis(500);

/// The newest position.
///
/// The autopilot's local frame begins where it started. Horizontally it is moved to the drone's; heights are above the ground
/// where it started, since altitudes above sea level are known to a few metres only.
#[derive(Debug)]
pub(super) struct Place {
    home: Geodetic,
    /// Origin of the autopilot's frame in the drone's.
    offset: Option<Ned>,
    /// In the autopilot's frame.
    reported: Option<(Timestamp, Ned, Velocity)>,
    /// Since when there is no position. `None` if there is one.
    lost_since: Timestamp,
}

impl Place {
    pub(super) const fn new(home: Geodetic, now: Timestamp) -> Self {
        Self {
            home,
            offset: None,
            reported: None,
            lost_since: now,
        }
    }

    /// The autopilot's origin. It must not move under an aircraft that flies. One too far from home is no place to fly.
    pub(super) fn set_origin(&mut self, origin: Geodetic, is_armed: bool) {
        if self.offset.is_none() || !is_armed {
            let offset = local_ned(self.home, origin);
            self.offset = offset.ok().map(|it| it.at_altitude(0.0));
        }
    }

    /// The autopilot's position.
    pub(super) fn set(&mut self, now: Timestamp, position: Ned, velocity: Velocity) {
        if self.offset.is_none() {
            return;
        }
        self.reported = Some((now, position, velocity));
        self.lost_since = now;
    }

    /// How long the position has been lost. `None` if it is known.
    pub(super) fn lost_for(&self, now: Timestamp) -> Option<Duration> {
        let silence = now.since(self.lost_since);
        (self.reported.is_none() || silence > FRESH).then_some(silence)
    }

    /// The last known position and velocity in the drone's frame. `None` if there never was one.
    pub(super) fn last(&self) -> Option<(Ned, Velocity)> {
        let (offset, (_, position, velocity)) = (self.offset?, self.reported?);
        Some((position + offset, velocity))
    }

    /// A place of the drone's frame in the autopilot's. `None` before its origin is known.
    pub(super) fn to_autopilot(&self, place: Ned) -> Option<Ned> {
        Some(place - self.offset?)
    }
}
