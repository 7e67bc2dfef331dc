//! What the modes' switches do.

use super::{Findings, ReceiverMode};
use crate::channels::Channel;
use crate::configuration::Configuration;
use crate::message::{Mode, ModeRange};

/// AUX2, which the link holds high for ANGLE.
const ANGLE_AUX: u8 = 1;

pub(super) fn check(configuration: &Configuration, mode: ReceiverMode, findings: &mut Findings) {
    check_arm(configuration, findings);
    check_angle(configuration, mode, findings);
    if mode == ReceiverMode::Override {
        check_override(configuration, findings);
    }
}

fn check_arm(configuration: &Configuration, findings: &mut Findings) {
    let set = "aux 0 0 0 1700 2100 0 0";
    let ranges: Vec<ModeRange> = configuration.ranges.of(Mode::Arm).collect();
    if ranges.is_empty() {
        findings.add(
            "arm-mode",
            "no switch arms and disarms",
            "no range for ARM",
            set,
        );
    }
    if ranges.len() > 1 {
        findings.add(
            "arm-mode",
            "several switches arm",
            format!("{} ranges for ARM", ranges.len()),
            "delete all but one: aux PLACE 0 0 900 900 0 0",
        );
    }
    for range in ranges {
        if range.first_us() <= Channel::CENTRE.us() {
            findings.add(
                "arm-range",
                "a switch that is off or centred arms",
                format!("ARM from {} µs on", range.first_us()),
                set,
            );
        } else if range.end_us() <= Channel::HIGH.us() {
            findings.add(
                "arm-range",
                "a switch that is fully on disarms",
                format!("ARM below {} µs", range.end_us()),
                set,
            );
        }
    }
}

/// The link holds AUX2 high where it is the only receiver; the pilot's switches are the pilot's.
fn check_angle(configuration: &Configuration, mode: ReceiverMode, findings: &mut Findings) {
    let mut ranges = configuration.ranges.of(Mode::Angle).peekable();
    if ranges.peek().is_none() {
        findings.add(
            "angle-mode",
            "sticks would be rates: nothing keeps it level",
            "no range for ANGLE",
            "aux 1 1 1 900 2100 0 0",
        );
        return;
    }
    let is_on = |range: ModeRange| {
        let is_always_on = range.first_us() <= 900 && range.end_us() >= 2100;
        let values = range.first_us()..range.end_us();
        let is_held = range.aux == ANGLE_AUX && values.contains(&Channel::HIGH.us());
        is_always_on || mode == ReceiverMode::Sole && is_held
    };
    if !ranges.any(is_on) {
        findings.add(
            "angle-range",
            "sticks would be rates while a switch is off",
            "ANGLE is not always on",
            "aux 1 1 1 900 2100 0 0",
        );
    }
}

fn check_override(configuration: &Configuration, findings: &mut Findings) {
    let set = "aux 2 50 2 1700 2100 0 0";
    let mut ranges = configuration.ranges.of(Mode::MspOverride).peekable();
    if ranges.peek().is_none() {
        findings.add(
            "override-mode",
            "no switch of the pilot gives MSP the sticks, or takes them back",
            "no range for MSP OVERRIDE",
            set,
        );
    }
    for range in ranges.filter(|it| it.first_us() <= Channel::CENTRE.us()) {
        findings.add(
            "override-range",
            "a switch that is off or centred gives MSP the sticks",
            format!("MSP OVERRIDE from {} µs on", range.first_us()),
            set,
        );
    }
}
