//! Each rule finds the one setting that breaks it, and nothing else; a safe configuration breaks none.

mod configurations;
mod modes;

use muster_msp::check::{Finding, ReceiverMode, check};
use muster_msp::{
    Ask, CellLimits, CommandLineSettings, Configuration, Decode, Decoder, Encode,
    FailsafeProcedure, FeatureConfig, Letters, Message, Mode, ModeLogic, ModeRangesExtra,
    MotorProtocol, OverrideSettings, RatesType, RxFailMode, ThrottleLimit, Version, order,
};
use serde::Deserialize;

use self::configurations::{lost, overridden, plain, range, sole, version};

fn rules(findings: &[Finding]) -> Vec<&'static str> {
    findings.iter().map(|it| it.rule).collect()
}

#[test]
fn a_safe_configuration_breaks_no_rule() {
    assert_eq!(check(&sole(), ReceiverMode::Sole), []);
    assert_eq!(check(&overridden(), ReceiverMode::Override), []);
}

/// A change of a configuration.
type Change = fn(&mut Configuration);

const SOLE: [(&str, Change); 29] = [
    ("firmware", |it| {
        it.identity.variant.variant = Letters(*b"INAV");
    }),
    ("receiver", |it| {
        it.features.features = FeatureConfig::RX_SERIAL;
    }),
    ("map", |it| {
        it.map.map = [1, 2, 3, 0, 4, 5, 6, 7];
    }),
    ("rx_min_usec", |it| {
        it.receiver.rx_min_us = 1005;
    }),
    ("rx_max_usec", |it| {
        it.receiver.rx_max_us = 1995;
    }),
    ("min_check", |it| {
        it.receiver.min_check_us = 1000;
    }),
    ("failsafe-procedure", |it| {
        it.failsafe.procedure = FailsafeProcedure::Drop;
    }),
    ("failsafe-procedure", |it| {
        it.failsafe.procedure = FailsafeProcedure::GpsRescue;
    }),
    ("failsafe-throttle", |it| {
        it.failsafe.throttle_us = 1000;
    }),
    ("failsafe-throttle", |it| {
        it.failsafe.throttle_us = 1800;
    }),
    ("failsafe-landing-time", |it| {
        it.failsafe.landing_s = 3;
    }),
    ("failsafe-landing-time", |it| {
        it.failsafe.landing_s = 250;
    }),
    ("failsafe-throttle-low-delay", |it| {
        it.failsafe.throttle_low_delay_ds = 5;
    }),
    ("failsafe-delay", |it| {
        it.failsafe.delay_ds = 15;
    }),
    ("failsafe-delay", |it| {
        it.failsafe.delay_ds = 1;
    }),
    ("rxfail-stick", |it| {
        it.lost.channels[1].mode = RxFailMode::Hold;
    }),
    ("rxfail-throttle", |it| {
        it.lost.channels[3].mode = RxFailMode::Hold;
    }),
    ("rxfail-throttle", |it| {
        it.lost.channels[3] = lost(RxFailMode::Set, 1900);
    }),
    ("rxfail-arm", |it| {
        it.lost.channels[4] = lost(RxFailMode::Set, 1000);
    }),
    ("rxfail-arm", |it| {
        it.lost.channels[4] = lost(RxFailMode::Set, 1800);
    }),
    ("rxfail-channels", |it| {
        it.lost.channels.clear();
    }),
    ("rxfail-channels", |it| {
        it.lost.channels.truncate(4);
    }),
    ("arm-mode", |it| {
        it.ranges.ranges.remove(0);
    }),
    ("arm-mode", |it| {
        it.ranges.ranges.push(range(Mode::Arm, 3, 1700, 2100));
    }),
    ("arm-range", |it| {
        it.ranges.ranges[0] = range(Mode::Arm, 0, 1300, 2100);
    }),
    ("arm-range", |it| {
        it.ranges.ranges[0] = range(Mode::Arm, 0, 1700, 1900);
    }),
    ("angle-mode", |it| {
        it.ranges.ranges.remove(1);
    }),
    ("angle-range", |it| {
        it.ranges.ranges[1] = range(Mode::Angle, 1, 900, 1900);
    }),
    ("angle-range", |it| {
        it.ranges.ranges[1] = range(Mode::Angle, 2, 1300, 2100);
    }),
];

const STICKS: [(&str, Change); 18] = [
    ("angle-firmware", |it| {
        it.identity.version = version(4, 4, 3);
    }),
    ("angle-firmware", |it| {
        it.identity.version = version(4, 5, 1);
    }),
    ("mid_rc", |it| {
        it.receiver.centre_us = 1400;
    }),
    ("rates", |it| {
        it.rates.rates_type = Some(RatesType::Betaflight);
    }),
    ("rates", |it| {
        it.rates.rates_type = None;
    }),
    ("rates", |it| {
        it.rates.roll_rc_rate = 67;
    }),
    ("rates", |it| {
        it.rates.pitch_rc_rate = Some(6);
    }),
    ("rates", |it| {
        it.rates.srates[0] = 20;
    }),
    ("rates", |it| {
        it.rates.srates[1] = 100;
    }),
    ("rates", |it| {
        it.rates.roll_expo = 54;
    }),
    ("rates", |it| {
        it.rates.pitch_expo = Some(1);
    }),
    ("rates", |it| {
        it.rates.rate_limits_dps = Some([669, 1998, 1998]);
    }),
    ("rates", |it| {
        it.rates.rate_limits_dps = Some([1998, 200, 1998]);
    }),
    ("angle_limit", |it| {
        it.angle.angle_limit_deg = 80;
    }),
    ("angle_limit", |it| {
        it.angle.angle_limit_deg = 59;
    }),
    ("throttle-curve", |it| {
        it.rates.throttle_limit = Some(ThrottleLimit::Scale);
    }),
    ("throttle-curve", |it| {
        it.rates.throttle_expo = 30;
    }),
    ("throttle-curve", |it| {
        it.rates.throttle_hover = Some(30);
    }),
];

const OF_ANY_MODE: [(&str, Change); 11] = [
    ("small-angle", |it| {
        it.arming.small_angle_deg = 180;
    }),
    ("accelerometer", |it| {
        it.identity.board.problems = Some(1);
    }),
    ("motor-stop", |it| {
        it.features.features |= FeatureConfig::MOTOR_STOP;
    }),
    ("reversible", |it| {
        it.features.features |= FeatureConfig::REVERSIBLE;
    }),
    ("motor-protocol", |it| {
        it.motors.motor_protocol = MotorProtocol::Disabled;
    }),
    ("battery-meter", |it| {
        it.battery.voltage_source = 0;
    }),
    ("battery-min", |it| {
        cell(it).min_cv = 250;
    }),
    ("battery-max", |it| {
        cell(it).max_cv = 500;
    }),
    ("battery-warning", |it| {
        cell(it).warning_cv = 330;
    }),
    ("serial-speed", |it| {
        it.serial.ports[1].msp_speed = 4;
    }),
    ("serial-speed", |it| {
        it.serial.ports[1].msp_speed = 0;
    }),
];

const OVERRIDDEN: [(&str, Change); 22] = [
    ("receiver", |it| {
        it.features.features |= FeatureConfig::RX_MSP;
    }),
    ("receiver", |it| {
        it.features.features = 0;
    }),
    ("override-fallback", |it| {
        it.identity.version.major = 25;
    }),
    ("override-fallback", |it| {
        it.identity.version = version(4, 6, 0);
    }),
    ("command-line-unread", |it| {
        it.command_line = None;
    }),
    ("override-mask", |it| {
        command_line(it).over_ride = None;
    }),
    ("angle-feedforward", |it| {
        command_line(it).angle_feedforward = Some(50);
    }),
    ("override-mask", |it| {
        settings(it).mask = 0;
    }),
    ("override-mask", |it| {
        settings(it).mask = 7;
    }),
    ("override-mask", |it| {
        settings(it).mask = 0b10_1111;
    }),
    ("angle-range", |it| {
        it.ranges.ranges[1] = range(Mode::Angle, 1, 1300, 2100);
    }),
    ("override-failsafe", |it| {
        settings(it).failsafe = Some(true);
    }),
    ("override-failsafe", |it| {
        settings(it).failsafe = None;
    }),
    ("angle-feedforward", |it| {
        command_line(it).angle_feedforward = None;
    }),
    ("override-mode", |it| {
        it.ranges.ranges.pop();
    }),
    ("override-range", |it| {
        let switch = it
            .ranges
            .ranges
            .last_mut()
            .expect("the configuration has it");
        *switch = range(Mode::MspOverride, 2, 900, 2100);
    }),
    ("override-range", |it| {
        it.ranges.ranges[3] = range(Mode::MspOverride, 2, 1600, 1700);
    }),
    ("override-switch", |it| {
        it.ranges.ranges[3] = range(Mode::MspOverride, 0, 1700, 2100);
    }),
    ("override-switch", |it| {
        let kill = range(Mode::Failsafe, 2, 900, 1300);
        it.ranges.ranges.push(kill);
    }),
    ("override-switch", |it| {
        let stop = range(Mode::Paralyze, 2, 1700, 2100);
        it.ranges.ranges.push(stop);
    }),
    ("other-mode", |it| {
        let always = range(Mode::HeadFree, 3, 900, 2100);
        it.ranges.ranges.push(always);
    }),
    ("other-mode", |it| {
        let with_the_override = range(Mode::AltHold, 2, 1900, 2100);
        it.ranges.ranges.push(with_the_override);
    }),
];

fn cell(configuration: &mut Configuration) -> &mut CellLimits {
    configuration
        .battery
        .limits
        .as_mut()
        .expect("the configuration has them")
}

fn command_line(configuration: &mut Configuration) -> &mut CommandLineSettings {
    configuration
        .command_line
        .as_mut()
        .expect("the configuration has it")
}

fn settings(configuration: &mut Configuration) -> &mut OverrideSettings {
    let settings = command_line(configuration).over_ride.as_mut();
    settings.expect("the configuration has them")
}

#[test]
fn each_unsafe_setting_is_found_alone() {
    let cases = [
        (sole as fn() -> Configuration, ReceiverMode::Sole, &SOLE[..]),
        (sole, ReceiverMode::Sole, &STICKS),
        (sole, ReceiverMode::Sole, &OF_ANY_MODE),
        (overridden, ReceiverMode::Override, &OVERRIDDEN),
        (overridden, ReceiverMode::Override, &OF_ANY_MODE),
    ];
    for (configuration, mode, changes) in cases {
        for (rule, change) in changes {
            let mut configuration = configuration();
            change(&mut configuration);
            let modes: Vec<_> = (configuration.ranges.ranges.iter())
                .map(|it| it.mode)
                .collect();
            configuration.extras = plain(&modes);
            let findings = check(&configuration, mode);
            assert_eq!(rules(&findings), [*rule], "{mode}: {findings:?}");
            assert!(!findings[0].set.is_empty());
        }
    }
}

#[test]
fn voltages_of_any_size_are_judged() {
    let mut configuration = overridden();
    *cell(&mut configuration) = CellLimits {
        min_cv: u16::MAX,
        max_cv: u16::MAX,
        warning_cv: u16::MAX,
    };
    let findings = check(&configuration, ReceiverMode::Override);
    let expected = ["battery-min", "battery-max"];
    assert_eq!(rules(&findings), expected);
    cell(&mut configuration).max_cv = 430;
    let findings = check(&configuration, ReceiverMode::Override);
    assert_eq!(rules(&findings), ["battery-min", "battery-warning"]);
}

/// Yaw is left centred, a straight throttle may have its middle anywhere, and older firmware has no `thr_hover`.
#[test]
fn rates_that_flight_by_sticks_does_not_use_are_free() {
    let free: [Change; 4] = [
        |it| it.rates.srates[2] = 40,
        |it| (it.rates.yaw_rc_rate, it.rates.yaw_expo) = (20, 30),
        |it| (it.rates.throttle_mid, it.rates.throttle_hover) = (30, Some(30)),
        |it| (it.rates.throttle_mid, it.rates.throttle_hover) = (30, None),
    ];
    for change in free {
        let mut configuration = sole();
        change(&mut configuration);
        assert_eq!(check(&configuration, ReceiverMode::Sole), []);
    }
}

#[test]
fn a_finding_about_rates_names_and_mends_only_what_differs() {
    let mut configuration = sole();
    configuration.rates.rates_type = Some(RatesType::Quick);
    configuration.rates.pitch_expo = Some(20);
    let findings = check(&configuration, ReceiverMode::Sole);
    assert_eq!(findings[0].found, "rates_type = QUICK, pitch_expo = 20");
    let set = "set rates_type = ACTUAL\nset pitch_expo = 0";
    assert_eq!(findings[0].set, set);
}

#[test]
fn other_rates_and_links_are_other_settings() {
    let changes: [Change; 3] = [
        |it| it.extras.extras.0[1].logic = ModeLogic::And,
        |it| it.rates.roll_expo = 1,
        |it| it.angle.angle_limit_deg = 59,
    ];
    for change in changes {
        let mut configuration = sole();
        change(&mut configuration);
        assert_ne!(configuration.to_bytes(), sole().to_bytes());
    }
}

#[test]
fn the_mode_is_what_the_controller_is_configured_for() {
    assert_eq!(ReceiverMode::of(&sole()), ReceiverMode::Sole);
    assert_eq!(ReceiverMode::of(&overridden()), ReceiverMode::Override);
}

#[test]
fn settings_are_found_among_the_command_lines_answers() {
    let answers = "# get msp_override_channels_mask\r\nmsp_override_channels_mask = 47\r\nAllowed range: 0 - 262143\r\n\
                   \r\n# get msp_override_failsafe\r\nmsp_override_failsafe = ON\r\nAllowed values: OFF, ON\r\n\
                   \r\n# get angle_feedforward\r\nangle_feedforward = 50\r\nprofile 0\r\nAllowed range: 0 - 200\r\n\
                   \r\nangle_feedforward_smoothing_ms = 80\r\nprofile 0\r\nAllowed range: 10 - 250\r\n";
    assert_eq!(
        CommandLineSettings::from_answers(answers),
        CommandLineSettings {
            over_ride: Some(OverrideSettings {
                mask: 47,
                failsafe: Some(true)
            }),
            angle_feedforward: Some(50),
        }
    );
    let unread =
        "msp_override_channels_mask = 15\nmsp_override_failsafe = on\nangle_feedforward = 1O0\n";
    assert_eq!(
        CommandLineSettings::from_answers(unread),
        CommandLineSettings {
            over_ride: Some(OverrideSettings {
                mask: 15,
                failsafe: None
            }),
            angle_feedforward: None,
        }
    );
    assert_eq!(
        CommandLineSettings::from_answers("###ERROR###"),
        CommandLineSettings {
            over_ride: None,
            angle_feedforward: None,
        }
    );
}

#[derive(Deserialize)]
struct Golden {
    frame: Vec<Row>,
}

#[derive(Deserialize)]
struct Row {
    source: String,
    hex: String,
}

/// Betaflight's simulation as it comes from the factory: it answers what was recorded.
struct Recorded;

impl Ask for Recorded {
    type Error = &'static str;

    fn ask<Q: Encode, M: Decode>(&mut self, request: &Q) -> Result<M, Self::Error> {
        if M::COMMAND == ModeRangesExtra::COMMAND {
            // It was not recorded. By default no range is linked: 20 times ARM, OR, ARM.
            let plain = [&[20][..], &[0; 60]].concat();
            return M::decode(&plain).map_err(|_| M::NAME);
        }
        let golden: Golden = toml::from_str(include_str!("../data/golden.toml")).expect("TOML");
        let mut sent = Vec::new();
        order(Version::V1, request, &mut sent).expect("short enough");
        let mut found = None;
        for row in golden.frame.iter().filter(|it| it.source == "betaflight") {
            let byte = |it| u8::from_str_radix(it, 16).expect("hex");
            let bytes: Vec<u8> = row.hex.split(' ').map(byte).collect();
            let is_reply = bytes[2] == b'>';
            Decoder::default().read(&bytes, |frame| {
                if is_reply && found.is_none() && frame.command == M::COMMAND {
                    found = M::decode(frame.payload).ok();
                }
            });
        }
        found.ok_or(M::NAME)
    }
}

#[test]
fn betaflights_defaults_are_unfit_for_these_reasons() {
    let configuration = Configuration::read(&mut Recorded).expect("all of it was recorded");
    assert!(configuration.identity.board.is_simulation());
    assert_eq!(configuration.identity.version.to_string(), "4.6.0");
    let findings = check(&configuration, ReceiverMode::of(&configuration));
    assert_eq!(
        rules(&findings),
        [
            "failsafe-procedure",
            "failsafe-throttle",
            "failsafe-delay",
            "arm-mode",
            "angle-mode"
        ]
    );
}
