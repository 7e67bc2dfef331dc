//! What the rules about settings say of the simulated controller.

use muster_controller::{Settings, Version};
use muster_msp::check::{ReceiverMode, check};
use muster_msp::{Ask, Configuration, Decode, Encode, RcTuning, order};

use crate::companion::{Companion, exact};

impl Ask for Companion {
    type Error = &'static str;

    fn ask<Q: Encode, M: Decode>(&mut self, request: &Q) -> Result<M, Self::Error> {
        let mut bytes = Vec::new();
        order(muster_msp::Version::V1, request, &mut bytes).unwrap();
        self.send(&bytes);
        let payload = self.answer(M::COMMAND).ok_or(M::NAME)?;
        M::decode(&payload).map_err(|_| M::NAME)
    }
}

/// What is found in a controller with these settings.
fn findings(settings: Settings) -> Vec<(&'static str, String)> {
    let mut companion = Companion::new(exact(settings));
    let configuration = Configuration::read(&mut companion).unwrap();
    let findings = check(&configuration, ReceiverMode::Sole);
    findings.into_iter().map(|it| (it.rule, it.found)).collect()
}

#[test]
fn a_fit_controller_breaks_no_rule() {
    assert_eq!(findings(Settings::fit()), []);
}

#[test]
fn rates_and_angle_limit_are_those_that_it_flies_by() {
    let mut settings = Settings::fit();
    settings.tuning.centre_rate_dps = 200.0;
    settings.tuning.max_rate_dps = 400.0;
    let rates = "roll_rc_rate = 20, pitch_rc_rate = 20, roll_srate = 40, pitch_srate = 40";
    assert_eq!(findings(settings), [("rates", rates.to_owned())]);
    let mut settings = Settings::fit();
    settings.tuning.angle_limit_deg = 45.0;
    assert_eq!(findings(settings), [("angle_limit", "45°".to_owned())]);
}

#[test]
fn firmware_before_4_6_tells_no_hover_throttle() {
    let mut settings = Settings::fit();
    settings.version = Version {
        major: 4,
        minor: 5,
        patch: 2,
    };
    let rates = Companion::new(exact(settings.clone())).ask::<RcTuning>();
    assert_eq!(rates.throttle_hover, None);
    assert_eq!(findings(settings), []);
}
