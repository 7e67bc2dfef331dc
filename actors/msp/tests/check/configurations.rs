//! Crafts that are safe to fly.

use muster_msp::{
    AdvancedConfig, BatteryConfig, CellLimits, CfSerialConfig, CommandLineSettings, Configuration,
    FailsafeConfig, FailsafeProcedure, FcVersion, FeatureConfig, Identity, Letters, Mode,
    ModeRange, ModeRangeExtra, ModeRanges, ModeRangesExtra, MotorProtocol, OverrideSettings,
    PidAdvanced, RatesType, RcTuning, RxConfig, RxFail, RxFailConfig, RxFailMode, RxMap,
    SerialPort, ShortList, ThrottleLimit,
};

pub(crate) fn range(mode: Mode, aux: u8, first_us: u16, end_us: u16) -> ModeRange {
    let step = |us: u16| u8::try_from((us - 900) / 25).expect("a mode's step");
    ModeRange {
        mode,
        aux,
        first_step: step(first_us),
        end_step: step(end_us),
    }
}

/// Ranges of these modes, which nothing is linked with.
pub(crate) fn plain(modes: &[Mode]) -> ModeRangesExtra {
    let plain = |mode| ModeRangeExtra {
        mode,
        ..ModeRangeExtra::default()
    };
    let extras = ShortList(modes.iter().copied().map(plain).collect());
    ModeRangesExtra { extras }
}

pub(crate) fn lost(mode: RxFailMode, value_us: u16) -> RxFail {
    RxFail { mode, value_us }
}

pub(crate) fn port(identifier: u8, functions: u16, msp_speed: u8) -> SerialPort {
    SerialPort {
        identifier,
        functions,
        msp_speed,
        ..SerialPort::default()
    }
}

pub(crate) fn version(major: u8, minor: u8, patch: u8) -> FcVersion {
    FcVersion {
        major,
        minor,
        patch,
        ..FcVersion::default()
    }
}

/// A safe configuration that MSP alone flies.
pub(crate) fn sole() -> Configuration {
    let mut identity = Identity::default();
    identity.variant.variant = Letters(*b"BTFL");
    identity.version = version(4, 6, 0);
    identity.board.board = Letters(*b"S405");
    let mut channels = vec![lost(RxFailMode::Auto, 1500); 4];
    channels.resize(18, lost(RxFailMode::Hold, 1500));
    Configuration {
        identity,
        features: FeatureConfig {
            features: FeatureConfig::RX_MSP,
        },
        map: RxMap::AETR,
        receiver: RxConfig {
            min_check_us: 1050,
            max_check_us: 1900,
            centre_us: 1500,
            rx_min_us: 885,
            rx_max_us: 2115,
            ..RxConfig::default()
        },
        lost: RxFailConfig { channels },
        failsafe: FailsafeConfig {
            delay_ds: 10,
            landing_s: 60,
            throttle_us: 1400,
            throttle_low_delay_ds: 100,
            procedure: FailsafeProcedure::AutoLand,
            ..FailsafeConfig::default()
        },
        ranges: ModeRanges {
            ranges: vec![
                range(Mode::Arm, 0, 1700, 2100),
                range(Mode::Angle, 1, 1300, 2100),
                ModeRange::default(),
            ],
        },
        extras: plain(&[Mode::Arm, Mode::Angle, Mode::Arm]),
        battery: BatteryConfig {
            voltage_source: 1,
            limits: Some(CellLimits {
                min_cv: 330,
                max_cv: 430,
                warning_cv: 350,
            }),
            ..BatteryConfig::default()
        },
        serial: CfSerialConfig {
            ports: vec![port(20, 1, 5), port(51, 1, 5), port(52, 64, 0)],
        },
        motors: AdvancedConfig {
            motor_protocol: MotorProtocol::Dshot300,
            ..AdvancedConfig::default()
        },
        rates: RcTuning {
            roll_rc_rate: 7,
            srates: [67; 3],
            throttle_mid: 50,
            yaw_rc_rate: 7,
            pitch_rc_rate: Some(7),
            pitch_expo: Some(0),
            throttle_limit: Some(ThrottleLimit::Off),
            rate_limits_dps: Some([1998; 3]),
            rates_type: Some(RatesType::Actual),
            throttle_hover: Some(50),
            ..RcTuning::default()
        },
        angle: PidAdvanced {
            angle_limit_deg: 60,
            ..PidAdvanced::default()
        },
        ..Configuration::default()
    }
}

/// A safe configuration with a pilot's receiver.
pub(crate) fn overridden() -> Configuration {
    let mut configuration = sole();
    configuration.features.features = FeatureConfig::RX_SERIAL;
    configuration.identity.version = version(26, 6, 0);
    configuration.identity.boxes.modes = vec![Mode::Arm, Mode::Angle, Mode::MspOverride];
    configuration.ranges.ranges[1] = range(Mode::Angle, 1, 900, 2100);
    configuration
        .ranges
        .ranges
        .push(range(Mode::MspOverride, 2, 1700, 2100));
    configuration.extras = plain(&[Mode::Arm, Mode::Angle, Mode::Arm, Mode::MspOverride]);
    configuration.command_line = Some(CommandLineSettings {
        over_ride: Some(OverrideSettings {
            mask: 15,
            failsafe: Some(false),
        }),
        angle_feedforward: Some(0),
    });
    configuration
}
