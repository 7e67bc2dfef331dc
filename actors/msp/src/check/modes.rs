//! What the modes' switches do.

use super::{Findings, ReceiverMode};
use crate::channels::Channel;
use crate::configuration::Configuration;
use crate::message::{Mode, ModeRange, ModeRangeExtra};

/// Modes that decide who flies, and how.
const DECISIVE: [Mode; 3] = [Mode::Arm, Mode::Angle, Mode::MspOverride];
/// AUX2, which the link holds high for ANGLE.
const ANGLE_AUX: u8 = 1;

pub(super) fn check(configuration: &Configuration, mode: ReceiverMode, findings: &mut Findings) {
    check_arm(configuration, findings);
    check_angle(configuration, mode, findings);
    check_extras(configuration, findings);
    check_others(configuration, mode, findings);
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

/// Links and logic of the ranges that decide who flies. Betaflight takes a linked range for on while the other mode is, and a
/// range with AND for off while another one of its mode is off (`fc/rc_modes.c`), an empty one too.
fn check_extras(configuration: &Configuration, findings: &mut Findings) {
    let extras = &configuration.extras.extras.0;
    for (place, range) in configuration.ranges.ranges.iter().enumerate() {
        let extra = extras.get(place).filter(|it| it.mode == range.mode);
        let is_known = extra.is_some() || !range.is_used();
        let is_plain = extra.is_none_or(|it| it.is_plain());
        if !DECISIVE.contains(&range.mode) || is_known && is_plain {
            continue;
        }
        let (what, found) = match extra {
            Some(ModeRangeExtra {
                mode,
                logic,
                linked_to: Mode::Arm,
            }) => (
                "its switch alone does not decide over the mode",
                format!("{mode} with the logic {logic}"),
            ),
            Some(ModeRangeExtra {
                mode, linked_to, ..
            }) => (
                "another mode switches it",
                format!("{mode} linked to the mode {linked_to}"),
            ),
            None => (
                "whether its switch alone decides over the mode is not known",
                format!("no link and logic for {}", range.mode),
            ),
        };
        findings.add("mode-link", what, found, in_place(place, *range));
    }
}

/// The line that keeps a range, without link or logic.
fn in_place(place: usize, range: ModeRange) -> String {
    let (mode, aux) = (u8::from(range.mode), range.aux);
    let (first, end) = (range.first_us(), range.end_us());
    format!("aux {place} {mode} {aux} {first} {end} 0 0")
}

/// Modes that take sticks for something else must be off unless a switch of the pilot asks for them, and not the one that gives
/// MSP the sticks.
fn check_others(configuration: &Configuration, mode: ReceiverMode, findings: &mut Findings) {
    let extras = &configuration.extras.extras.0;
    let override_ranges: Vec<_> = configuration.ranges.of(Mode::MspOverride).collect();
    for (place, range) in configuration.ranges.ranges.iter().enumerate() {
        let is_linked = extras
            .get(place)
            .is_some_and(|it| it.mode == range.mode && it.linked_to != Mode::Arm);
        let overlaps = |other: &ModeRange| {
            range.aux == other.aux
                && range.first_step < other.end_step
                && other.first_step < range.end_step
        };
        let is_held = mode == ReceiverMode::Sole
            && range.aux == ANGLE_AUX
            && range.end_us() > Channel::HIGH.us();
        let is_on = range.is_used()
            && (range.first_us() <= Channel::CENTRE.us()
                || is_held
                || mode == ReceiverMode::Override && override_ranges.iter().any(overlaps));
        if Mode::OTHER_STICKS.contains(&range.mode) && (is_on || is_linked) {
            let found = if is_linked {
                format!("{} linked to another mode", range.mode)
            } else {
                format!("{} from {} µs on", range.mode, range.first_us())
            };
            findings.add(
                "other-mode",
                "sticks would mean something else while MSP has them",
                found,
                format!("aux {place} {} 0 900 900 0 0", u8::from(range.mode)),
            );
        }
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
    for range in ranges {
        if range.first_us() <= Channel::CENTRE.us() {
            findings.add(
                "override-range",
                "a switch that is off or centred gives MSP the sticks",
                format!("MSP OVERRIDE from {} µs on", range.first_us()),
                set,
            );
        } else if range.end_us() <= Channel::HIGH.us() {
            findings.add(
                "override-range",
                "a switch that is fully on takes the sticks from MSP",
                format!("MSP OVERRIDE below {} µs", range.end_us()),
                set,
            );
        }
        let switches = |it: &Mode| configuration.ranges.of(*it).any(|it| it.aux == range.aux);
        if let Some(other) = [Mode::Arm, Mode::Failsafe, Mode::Paralyze]
            .iter()
            .find(|it| switches(it))
        {
            findings.add(
                "override-switch",
                "one switch gives MSP the sticks and does something else",
                format!(
                    "MSP OVERRIDE and {other} on AUX{}",
                    u16::from(range.aux) + 1
                ),
                "give MSP OVERRIDE an AUX channel of its own: aux PLACE 50 CHANNEL 1700 2100 0 0",
            );
        }
    }
}
