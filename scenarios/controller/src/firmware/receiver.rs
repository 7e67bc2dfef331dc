//! Receivers: whose channels fly, and what they are while a signal is lost.
//!
//! Behaviour and figures: Betaflight 4.5, `rx/rx.c`, `rx/msp.c` and `rx/msp_override.c`. Times are milliseconds since boot.

use super::settings::{CHANNELS, ReceiverMode, RxFail, Settings, Version};

pub(crate) const ROLL: usize = 0;
pub(crate) const PITCH: usize = 1;
pub(crate) const YAW: usize = 2;
pub(crate) const THROTTLE: usize = 3;

/// Roll, pitch, yaw, throttle.
pub(crate) const FLIGHT_CHANNELS: usize = 4;

/// Stick centre, in µs.
pub(crate) const CENTRE_US: u16 = 1_500;

/// Lowest and highest valid value, in µs (`rx_min_usec`, `rx_max_usec`).
const VALID_US: std::ops::RangeInclusive<u16> = 885..=2_115;

/// Time without a frame after which the signal is lost.
const SIGNAL_LOST_MS: u64 = 150;

/// Time for which a channel without good values keeps the last one.
const HOLD_MS: u64 = 300;

/// Age up to which newer firmware uses override values.
const OVERRIDE_FRESH_MS: u64 = 300;

/// Time between looks at a lost signal: up to Betaflight 4.5, and from 4.6 on.
const RECHECK_MS: u64 = 100;
const RECHECK_NEWER_MS: u64 = 50;

/// Channels as frames carry them: roll, pitch, throttle, yaw, AUX1, … (map AETR). Missing ones are 0.
pub(crate) type Raw = [u16; CHANNELS];

/// Where a channel in the order roll, pitch, yaw, throttle is in a frame.
fn raw_index(channel: usize) -> usize {
    match channel {
        YAW => 2 + 1,
        THROTTLE => 2,
        other => other,
    }
}

/// Converts channels in the order roll, pitch, yaw, throttle to a frame's.
pub(crate) fn raw(channels: &[u16; CHANNELS]) -> Raw {
    let mut raw = *channels;
    for (channel, &value) in channels.iter().enumerate().take(FLIGHT_CHANNELS) {
        raw[raw_index(channel)] = value;
    }
    raw
}

/// What a look at the receiver found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Look {
    /// No frame, and none missing yet.
    Idle,
    /// Channels were computed; all flight channels are good.
    Good,
    /// Channels were computed; the signal or a flight channel is lost.
    Bad,
}

#[derive(Debug, Clone)]
pub(crate) struct Receiver {
    mode: ReceiverMode,
    version: Version,
    rxfail: [RxFail; CHANNELS],
    /// The companion's last frame.
    msp: Raw,
    msp_at: Option<u64>,
    has_msp_frame: bool,
    /// The pilot's sticks; `None` while the transmitter is off.
    pilot: Option<Raw>,
    /// Fault: no receiver hears anything.
    pub(crate) is_deaf: bool,
    is_receiving: bool,
    next_look: u64,
    good_until: [u64; CHANNELS],
    /// In the order roll, pitch, yaw, throttle, AUX1, ….
    channels: [u16; CHANNELS],
}

impl Receiver {
    pub(crate) fn new(settings: &Settings) -> Self {
        let mut channels = [CENTRE_US; CHANNELS];
        channels[THROTTLE] = *VALID_US.start();
        // Until a frame says otherwise, switches are off.
        for mode in &settings.modes {
            if let Some(channel) = channels.get_mut(FLIGHT_CHANNELS + usize::from(mode.aux)) {
                *channel = mode.range_us.start.saturating_sub(25);
            }
        }
        Self {
            mode: settings.receiver,
            version: settings.version,
            rxfail: settings.rxfail,
            msp: [0; CHANNELS],
            msp_at: None,
            has_msp_frame: false,
            pilot: None,
            is_deaf: false,
            is_receiving: false,
            next_look: SIGNAL_LOST_MS,
            good_until: [0; CHANNELS],
            channels,
        }
    }

    /// Takes a frame of the companion's.
    pub(crate) fn receive(&mut self, now: u64, raw: Raw) {
        if !self.is_deaf {
            self.msp = raw;
            self.msp_at = Some(now);
            self.has_msp_frame = true;
        }
    }

    /// Sets the pilot's sticks; `None` switches the transmitter off.
    pub(crate) fn pilot(&mut self, raw: Option<Raw>) {
        self.pilot = raw;
    }

    pub(crate) fn is_receiving(&self) -> bool {
        self.is_receiving
    }

    /// Channels in µs, in the order roll, pitch, yaw, throttle, AUX1, ….
    pub(crate) fn channels(&self) -> &[u16; CHANNELS] {
        &self.channels
    }

    /// Looks for frames. `stage_2_us` is the failsafe's throttle while its stage 2 is on.
    pub(crate) fn look(&mut self, now: u64, is_override_on: bool, stage_2_us: Option<u16>) -> Look {
        let has_msp_frame = std::mem::take(&mut self.has_msp_frame);
        let pilot = self.pilot.filter(|_| !self.is_deaf);
        let arrived = match self.mode {
            ReceiverMode::Sole => has_msp_frame,
            ReceiverMode::Override {
                counts_as_signal, ..
            } => pilot.is_some() || (counts_as_signal && is_override_on && has_msp_frame),
        };
        if arrived {
            self.is_receiving = true;
            self.next_look = now + SIGNAL_LOST_MS;
        } else if now >= self.next_look {
            self.is_receiving = false;
            self.next_look = now + self.recheck_ms();
        } else {
            return Look::Idle;
        }
        let raw = self.chosen(now, pilot, is_override_on);
        self.compute(now, &raw, stage_2_us)
    }

    fn recheck_ms(&self) -> u64 {
        if self.version >= Version::V4_6 {
            RECHECK_NEWER_MS
        } else {
            RECHECK_MS
        }
    }

    /// The frame that counts: the companion's, the pilot's, or the pilot's with the companion's channels.
    fn chosen(&self, now: u64, pilot: Option<Raw>, is_override_on: bool) -> Raw {
        let ReceiverMode::Override { channels_mask, .. } = self.mode else {
            return self.msp;
        };
        let mut raw = pilot.unwrap_or_default();
        let is_fresh = self.version < Version::DROPS_STALE_OVERRIDE
            || self.msp_at.is_some_and(|at| now - at <= OVERRIDE_FRESH_MS);
        if is_override_on && is_fresh {
            for (index, value) in raw.iter_mut().enumerate() {
                if channels_mask >> index & 1 == 1 {
                    *value = self.msp[index].clamp(*VALID_US.start(), *VALID_US.end());
                }
            }
        }
        raw
    }

    fn compute(&mut self, now: u64, raw: &Raw, stage_2_us: Option<u16>) -> Look {
        let mut is_good = self.is_receiving;
        for channel in 0..CHANNELS {
            let value = raw[raw_index(channel)];
            let is_valid = is_good && VALID_US.contains(&value);
            if is_valid {
                self.good_until[channel] = now + HOLD_MS;
            }
            let is_flight = channel < FLIGHT_CHANNELS;
            self.channels[channel] = match stage_2_us {
                Some(_) if is_flight && is_valid => value,
                Some(throttle_us) if channel == THROTTLE => throttle_us,
                Some(_) if is_flight => CENTRE_US,
                Some(_) => self.fallback(channel),
                None if is_valid => value,
                None if now < self.good_until[channel] => self.channels[channel],
                None => {
                    is_good &= !is_flight;
                    self.fallback(channel)
                }
            };
        }
        if is_good { Look::Good } else { Look::Bad }
    }

    fn fallback(&self, channel: usize) -> u16 {
        match (self.rxfail[channel], channel) {
            (RxFail::Set(value_us), _) => value_us,
            (RxFail::Auto, ROLL | PITCH | YAW) => CENTRE_US,
            (RxFail::Auto, THROTTLE) => *VALID_US.start(),
            (RxFail::Auto | RxFail::Hold, _) => self.channels[channel],
        }
    }
}
