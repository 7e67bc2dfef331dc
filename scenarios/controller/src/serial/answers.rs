//! What a controller answers: who it is, and how it is set up. Layouts are the codec's.

use muster_msp::{
    AdvancedConfig, ApiVersion, ArmingConfig, BatteryConfig, BoardInfo, BoxIds, BoxNames,
    CellLimits, CfSerialConfig, FailsafeConfig, FailsafeProcedure, FailsafeSwitch, FcVariant,
    FcVersion, FeatureConfig, Letters, Message, Mode, ModeRange, ModeRangeExtra, ModeRanges,
    ModeRangesExtra, MotorProtocol, Name, PidAdvanced, RatesType, RcTuning, RxConfig, RxFail,
    RxFailConfig, RxFailMode, RxMap, SerialPort, ShortList, ShortText, Text, ThrottleLimit, Uid,
    Unused,
};

use super::{Request, Serial};
use crate::firmware::settings::{self, Procedure, ReceiverMode, Settings, Tuning, Version};

/// Modes in the order of the bits of `STATUS`. MSP OVERRIDE is there if its mask isn't empty.
const MODES: [Mode; 6] = [
    Mode::Arm,
    Mode::Angle,
    Mode::Horizon,
    Mode::Failsafe,
    Mode::Prearm,
    Mode::Paralyze,
];

/// Places for mode ranges (`MAX_MODE_ACTIVATION_CONDITION_COUNT`).
const MODE_RANGES: usize = 20;

/// The first versions with API 1.47 and 1.48.
const API_47: Version = Version::V4_6;
const API_48: Version = Version::DROPS_STALE_OVERRIDE;

impl Settings {
    /// Modes in the order of the bits of `STATUS`.
    pub(crate) fn mode_order(&self) -> impl Iterator<Item = Mode> {
        let has_override = matches!(
            self.receiver,
            ReceiverMode::Override { channels_mask, .. } if channels_mask != 0
        );
        let last = has_override.then_some(Mode::MspOverride);
        MODES.into_iter().chain(last)
    }

    /// Number of arming-disable flags that the version knows; the last one is `ARM_SWITCH`.
    pub(crate) fn arming_flags(&self) -> u8 {
        if self.version >= API_47 { 29 } else { 26 }
    }
}

impl Serial {
    /// Answers who the controller is. Yields whether it knew the command.
    pub(crate) fn identify(&mut self, request: &Request, settings: &Settings) -> bool {
        let Version {
            major,
            minor,
            patch,
        } = settings.version;
        match request.command {
            ApiVersion::COMMAND => {
                let minor = match settings.version {
                    version if version >= API_48 => 48,
                    version if version >= API_47 => 47,
                    _ => 46,
                };
                let (protocol, major) = (0, 1);
                let version = ApiVersion {
                    protocol,
                    major,
                    minor,
                };
                self.reply(request, &version);
            }
            FcVariant::COMMAND => {
                let variant = Letters(*b"BTFL");
                self.reply(request, &FcVariant { variant });
            }
            FcVersion::COMMAND => {
                let named = format!("20{major}.{minor}.{patch}");
                let text = (settings.version >= API_48).then_some(ShortText(named));
                let version = FcVersion {
                    major,
                    minor,
                    patch,
                    text,
                };
                self.reply(request, &version);
            }
            BoardInfo::COMMAND => self.reply(request, &board(settings)),
            Uid::COMMAND => self.reply(request, &Uid { uid: [0, 1, 2] }),
            Name::COMMAND => {
                let name = Text("simulated".into());
                self.reply(request, &Name { name });
            }
            _ => return false,
        }
        true
    }

    /// Answers how modes, battery, motors and ports are set up. Yields whether it knew the command.
    pub(crate) fn describe(&mut self, request: &Request, settings: &Settings) -> bool {
        match request.command {
            BoxIds::COMMAND => {
                let modes = settings.mode_order().collect();
                self.reply(request, &BoxIds { modes });
            }
            BoxNames::COMMAND => {
                let names = settings.mode_order().map(|mode| format!("{mode};"));
                let names = Text(names.collect());
                self.reply(request, &BoxNames { names });
            }
            ModeRanges::COMMAND => {
                let mut ranges: Vec<_> = settings.modes.iter().map(mode_range).collect();
                ranges.resize(MODE_RANGES, ModeRange::default());
                self.reply(request, &ModeRanges { ranges });
            }
            ModeRangesExtra::COMMAND => {
                let plain = |mode| ModeRangeExtra {
                    mode,
                    ..ModeRangeExtra::default()
                };
                let mut extras: Vec<_> = settings.modes.iter().map(|it| plain(it.mode)).collect();
                extras.resize(MODE_RANGES, ModeRangeExtra::default());
                let extras = ShortList(extras);
                self.reply(request, &ModeRangesExtra { extras });
            }
            BatteryConfig::COMMAND => self.reply(request, &battery(settings)),
            AdvancedConfig::COMMAND => {
                let config = AdvancedConfig {
                    gyro_denominator: 1,
                    pid_denominator: 1,
                    motor_protocol: MotorProtocol::Pwm,
                    motor_hz: 480,
                    idle_percent_e2: hundredths(settings.tuning.idle * 100.0),
                    ..AdvancedConfig::default()
                };
                self.reply(request, &config);
            }
            RcTuning::COMMAND => self.reply(request, &rates(settings)),
            PidAdvanced::COMMAND => {
                let angle_limit_deg = whole(settings.tuning.angle_limit_deg);
                let advanced = PidAdvanced {
                    angle_limit_deg,
                    ..PidAdvanced::default()
                };
                self.reply(request, &advanced);
            }
            CfSerialConfig::COMMAND => {
                let port = SerialPort {
                    identifier: SerialPort::USB,
                    functions: SerialPort::MSP,
                    msp_speed: 5,
                    ..SerialPort::default()
                };
                self.reply(request, &CfSerialConfig { ports: vec![port] });
            }
            ArmingConfig::COMMAND => {
                let config = ArmingConfig {
                    auto_disarm_s: 5,
                    small_angle_deg: settings.small_angle_deg,
                    gyro_calibration: Some(0),
                    unused: Unused,
                };
                self.reply(request, &config);
            }
            _ => return self.describe_receiver(request, settings),
        }
        true
    }

    fn describe_receiver(&mut self, request: &Request, settings: &Settings) -> bool {
        match request.command {
            RxMap::COMMAND => self.reply(request, &RxMap::AETR),
            RxConfig::COMMAND => {
                let config = RxConfig {
                    max_check_us: 1_900,
                    centre_us: 1_500,
                    min_check_us: crate::firmware::THROTTLE_LOW_US,
                    rx_min_us: 885,
                    rx_max_us: 2_115,
                    ..RxConfig::default()
                };
                self.reply(request, &config);
            }
            FailsafeConfig::COMMAND => self.reply(request, &failsafe(settings)),
            RxFailConfig::COMMAND => {
                let channels = settings.rxfail.iter().map(rxfail).collect();
                self.reply(request, &RxFailConfig { channels });
            }
            FeatureConfig::COMMAND => {
                let receiver = match settings.receiver {
                    ReceiverMode::Sole => FeatureConfig::RX_MSP,
                    ReceiverMode::Override { .. } => FeatureConfig::RX_SERIAL,
                };
                let features = receiver | FeatureConfig::GPS;
                self.reply(request, &FeatureConfig { features });
            }
            _ => return false,
        }
        true
    }
}

fn board(settings: &Settings) -> BoardInfo {
    let board = if settings.reports_simulator {
        *b"SITL"
    } else {
        *b"S405"
    };
    let text = |text: &str| Some(ShortText(text.into()));
    BoardInfo {
        board: Letters(board),
        kind: Some(0),
        capabilities: Some(0),
        target: text("MUSTER"),
        name: text("simulated"),
        manufacturer: text("muster"),
        signature: Some(Unused),
        mcu: Some(255),
        configuration: Some(2),
        gyro_hz: Some(1_000),
        problems: Some(0),
        ..BoardInfo::default()
    }
}

/// The model's rates are of the type ACTUAL, its throttle goes straight to the motors.
fn rates(settings: &Settings) -> RcTuning {
    let Tuning {
        centre_rate_dps,
        max_rate_dps,
        ..
    } = settings.tuning;
    let (centre, max) = (whole(centre_rate_dps / 10.0), whole(max_rate_dps / 10.0));
    RcTuning {
        roll_rc_rate: centre,
        srates: [max; 3],
        throttle_mid: 50,
        yaw_rc_rate: centre,
        pitch_rc_rate: Some(centre),
        pitch_expo: Some(0),
        throttle_limit: Some(ThrottleLimit::Off),
        throttle_limit_percent: Some(100),
        rate_limits_dps: Some([1_998; 3]),
        rates_type: Some(RatesType::Actual),
        throttle_hover: (settings.version >= API_47).then_some(50),
        ..RcTuning::default()
    }
}

fn mode_range(range: &settings::ModeRange) -> ModeRange {
    let step = |us: u16| u8::try_from(us.saturating_sub(900) / 25).unwrap_or(u8::MAX);
    ModeRange {
        mode: range.mode,
        aux: range.aux,
        first_step: step(range.range_us.start),
        end_step: step(range.range_us.end),
    }
}

fn battery(settings: &Settings) -> BatteryConfig {
    let settings::CellLimits {
        min_cv,
        warning_cv,
        max_cv,
    } = settings.cell;
    let tenths = |cv: u16| u8::try_from((cv + 5) / 10).unwrap_or(u8::MAX);
    BatteryConfig {
        min_dv: tenths(min_cv),
        max_dv: tenths(max_cv),
        warning_dv: tenths(warning_cv),
        capacity_mah: 0,
        voltage_source: 1,
        current_source: 1,
        limits: Some(CellLimits {
            min_cv,
            max_cv,
            warning_cv,
        }),
    }
}

fn failsafe(settings: &Settings) -> FailsafeConfig {
    let failsafe = &settings.failsafe;
    FailsafeConfig {
        delay_ds: failsafe.delay_ds,
        landing_s: failsafe.landing_s,
        throttle_us: failsafe.throttle_us,
        switch: FailsafeSwitch::Stage1,
        throttle_low_delay_ds: failsafe.throttle_low_delay_ds,
        procedure: match failsafe.procedure {
            Procedure::Drop => FailsafeProcedure::Drop,
            Procedure::Land => FailsafeProcedure::AutoLand,
        },
    }
}

fn rxfail(rxfail: &settings::RxFail) -> RxFail {
    let (mode, value_us) = match rxfail {
        settings::RxFail::Auto => (RxFailMode::Auto, 1_500),
        settings::RxFail::Hold => (RxFailMode::Hold, 1_500),
        settings::RxFail::Set(value_us) => (RxFailMode::Set, *value_us),
    };
    RxFail { mode, value_us }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the cast saturates"
)]
fn whole(value: f64) -> u8 {
    (value + 0.5) as u8
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the cast saturates, and a share is from 0 to 1"
)]
fn hundredths(percent: f64) -> u16 {
    (percent * 100.0 + 0.5) as u16
}
