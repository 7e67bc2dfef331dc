//! Firmware, receiver, override.

use std::fmt::Display;

use super::{Findings, ReceiverMode};
use crate::channels::Channel;
use crate::configuration::{Configuration, Identity, OverrideSettings};
use crate::message::{FeatureConfig, Mode, RxMap};

/// Name of the rule that settings which no message has must have been read.
pub(super) const COMMAND_LINE_UNREAD: &str = "command-line-unread";
/// The rule of a firmware that holds the last override for ever.
pub(super) const OVERRIDE_FALLBACK: &str = "override-fallback";

/// The receiver's channels of the four sticks in a mask.
const STICKS: u32 = 0b1111;

/// Why a mask without channels is unsafe.
const NO_OVERRIDE: &str = "MSP replaces no channel";

pub(super) fn check(configuration: &Configuration, mode: ReceiverMode, findings: &mut Findings) {
    check_firmware(&configuration.identity, mode, findings);
    check_channels(configuration, findings);
    let is_sole = configuration.features.has(FeatureConfig::RX_MSP);
    match mode {
        ReceiverMode::Sole if !is_sole => findings.add(
            "receiver",
            "MSP is not the receiver",
            "feature RX_MSP is off",
            "feature RX_MSP",
        ),
        ReceiverMode::Sole => {}
        ReceiverMode::Override => check_override(configuration, is_sole, findings),
    }
}

pub(super) fn check_firmware(identity: &Identity, mode: ReceiverMode, findings: &mut Findings) {
    if !identity.is_betaflight() {
        findings.add(
            "firmware",
            "these rules are for Betaflight",
            identity.variant.variant,
            "flash Betaflight",
        );
    } else if !identity.leans_by_rates() {
        findings.add(
            "angle-firmware",
            "the mode ANGLE doesn't lean by the rates, so a stick means another tilt",
            format!("Betaflight {}", identity.version),
            "flash Betaflight 4.5.2 or newer",
        );
    }
    if mode == ReceiverMode::Override && !identity.override_falls_back() {
        findings.add(
            OVERRIDE_FALLBACK,
            "it holds the last override for ever if the sender dies",
            format!("Betaflight {}", identity.version),
            "flash Betaflight 2026.6 or newer",
        );
    }
}

fn check_channels(configuration: &Configuration, findings: &mut Findings) {
    if configuration.map != RxMap::AETR {
        findings.add(
            "map",
            "sticks would be taken for others",
            format!("map {}", configuration.map.letters()),
            "map AETR1234",
        );
    }
    let receiver = &configuration.receiver;
    if receiver.rx_min_us > Channel::LOW.us() {
        findings.add(
            "rx_min_usec",
            "a closed throttle counts as a lost receiver",
            receiver.rx_min_us,
            "set rx_min_usec = 885",
        );
    }
    if receiver.rx_max_us < Channel::HIGH.us() {
        findings.add(
            "rx_max_usec",
            "a full stick counts as a lost receiver",
            receiver.rx_max_us,
            "set rx_max_usec = 2115",
        );
    }
    if receiver.centre_us != Channel::CENTRE.us() {
        findings.add(
            "mid_rc",
            "a centred stick leans",
            receiver.centre_us,
            format!("set mid_rc = {}", Channel::CENTRE.us()),
        );
    }
    if !(1_010..=1_200).contains(&receiver.min_check_us) {
        findings.add(
            "min_check",
            "a throttle of 1000 µs must count as closed, one of 1200 µs must not",
            receiver.min_check_us,
            "set min_check = 1050",
        );
    }
}

/// The pilot's receiver. A simulation has one that is no feature.
fn check_pilot(configuration: &Configuration, is_sole: bool, findings: &mut Findings) {
    if is_sole {
        findings.add(
            "receiver",
            "no pilot can take over",
            "feature RX_MSP is on",
            "feature -RX_MSP\nfeature RX_SERIAL",
        );
    }
    let pilots = [
        FeatureConfig::RX_SERIAL,
        FeatureConfig::RX_PPM,
        FeatureConfig::RX_PARALLEL_PWM,
        FeatureConfig::RX_SPI,
    ];
    if !is_sole && !pilots.iter().any(|it| configuration.features.has(*it)) {
        findings.add(
            "receiver",
            "there is no pilot's receiver",
            "no feature RX_… is on",
            "feature RX_SERIAL",
        );
    }
}

fn check_override(configuration: &Configuration, is_sole: bool, findings: &mut Findings) {
    let identity = &configuration.identity;
    if !identity.board.is_simulation() {
        check_pilot(configuration, is_sole, findings);
    }
    let command_line = configuration.command_line;
    let is_unread = command_line.is_none() && identity.boxes.modes.contains(&Mode::MspOverride);
    match command_line.and_then(|it| it.over_ride) {
        Some(settings) => check_override_settings(settings, findings),
        None if is_unread => findings.add(
            COMMAND_LINE_UNREAD,
            "the override's settings can only be read with the command line",
            "not read",
            "muster fc check --cli",
        ),
        None => add_mask(NO_OVERRIDE, "the mode MSP OVERRIDE is absent", findings),
    }
}

fn check_override_settings(settings: OverrideSettings, findings: &mut Findings) {
    let OverrideSettings { mask, failsafe } = settings;
    let danger = match mask {
        STICKS => None,
        0 => Some(NO_OVERRIDE),
        _ if mask & STICKS != STICKS => Some("MSP does not replace all four sticks"),
        _ => Some("MSP replaces switches of the pilot"),
    };
    if let Some(danger) = danger {
        let found = format!("msp_override_channels_mask = {mask}");
        add_mask(danger, found, findings);
    }
    let found = match failsafe {
        Some(false) => return,
        Some(true) => "msp_override_failsafe = ON",
        None => "msp_override_failsafe is neither ON nor OFF",
    };
    findings.add(
        "override-failsafe",
        "the loss of the pilot's receiver is not detected",
        found,
        "set msp_override_failsafe = OFF",
    );
}

fn add_mask(danger: &'static str, found: impl Display, findings: &mut Findings) {
    findings.add(
        "override-mask",
        danger,
        found,
        format!("set msp_override_channels_mask = {STICKS}"),
    );
}
