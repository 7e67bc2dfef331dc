//! Follows a moving place.

use std::collections::VecDeque;
use std::time::Duration;

use super::{Goal, Navigation, Progress};
use crate::geometry::{Ned, Velocity};
use crate::msp::{FlightCommand, Setpoint};
use crate::time::Timestamp;

/// Multiple of [`Goal::Track`]'s `hold` after which a tracked place expires.
const TRACK_EXPIRY_HOLDS: u32 = 2;

impl Navigation {
    /// Tracks a moving place, which needs no legs.
    pub(super) fn track(
        &mut self,
        now: Timestamp,
        goal: Goal,
        (to, velocity, hold): (Ned, Velocity, Duration),
    ) {
        self.durable.goal = Some(goal);
        self.track_expires_at = Some(now + hold * TRACK_EXPIRY_HOLDS);
        self.set_progress(Progress::Flying(VecDeque::new()));
        (self.deconfliction).announce_track(now, (to, velocity, hold), &mut self.outbox);
        self.command(FlightCommand::Fly(Setpoint::Track {
            to,
            velocity,
            speed_mps: self.config.speed_mps,
            acceleration_mps2: self.config.acceleration_mps2,
            hold,
        }));
    }

    /// After a restart a tracked place expires, too, as if its last velocity had been heard now.
    pub(super) fn resume_tracking(&mut self, now: Timestamp) {
        if std::mem::take(&mut self.is_restored)
            && let Some(Goal::Track { hold, .. }) = self.durable.goal
        {
            let expires_at = now + hold * TRACK_EXPIRY_HOLDS;
            self.track_expires_at.get_or_insert(expires_at);
        }
    }
}
