//! Failsafe: what happens after the receiver's signal was lost.
//!
//! Behaviour: Betaflight 4.5, `flight/failsafe.c`. Times are milliseconds since boot.

use super::settings::{FailsafeSettings, Procedure};

/// Time after boot from which the failsafe acts.
const MONITORED_FROM_MS: u64 = 5_000;

/// Shortest delay and recovery time.
const PERIOD_MIN_MS: u64 = 100;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    /// No stage 2.
    Idle,
    /// Stage 2: descends, and disarms at the latest at a time.
    Landing { until: u64 },
    /// Stage 2 has disarmed. Ends once the link has been up past a time.
    Landed { until: u64 },
}

#[derive(Debug, Clone)]
pub(crate) struct Failsafe {
    settings: FailsafeSettings,
    phase: Phase,
    is_link_up: bool,
    /// Whether arming is refused because frames are or were missing.
    is_signal_lost: bool,
    good_at: u64,
    bad_at: Option<u64>,
    /// Until when the throttle counts as not low.
    throttle_until: u64,
}

impl Failsafe {
    pub(crate) fn new(settings: FailsafeSettings) -> Self {
        Self {
            settings,
            phase: Phase::Idle,
            is_link_up: false,
            is_signal_lost: true,
            good_at: 0,
            bad_at: None,
            throttle_until: 0,
        }
    }

    /// Good frames arrive.
    pub(crate) fn good(&mut self, now: u64) {
        self.good_at = now;
        let bad_at = *self.bad_at.get_or_insert(now);
        if now - bad_at > self.recovery_ms() {
            self.is_link_up = true;
            self.is_signal_lost = false;
        }
    }

    /// The signal or a flight channel is lost.
    pub(crate) fn bad(&mut self, now: u64) {
        self.bad_at = Some(now);
        self.is_signal_lost = true;
    }

    /// Whether frames are missing, or haven't been back for long enough: Betaflight's flag `RXLOSS`.
    pub(crate) fn is_signal_lost(&self) -> bool {
        self.is_signal_lost
    }

    /// Whether stage 2 is on.
    pub(crate) fn is_active(&self) -> bool {
        self.phase != Phase::Idle
    }

    /// Whether stage 2 has disarmed and hasn't ended: Betaflight's flag `FAILSAFE`.
    pub(crate) fn has_disarmed(&self) -> bool {
        matches!(self.phase, Phase::Landed { .. })
    }

    /// The throttle that stage 2 sets, in µs.
    pub(crate) fn throttle_us(&self) -> Option<u16> {
        self.is_active().then_some(self.settings.throttle_us)
    }

    /// Every 10 ms. Yields whether the aircraft must be disarmed now.
    pub(crate) fn check(&mut self, now: u64, is_armed: bool, is_throttle_low: bool) -> bool {
        if now - self.good_at > self.delay_ms() {
            self.is_link_up = false;
            self.is_signal_lost = true;
        }
        if now < MONITORED_FROM_MS {
            return false;
        }
        let was_landed = self.has_disarmed();
        self.phase = match self.phase {
            Phase::Idle => self.idle(now, is_armed, is_throttle_low),
            Phase::Landing { .. } if self.is_link_up => self.recovered(now),
            Phase::Landing { until } if now > until || !is_armed => self.landed(now),
            Phase::Landed { .. } if !self.is_link_up => self.landed(now),
            Phase::Landed { until } if now > until => self.recovered(now),
            same => same,
        };
        self.has_disarmed() && !was_landed
    }

    fn idle(&mut self, now: u64, is_armed: bool, is_throttle_low: bool) -> Phase {
        if !is_armed {
            self.throttle_until = 0;
            return Phase::Idle;
        }
        if !is_throttle_low {
            self.throttle_until = now + u64::from(self.settings.throttle_low_delay_ds) * 100;
        }
        if self.is_link_up {
            Phase::Idle
        } else if now > self.throttle_until || self.settings.procedure == Procedure::Drop {
            self.landed(now)
        } else {
            let until = now + u64::from(self.settings.landing_s) * 1_000;
            Phase::Landing { until }
        }
    }

    fn landed(&self, now: u64) -> Phase {
        let until = now + self.recovery_ms();
        Phase::Landed { until }
    }

    fn recovered(&mut self, now: u64) -> Phase {
        self.throttle_until = now + u64::from(self.settings.throttle_low_delay_ds) * 100;
        Phase::Idle
    }

    fn delay_ms(&self) -> u64 {
        (u64::from(self.settings.delay_ds) * 100).max(PERIOD_MIN_MS)
    }

    fn recovery_ms(&self) -> u64 {
        (u64::from(self.settings.recovery_delay_ds) * 100).max(PERIOD_MIN_MS)
    }

    /// Time after the last frame, switch or sticks until nothing changes any more while disarmed.
    pub(crate) fn settling_ms(settings: &FailsafeSettings) -> u64 {
        let slow = u64::from(settings.delay_ds) + 2 * u64::from(settings.recovery_delay_ds);
        MONITORED_FROM_MS + slow * 100 + 4 * PERIOD_MIN_MS
    }
}
