//! What a user sets in Betaflight's command line, as far as the model follows it.

use std::ops::Range;

use muster_msp::Mode;

/// Channels of a receiver: roll, pitch, yaw and throttle, then 14 auxiliary ones.
pub const CHANNELS: usize = 18;

/// Version of the firmware; Betaflight 2025.12.1 is 25.12.1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Version {
    /// First number.
    pub major: u8,
    /// Second number.
    pub minor: u8,
    /// Third number.
    pub patch: u8,
}

impl Version {
    /// The version that the laboratory has measured.
    pub const V4_6: Self = Self {
        major: 4,
        minor: 6,
        patch: 0,
    };

    /// The first version that drops override values of a silent companion (Betaflight's change 15217).
    pub const DROPS_STALE_OVERRIDE: Self = Self {
        major: 26,
        minor: 6,
        patch: 0,
    };
}

/// Which receiver flies the aircraft.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReceiverMode {
    /// `feature RX_MSP`: the companion is the only receiver.
    Sole,
    /// A pilot's receiver flies; while its switch for MSP OVERRIDE is on, the companion replaces channels.
    Override {
        /// `msp_override_channels_mask`: bits in the order roll, pitch, throttle, yaw, AUX1, ….
        channels_mask: u32,
        /// `msp_override_failsafe`: whether the companion's frames count as the pilot's signal.
        counts_as_signal: bool,
    },
}

/// Value of a channel while the receiver's signal is lost (`rxfail`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RxFail {
    /// Sticks centred, throttle at 885 µs.
    Auto,
    /// The last good value.
    Hold,
    /// A value in µs.
    Set(u16),
}

/// What stage 2 of the failsafe does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Procedure {
    /// `DROP`: disarm.
    Drop,
    /// `AUTO-LAND`: level, at the failsafe throttle, then disarm.
    Land,
}

/// Settings of the failsafe.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FailsafeSettings {
    /// `failsafe_delay`: from the last good frame to stage 2, in tenths of a second.
    pub delay_ds: u8,
    /// `failsafe_landing_time`: longest stage 2 of `Land`, in seconds.
    pub landing_s: u8,
    /// `failsafe_throttle`, in µs.
    pub throttle_us: u16,
    /// `failsafe_throttle_low_delay`: time of low throttle after which stage 2 disarms whatever the procedure, in tenths of a
    /// second.
    pub throttle_low_delay_ds: u16,
    /// `failsafe_recovery_delay`: good frames needed before the signal counts as back, in tenths of a second.
    pub recovery_delay_ds: u8,
    /// `failsafe_procedure`.
    pub procedure: Procedure,
}

/// A mode (box) with the channel and the range that switch it on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ModeRange {
    /// Which mode.
    pub mode: Mode,
    /// Auxiliary channel; 0 is AUX1.
    pub aux: u8,
    /// Values in µs. The end is outside.
    pub range_us: Range<u16>,
}

/// Limits of a cell, in hundredths of a volt (`vbat_*_cell_voltage`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CellLimits {
    /// Critical below it.
    pub min_cv: u16,
    /// Warning below it.
    pub warning_cv: u16,
    /// Highest voltage; divides the voltage at the start into cells.
    pub max_cv: u16,
}

/// Gains of a rate controller, as numbers of the command line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gains {
    /// Proportional.
    pub p: f64,
    /// Integral.
    pub i: f64,
    /// Derivative.
    pub d: f64,
}

/// Settings of the controllers of rates and angles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tuning {
    /// Roll, pitch, yaw.
    pub gains: [Gains; 3],
    /// `angle_p_gain`: strength of angle mode; a tenth of it is the rate for an angle, in 1/s.
    pub angle_p: f64,
    /// `angle_limit`, in degrees.
    pub angle_limit_deg: f64,
    /// Rate for small deflections, extended to a full one, in °/s (rates type ACTUAL).
    pub centre_rate_dps: f64,
    /// Rate at full deflection, in °/s.
    pub max_rate_dps: f64,
    /// Duty cycle of idle motors while armed, as a fraction of one.
    pub idle: f64,
}

/// All settings.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Version that the firmware says it has; decides what an override does with a silent companion.
    pub version: Version,
    /// Whether `BOARD_INFO` reports a simulator.
    pub reports_simulator: bool,
    /// Receiver.
    pub receiver: ReceiverMode,
    /// Channels in the order roll, pitch, yaw, throttle, AUX1, ….
    pub rxfail: [RxFail; CHANNELS],
    /// Failsafe.
    pub failsafe: FailsafeSettings,
    /// Modes.
    pub modes: Vec<ModeRange>,
    /// `small_angle`: tilt up to which it arms, in degrees.
    pub small_angle_deg: u8,
    /// Time between two commands of a port, in milliseconds: 1,000 / `serial_update_rate_hz`.
    pub serial_period_ms: u16,
    /// Battery.
    pub cell: CellLimits,
    /// Controllers.
    pub tuning: Tuning,
}

impl Settings {
    /// Betaflight 4.6's defaults with a sole receiver, ARM on AUX1 from 1,700 µs and ANGLE on AUX2 from 1,300 µs.
    ///
    /// Sources: the reset templates in Betaflight's `failsafe.c`, `rx.c`, `battery.c`, `pid.c` and `controlrate_profile.c`.
    #[must_use]
    pub fn sole() -> Self {
        let mut rxfail = [RxFail::Hold; CHANNELS];
        rxfail[..4].fill(RxFail::Auto);
        Self {
            version: Version::V4_6,
            reports_simulator: true,
            receiver: ReceiverMode::Sole,
            rxfail,
            failsafe: FailsafeSettings {
                delay_ds: 15,
                landing_s: 60,
                throttle_us: 1_000,
                throttle_low_delay_ds: 100,
                recovery_delay_ds: 5,
                procedure: Procedure::Drop,
            },
            modes: vec![
                ModeRange {
                    mode: Mode::Arm,
                    aux: 0,
                    range_us: 1_700..2_100,
                },
                ModeRange {
                    mode: Mode::Angle,
                    aux: 1,
                    range_us: 1_300..2_100,
                },
            ],
            small_angle_deg: 25,
            serial_period_ms: 10,
            cell: CellLimits {
                min_cv: 330,
                warning_cv: 350,
                max_cv: 430,
            },
            tuning: Tuning::default(),
        }
    }

    /// As [`Settings::sole`], and fit to fly: when RC stops, the Agilicious quadrotor sinks with less than 2.5 m/s, as its
    /// legs survive; without feedforward it leans as fast as Betaflight's defaults do with it.
    #[must_use]
    pub fn fit() -> Self {
        let mut settings = Self::sole();
        settings.failsafe.procedure = Procedure::Land;
        settings.failsafe.delay_ds = 4;
        settings.failsafe.throttle_us = 1_295;
        settings.tuning.angle_p = 80.0;
        settings
    }

    /// As [`Settings::fit`], with a pilot's receiver: the first version that gives the sticks back when RC stops.
    #[must_use]
    pub fn fit_overriding() -> Self {
        let Self {
            failsafe, tuning, ..
        } = Self::fit();
        Self {
            failsafe,
            tuning,
            ..Self::overriding(Version::DROPS_STALE_OVERRIDE)
        }
    }

    /// As [`Settings::sole`], with a pilot's receiver; the companion may replace the four sticks while AUX3 is above 1,700 µs.
    #[must_use]
    pub fn overriding(version: Version) -> Self {
        let mut settings = Self::sole();
        settings.version = version;
        settings.receiver = ReceiverMode::Override {
            channels_mask: 0b1111,
            counts_as_signal: false,
        };
        for angle in settings
            .modes
            .iter_mut()
            .filter(|it| it.mode == Mode::Angle)
        {
            angle.range_us = 900..2_100;
        }
        settings.modes.push(ModeRange {
            mode: Mode::MspOverride,
            aux: 2,
            range_us: 1_700..2_100,
        });
        settings
    }
}

impl Default for Tuning {
    /// Betaflight 4.5 and 4.6: gains 45 80 30, 47 84 34, 45 80 0; angle 50 and 60°; rates ACTUAL 70 and 670 °/s; idle 5.5 %.
    fn default() -> Self {
        let gains = |p, i, d| Gains { p, i, d };
        Self {
            gains: [
                gains(45.0, 80.0, 30.0),
                gains(47.0, 84.0, 34.0),
                gains(45.0, 80.0, 0.0),
            ],
            angle_p: 50.0,
            angle_limit_deg: 60.0,
            centre_rate_dps: 70.0,
            max_rate_dps: 670.0,
            idle: 0.055,
        }
    }
}
