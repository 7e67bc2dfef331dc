//! Links, logic and overlaps of the modes' ranges.

use muster_msp::check::{ReceiverMode, check};
use muster_msp::{Mode, ModeLogic, ModeRangeExtra};

use super::configurations::{overridden, range, sole};
use super::rules;

#[test]
fn a_link_or_logic_of_a_mode_that_decides_who_flies_is_found() {
    let and = |mode| ModeRangeExtra {
        mode,
        logic: ModeLogic::And,
        ..ModeRangeExtra::default()
    };
    let linked = |mode, linked_to| ModeRangeExtra {
        mode,
        linked_to,
        ..ModeRangeExtra::default()
    };
    let changes = [
        (0, and(Mode::Arm), "ARM with the logic AND"),
        (1, and(Mode::Angle), "ANGLE with the logic AND"),
        (3, and(Mode::MspOverride), "MSP OVERRIDE with the logic AND"),
        (
            2,
            linked(Mode::Arm, Mode::Angle),
            "ARM linked to the mode ANGLE",
        ),
        (
            3,
            linked(Mode::MspOverride, Mode::Angle),
            "MSP OVERRIDE linked to the mode ANGLE",
        ),
        (
            1,
            linked(Mode::Prearm, Mode::Arm),
            "no link and logic for ANGLE",
        ),
    ];
    for (place, extra, found) in changes {
        let mut configuration = overridden();
        configuration.extras.extras.0[place] = extra;
        let findings = check(&configuration, ReceiverMode::Override);
        assert_eq!(rules(&findings), ["mode-link"], "{findings:?}");
        assert_eq!(findings[0].found, found);
        assert!(findings[0].set.starts_with(&format!("aux {place} ")));
    }
    // A link needs no range: `aux 4 50 0 900 900 0 1`.
    let mut configuration = overridden();
    let empty = range(Mode::MspOverride, 0, 900, 900);
    configuration.ranges.ranges.push(empty);
    let always = linked(Mode::MspOverride, Mode::Angle);
    configuration.extras.extras.0.push(always);
    let findings = check(&configuration, ReceiverMode::Override);
    assert_eq!(rules(&findings), ["mode-link"], "{findings:?}");
    let empty = range(Mode::HeadFree, 0, 900, 900);
    *configuration.ranges.ranges.last_mut().expect("it has") = empty;
    let always = linked(Mode::HeadFree, Mode::Angle);
    *configuration.extras.extras.0.last_mut().expect("it has") = always;
    let findings = check(&configuration, ReceiverMode::Override);
    assert_eq!(rules(&findings), ["other-mode"], "{findings:?}");
}

#[test]
fn a_switch_of_the_pilot_may_ask_for_another_mode() {
    for free in [
        range(Mode::Horizon, 3, 1700, 2100),
        range(Mode::AltHold, 2, 1550, 1700),
        range(Mode::Failsafe, 3, 1700, 2100),
    ] {
        let mut configuration = overridden();
        configuration.ranges.ranges.push(free);
        assert_eq!(check(&configuration, ReceiverMode::Override), []);
    }
    let mut held = sole();
    held.ranges
        .ranges
        .push(range(Mode::HeadFree, 1, 1700, 2100));
    let findings = check(&held, ReceiverMode::Sole);
    assert_eq!(rules(&findings), ["other-mode"], "the link holds AUX2 high");
}
