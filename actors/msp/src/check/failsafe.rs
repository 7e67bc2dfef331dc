//! What the controller does when RC stops. Measured on Betaflight 4.6: the loss is seen after 0.15 s; after 0.3 s channels
//! take the values of `rxfail`; after `failsafe_delay` the procedure starts.

use std::ops::RangeInclusive;

use super::{Findings, channel_of_aux};
use crate::configuration::Configuration;
use crate::message::{FailsafeConfig, FailsafeProcedure, FeatureConfig, Mode, RxFailMode};

/// Delay of the procedure, in 0.1 s. Shorter: single lost frames count. Longer: it falls with the throttle that `rxfail` sets.
const DELAY_DS: RangeInclusive<u8> = 2..=10;
/// Throttle of the landing, in µs: between a closed one and what makes a craft with thrust to spare climb.
const THROTTLE_US: RangeInclusive<u16> = 1_150..=1_600;
/// How long it lands before it disarms, in s. Motors turn for as long, on the ground, too.
const LANDING_S: RangeInclusive<u8> = 20..=120;
/// A closed throttle before the loss must have lasted longer than the delay by this, in 0.1 s; `rxfail` closes it, too.
const THROTTLE_LOW_MARGIN_DS: u16 = 10;
/// Throttle among the channels of `rxfail`: roll, pitch, yaw, throttle.
const THROTTLE: usize = 3;

pub(super) fn check(configuration: &Configuration, findings: &mut Findings) {
    check_procedure(configuration, findings);
    check_delay(configuration, findings);
    check_channels(configuration, findings);
    check_sticks(configuration, findings);
    check_arm(configuration, findings);
}

fn check_procedure(configuration: &Configuration, findings: &mut Findings) {
    let has_gps = configuration.features.has(FeatureConfig::GPS);
    let what = match configuration.failsafe.procedure {
        FailsafeProcedure::GpsRescue if has_gps => return,
        FailsafeProcedure::GpsRescue => Some("there is no GPS for a rescue"),
        FailsafeProcedure::AutoLand => None,
        FailsafeProcedure::Drop | FailsafeProcedure::Other(_) => Some("it falls when RC is lost"),
    };
    if let Some(what) = what {
        findings.add(
            "failsafe-procedure",
            what,
            configuration.failsafe.procedure,
            "set failsafe_procedure = AUTO-LAND",
        );
    }
    check_landing(&configuration.failsafe, findings);
}

fn check_landing(failsafe: &FailsafeConfig, findings: &mut Findings) {
    if !THROTTLE_US.contains(&failsafe.throttle_us) {
        findings.add(
            "failsafe-throttle",
            "that is no descent; a little below hover is one",
            failsafe.throttle_us,
            "set failsafe_throttle = 1400",
        );
    }
    if !LANDING_S.contains(&failsafe.landing_s) {
        findings.add(
            "failsafe-landing-time",
            "20 to 120 s are allowed: shorter, it disarms before it is down; longer, motors turn on the ground",
            format!("{} s", failsafe.landing_s),
            "set failsafe_landing_time = 60",
        );
    }
    let low_delay_ds = failsafe.throttle_low_delay_ds;
    // A delay that is too long is a finding of its own.
    let delay_ds = failsafe.delay_ds.min(*DELAY_DS.end());
    if low_delay_ds < u16::from(delay_ds) + THROTTLE_LOW_MARGIN_DS {
        findings.add(
            "failsafe-throttle-low-delay",
            "it disarms in place of a landing, for rxfail closes the throttle before",
            format!("{:.1} s", f64::from(low_delay_ds) / 10.0),
            "set failsafe_throttle_low_delay = 100",
        );
    }
}

fn check_delay(configuration: &Configuration, findings: &mut Findings) {
    let delay_ds = configuration.failsafe.delay_ds;
    if !DELAY_DS.contains(&delay_ds) {
        findings.add(
            "failsafe-delay",
            "0.2 to 1.0 s from lost RC to the procedure are allowed",
            format!("{:.1} s", f64::from(delay_ds) / 10.0),
            "set failsafe_delay = 10",
        );
    }
}

/// What the four sticks and the arm switch do is known.
fn check_channels(configuration: &Configuration, findings: &mut Findings) {
    let switches = configuration.ranges.of(Mode::Arm);
    let channels = switches.map(|range| channel_of_aux(range.aux) + 1);
    let needed = channels.fold(THROTTLE + 1, usize::max);
    let found = configuration.lost.channels.len();
    if found < needed {
        findings.add(
            "rxfail-channels",
            "what sticks and arm switch do when RC is lost is not known",
            format!("rxfail of {found} channels"),
            format!(
                "flash Betaflight 4.5.2 or newer, which tells of 18 channels: {needed} are needed"
            ),
        );
    }
}

fn check_sticks(configuration: &Configuration, findings: &mut Findings) {
    let sticks = configuration.lost.channels.iter().take(THROTTLE);
    for (channel, lost) in sticks.enumerate() {
        if lost.mode != RxFailMode::Auto {
            findings.add(
                "rxfail-stick",
                "a stick is not centred when RC is lost",
                format!("rxfail {channel} {} {}", lost.mode, lost.value_us),
                format!("rxfail {channel} a"),
            );
        }
    }
    let throttle = configuration.lost.channels.get(THROTTLE);
    match throttle.map(|it| (it.mode, it.value_us)) {
        Some((RxFailMode::Hold, _)) => findings.add(
            "rxfail-throttle",
            "it keeps climbing when RC is lost in a climb",
            "rxfail 3 HOLD",
            "rxfail 3 a",
        ),
        Some((RxFailMode::Set, value_us)) if value_us > *THROTTLE_US.end() => findings.add(
            "rxfail-throttle",
            "it climbs when RC is lost",
            format!("rxfail 3 SET {value_us}"),
            "rxfail 3 a",
        ),
        _ => {}
    }
}

/// Measured on Betaflight 4.6: an ARM channel that `rxfail` sets low disarms 0.5 s after the loss, in the air.
fn check_arm(configuration: &Configuration, findings: &mut Findings) {
    for range in configuration.ranges.of(Mode::Arm) {
        let channel = channel_of_aux(range.aux);
        let lost = configuration.lost.channels.get(channel);
        if let Some(lost) = lost.filter(|it| it.mode == RxFailMode::Set) {
            let is_on = (range.first_us()..range.end_us()).contains(&lost.value_us);
            findings.add(
                "rxfail-arm",
                if is_on {
                    "a lost receiver looks like an arm switch that is on"
                } else {
                    "it disarms in the air before the failsafe's delay is over"
                },
                format!("rxfail {channel} SET {}", lost.value_us),
                format!("rxfail {channel} h"),
            );
        }
    }
}
