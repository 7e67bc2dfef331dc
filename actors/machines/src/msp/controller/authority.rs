//! Who flies an armed vehicle: the link, the pilot, or the controller's own failsafe.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::config::Receiver;
use super::reports::Reported;
use crate::msp::LandingCause;
use crate::msp::silence::Silence;
use crate::time::Timestamp;

/// Time without an answer after which a link to an armed controller is lost. A controller that hears nothing for its failsafe
/// delay, 1 s or more, comes down by itself.
pub const LOST_AFTER: Duration = Duration::from_secs(1);

/// Time without an answer that came early enough to be used, after which the link is lost although late ones come: then nothing
/// is known of the aircraft. A stall of a moment makes some late.
pub const FRESH_ANSWER_TIMEOUT: Duration = Duration::from_secs(3);

/// Of the newest [`RC_COUNTED`](muster_msp::RC_COUNTED) RC frames, how many must be acknowledged; with fewer the link to an armed
/// controller is lost, too. With 2 % of all bytes altered 41 are; then ten frames in a row, after which Betaflight counts its
/// receiver as lost and closes the throttle, are lost every ten seconds.
pub const ACKNOWLEDGED_MIN: u32 = 40;

/// Whether a pilot has handed the aircraft over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Handover {
    /// Not yet, or there is no pilot.
    #[default]
    None,
    /// The pilot took it over again. It is not asked back.
    TakenBack,
    /// The link has it.
    Given,
}

/// Who has an aircraft but its link, as a checkpoint keeps it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Taken {
    /// Between pilot and link.
    pub handover: Handover,
    /// The controller's failsafe flies, or the link was lost in flight. Until it has disarmed it gets no RC, which would end
    /// the failsafe in mid-air.
    pub by_failsafe: bool,
}

impl Taken {
    /// Whether the pilot took the aircraft over.
    pub(in crate::msp) const fn is_pilots(self) -> bool {
        matches!(self.handover, Handover::TakenBack)
    }

    /// Whether neither the pilot nor the controller's failsafe has taken it.
    pub(in crate::msp) const fn is_links(self) -> bool {
        !self.is_pilots() && !self.by_failsafe
    }

    /// Why the vehicle lands, if it is known.
    pub(in crate::msp) fn cause(self) -> Option<LandingCause> {
        self.is_pilots().then_some(LandingCause::Pilot)
    }
}

/// Who flies.
///
/// Invariant: what the pilot took never comes back; what the failsafe took does once the controller has disarmed.
#[derive(Debug)]
pub(super) struct Authority {
    receiver: Receiver,
    taken: Taken,
    /// Until an answer comes, late or not.
    silence: Silence,
    /// Until an answer comes that can be used.
    fresh_answers: Silence,
}

impl Authority {
    /// `has_flown`, `taken`: from a checkpoint.
    pub(super) fn new(receiver: Receiver, has_flown: bool, taken: Taken, now: Timestamp) -> Self {
        Self {
            receiver,
            taken,
            silence: Silence::new(LOST_AFTER, has_flown, now),
            fresh_answers: Silence::new(FRESH_ANSWER_TIMEOUT, has_flown, now),
        }
    }

    pub(super) const fn taken(&self) -> Taken {
        self.taken
    }

    /// Whether the link may fly: nobody has taken the aircraft.
    pub(super) const fn is_links(&self) -> bool {
        self.taken.is_links()
    }

    /// Whether a pilot may fly it, and arm it.
    pub(super) const fn has_pilot(&self) -> bool {
        matches!(self.receiver, Receiver::Override)
    }

    /// Whether a pilot has the sticks and has not handed them over.
    pub(super) fn is_waiting(&self) -> bool {
        self.receiver == Receiver::Override && self.taken.handover == Handover::None
    }

    /// Whether RC may be sent.
    pub(super) const fn may_send(&self) -> bool {
        !self.taken.by_failsafe
    }

    /// The controller answered; `is_late`: too late to be used.
    pub(super) fn heard(&mut self, now: Timestamp, is_late: bool) {
        self.silence.heard(now);
        if !is_late {
            self.fresh_answers.heard(now);
        }
    }

    /// The controller has acknowledged that many of the newest RC frames. Returns whether the link has just been lost.
    pub(super) fn count_acknowledged(&mut self, acknowledged: u32) -> bool {
        let is_armed = self.silence.is_watching();
        is_armed && acknowledged < ACKNOWLEDGED_MIN && self.give_up()
    }

    /// The link can't fly an armed vehicle: the controller's failsafe is to. Returns whether RC was sent until now.
    pub(super) fn give_up(&mut self) -> bool {
        let was_sent = self.may_send();
        self.taken.by_failsafe = true;
        was_sent
    }

    /// The controller's report is believed.
    pub(super) fn take(&mut self, now: Timestamp, reported: Reported) {
        if self.receiver == Receiver::Override {
            self.taken.handover = match self.taken.handover {
                Handover::TakenBack => Handover::TakenBack,
                _ if reported.overridden == Some(true) && reported.levels => Handover::Given,
                Handover::Given if reported.armed => Handover::TakenBack,
                Handover::Given | Handover::None => Handover::None,
            };
        }
        self.silence.watch(now, reported.armed);
        self.fresh_answers.watch(now, reported.armed);
        self.taken.by_failsafe = reported.armed && (self.taken.by_failsafe || reported.failsafe);
    }

    /// When to call [`Self::handle_timeout`].
    pub(super) fn deadline(&self) -> Option<Timestamp> {
        let deadlines = [self.silence.deadline(), self.fresh_answers.deadline()];
        deadlines.into_iter().flatten().min()
    }

    /// Returns whether the link has just been lost: the controller was silent for too long.
    pub(super) fn handle_timeout(&mut self, now: Timestamp) -> bool {
        let [is_silent, is_stale] =
            [&mut self.silence, &mut self.fresh_answers].map(|it| it.handle_timeout(now));
        (is_silent || is_stale) && self.give_up()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(milliseconds: u64) -> Timestamp {
        Timestamp::from_nanos(milliseconds * 1_000_000)
    }

    const FLOWN: Reported = Reported {
        armed: true,
        is_prevented: false,
        failsafe: false,
        overridden: Some(true),
        levels: true,
    };
    const BY_PILOT: Reported = Reported {
        overridden: Some(false),
        ..FLOWN
    };

    fn authority(taken: Taken) -> Authority {
        let mut authority = Authority::new(Receiver::Override, true, taken, at(0));
        authority.take(at(0), FLOWN);
        authority
    }

    #[test]
    fn what_the_pilot_took_never_comes_back() {
        let mut authority = authority(Taken::default());
        assert!(authority.is_links());
        authority.take(at(100), BY_PILOT);
        authority.take(at(200), FLOWN);
        assert!(!authority.is_links() && authority.may_send());
        let restarted = self::authority(authority.taken());
        assert!(!restarted.is_links());
    }

    #[test]
    fn takeover_during_a_restart_is_seen() {
        let before = authority(Taken::default()).taken();
        let mut restarted = Authority::new(Receiver::Override, true, before, at(0));
        restarted.take(at(100), BY_PILOT);
        assert!(restarted.taken().is_pilots());
    }

    #[test]
    fn mode_that_takes_sticks_for_something_else_is_the_pilots() {
        let mut authority = authority(Taken::default());
        let elsewhere = Reported {
            levels: false,
            ..FLOWN
        };
        authority.take(at(100), elsewhere);
        assert!(authority.taken().is_pilots());
        let mut never_given = Authority::new(Receiver::Override, true, Taken::default(), at(0));
        never_given.take(at(100), elsewhere);
        assert!(never_given.is_waiting() && never_given.is_links());
    }

    #[test]
    fn what_the_failsafe_took_comes_back_once_the_controller_has_disarmed() {
        let failsafe = Reported {
            failsafe: true,
            ..FLOWN
        };
        let mut authority = authority(Taken::default());
        authority.take(at(100), failsafe);
        authority.take(at(200), FLOWN);
        assert!(!authority.may_send());
        let mut restarted = self::authority(authority.taken());
        assert!(!restarted.may_send());
        restarted.take(
            at(300),
            Reported {
                armed: false,
                ..FLOWN
            },
        );
        assert!(restarted.is_links());
    }

    #[test]
    fn too_few_acknowledged_frames_lose_an_armed_vehicle_only() {
        let mut authority = authority(Taken::default());
        assert!(!authority.count_acknowledged(ACKNOWLEDGED_MIN) && authority.may_send());
        assert!(authority.count_acknowledged(ACKNOWLEDGED_MIN - 1) && !authority.may_send());
        assert!(!authority.count_acknowledged(0), "not lost twice");
        let disarmed = Reported {
            armed: false,
            ..FLOWN
        };
        authority.take(at(100), disarmed);
        assert!(!authority.count_acknowledged(0) && authority.may_send());
    }

    #[test]
    fn answers_that_are_all_late_lose_an_armed_vehicle_after_three_seconds() {
        let mut authority = authority(Taken::default());
        for now in (100..3_000).step_by(100) {
            authority.heard(at(now), true);
            assert!(!authority.handle_timeout(at(now)), "{now} ms");
        }
        assert!(authority.handle_timeout(at(3_000)) && !authority.may_send());
    }

    #[test]
    fn silence_loses_an_armed_vehicle_unless_the_link_itself_was_held_up() {
        let mut authority = authority(Taken::default());
        authority.heard(at(500), false);
        let mut looks = |from, to| {
            let mut times = (from..=to).step_by(50);
            times.any(|now| authority.handle_timeout(at(now)))
        };
        assert!(!looks(500, 1_400));
        assert!(!looks(1_700, 2_650), "held up");
        assert!(looks(2_700, 2_700) && !authority.may_send());
    }
}
