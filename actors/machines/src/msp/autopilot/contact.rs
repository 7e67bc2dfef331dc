//! Whether the autopilot is heard, and who has it.

use std::time::Duration;

use super::vocabulary::Mode;
use crate::msp::controller::{Handover, Taken};
use crate::msp::silence::Silence;
use crate::time::Timestamp;

/// Time without a heartbeat after which the link to an armed autopilot is lost: four or five missed heartbeats
/// (mavlink.io, *Heartbeat/Connection Protocol*).
pub const LOST_AFTER: Duration = Duration::from_secs(4);

/// The newest heartbeat, and what was taken from the link.
///
/// Invariant: what somebody else took never comes back; what was lost does once the autopilot has disarmed.
#[derive(Debug)]
pub(super) struct Contact {
    heard: Option<(bool, Mode)>,
    taken: Taken,
    silence: Silence,
}

impl Contact {
    /// `has_flown`, `taken`: from a checkpoint.
    pub(super) fn new(has_flown: bool, taken: Taken, now: Timestamp) -> Self {
        Self {
            heard: None,
            taken,
            silence: Silence::new(LOST_AFTER, has_flown, now),
        }
    }

    pub(super) const fn taken(&self) -> Taken {
        self.taken
    }

    /// Whether a heartbeat was ever heard.
    pub(super) const fn is_known(&self) -> bool {
        self.heard.is_some()
    }

    /// Whether the motors are armed, or may be.
    pub(super) fn is_armed(&self) -> bool {
        self.heard
            .map_or(self.taken.by_failsafe, |(armed, _)| armed)
    }

    /// Whether an autopilot that is heard is in this mode.
    pub(super) fn is_in(&self, mode: Mode) -> bool {
        self.heard.is_some_and(|(_, it)| it == mode)
    }

    /// Whether the link may command: nobody took the aircraft, and the link is not lost.
    pub(super) const fn is_links(&self) -> bool {
        self.taken.is_links()
    }

    /// A heartbeat. `has_flown`: the link has armed it. Returns whether anything changed.
    pub(super) fn hear(
        &mut self,
        now: Timestamp,
        armed: bool,
        mode: Mode,
        has_flown: bool,
    ) -> bool {
        let before = (self.heard, self.taken);
        self.heard = Some((armed, mode));
        self.silence.watch(now, armed);
        self.taken.by_failsafe &= armed;
        if armed && has_flown && mode == Mode::Other {
            self.taken.handover = Handover::TakenBack;
        }
        before != (self.heard, self.taken)
    }

    /// When to call [`Self::handle_timeout`].
    pub(super) fn deadline(&self) -> Option<Timestamp> {
        self.silence.deadline()
    }

    /// Returns whether the link has just been lost.
    pub(super) fn handle_timeout(&mut self, now: Timestamp) -> bool {
        let is_lost = self.silence.handle_timeout(now);
        self.taken.by_failsafe |= is_lost;
        is_lost
    }
}
