//! Whether a stick means what flight by sticks takes it for.

use std::fmt::Display;

use super::Findings;
use crate::configuration::Configuration;
use crate::message::{RatesType, RcTuning, ThrottleLimit};
use crate::response::StickResponse;

/// Largest value of `roll_rate_limit`, and Betaflight's default (`fc/controlrate_profile.h`), in °/s.
const RATE_LIMIT_MAX_DPS: u16 = 1_998;

pub(super) fn check(configuration: &Configuration, findings: &mut Findings) {
    let StickResponse {
        rc_rate,
        srate,
        angle_limit_deg,
    } = StickResponse::ASSUMED;
    let rates = differing_rates(&configuration.rates, rc_rate, srate);
    rates.report(
        "rates",
        "a stick means another tilt; the tether's 10° could be twice that",
        findings,
    );
    let found_deg = configuration.angle.angle_limit_deg;
    if found_deg != angle_limit_deg {
        findings.add(
            "angle_limit",
            "a stick means another tilt",
            format!("{found_deg}°"),
            format!("set angle_limit = {angle_limit_deg}"),
        );
    }
    check_feedforward(configuration, findings);
    differing_throttle(&configuration.rates).report(
        "throttle-curve",
        "motors don't get the throttle that is sent",
        findings,
    );
}

/// Only the command line tells it. If that was not asked, another rule says so where it matters.
fn check_feedforward(configuration: &Configuration, findings: &mut Findings) {
    let Some(command_line) = configuration.command_line else {
        return;
    };
    let found = match command_line.angle_feedforward {
        Some(0) => return,
        Some(percent) => format!("angle_feedforward = {percent}"),
        None if !configuration.identity.has_angle_feedforward() => return,
        None => "angle_feedforward is no number from 0 to 255".to_owned(),
    };
    findings.add(
        "angle-feedforward",
        "RC frames that come at once tilt the aircraft: one in a hover by 44°",
        found,
        "set angle_feedforward = 0",
    );
}

/// Settings that differ: what was found, and the lines that mend it.
#[derive(Default)]
struct Differing {
    found: Vec<String>,
    set: Vec<String>,
}

impl Differing {
    /// Adds a setting unless it is as needed. `None`: the firmware does not report it.
    fn compare<T: PartialEq + Display>(&mut self, name: &str, found: Option<T>, needed: T) {
        self.require(name, found.as_ref() == Some(&needed), found, needed);
    }

    /// Adds a setting unless it is fit.
    fn require<T: Display>(&mut self, name: &str, is_fit: bool, found: Option<T>, set: T) {
        if !is_fit {
            let found = found.map_or("not reported".to_owned(), |it| it.to_string());
            self.found.push(format!("{name} = {found}"));
            self.set.push(format!("set {name} = {set}"));
        }
    }

    fn report(self, rule: &'static str, what: &'static str, findings: &mut Findings) {
        if !self.found.is_empty() {
            findings.add(rule, what, self.found.join(", "), self.set.join("\n"));
        }
    }
}

fn differing_rates(rates: &RcTuning, rc_rate: u8, srate: u8) -> Differing {
    let mut differing = Differing::default();
    let [roll_srate, pitch_srate, _] = rates.srates;
    differing.compare("rates_type", rates.rates_type, RatesType::Actual);
    differing.compare("roll_rc_rate", Some(rates.roll_rc_rate), rc_rate);
    differing.compare("pitch_rc_rate", rates.pitch_rc_rate, rc_rate);
    differing.compare("roll_srate", Some(roll_srate), srate);
    differing.compare("pitch_srate", Some(pitch_srate), srate);
    differing.compare("roll_expo", Some(rates.roll_expo), 0);
    differing.compare("pitch_expo", rates.pitch_expo, 0);
    let largest_dps = 10 * u16::from(srate);
    for (axis, name) in ["roll_rate_limit", "pitch_rate_limit"].iter().enumerate() {
        let limit_dps = rates.rate_limits_dps.map(|it| it[axis]);
        let is_fit = limit_dps.is_some_and(|it| it >= largest_dps);
        differing.require(name, is_fit, limit_dps, RATE_LIMIT_MAX_DPS);
    }
    differing
}

/// Without expo the throttle's curve is a straight line up to Betaflight 4.5. Since then it passes through `thr_hover` at
/// `thr_mid` (`fc/rc.c`).
fn differing_throttle(rates: &RcTuning) -> Differing {
    let mut differing = Differing::default();
    differing.compare(
        "throttle_limit_type",
        rates.throttle_limit,
        ThrottleLimit::Off,
    );
    differing.compare("thr_expo", Some(rates.throttle_expo), 0);
    if let Some(hover) = rates.throttle_hover {
        differing.compare("thr_hover", Some(hover), rates.throttle_mid);
    }
    differing
}
