//! Fit to fly? Rules about a controller's configuration, and what to set where it breaks them.
//!
//! The rules know two ways to fly over MSP. With a *sole receiver* (`feature RX_MSP`) nobody but the sender can catch the
//! aircraft: for the bench and for simulation. With an *override* a pilot's receiver keeps ARM and can take over.

mod failsafe;
mod modes;
mod power;
mod receiver;
mod sticks;

use std::fmt;

use crate::configuration::{Configuration, Identity};
use crate::message::FeatureConfig;

/// How the controller is to be flown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReceiverMode {
    /// MSP is its only receiver.
    Sole,
    /// MSP replaces channels of a pilot's receiver.
    Override,
}

impl ReceiverMode {
    /// As it is configured.
    #[must_use]
    pub fn of(configuration: &Configuration) -> Self {
        if configuration.features.has(FeatureConfig::RX_MSP) {
            Self::Sole
        } else {
            Self::Override
        }
    }
}

impl fmt::Display for ReceiverMode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Sole => "sole receiver",
            Self::Override => "override",
        })
    }
}

/// A rule that the configuration breaks.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finding {
    /// Name of the rule, for programs.
    pub rule: &'static str,
    /// What is wrong with it.
    pub what: &'static str,
    /// The setting as it is.
    pub found: String,
    /// What mends it: lines for the controller's command line, or what else to do.
    pub set: String,
}

impl Finding {
    /// Whether it only says that the command line was not asked: no message has the override's settings up to Betaflight 4.6.
    #[must_use]
    pub fn is_unread_command_line(&self) -> bool {
        self.rule == receiver::COMMAND_LINE_UNREAD
    }

    /// Whether it only says that the last override is held for ever. A simulation may fly so.
    #[must_use]
    pub fn is_override_held(&self) -> bool {
        self.rule == receiver::OVERRIDE_FALLBACK
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            rule,
            what,
            found,
            set,
        } = self;
        let set = set.replace('\n', ", ");
        write!(f, "{rule}: {what}; found: {found}; set: {set}")
    }
}

/// What the rules collect.
#[derive(Debug, Default)]
struct Findings(Vec<Finding>);

impl Findings {
    fn add(
        &mut self,
        rule: &'static str,
        what: &'static str,
        found: impl fmt::Display,
        set: impl Into<String>,
    ) {
        self.0.push(Finding {
            rule,
            what,
            found: found.to_string(),
            set: set.into(),
        });
    }
}

/// All rules that a configuration breaks, if it is to be flown in `mode`. None: it is fit, as far as settings tell.
#[must_use]
pub fn check(configuration: &Configuration, mode: ReceiverMode) -> Vec<Finding> {
    let mut findings = Findings::default();
    receiver::check(configuration, mode, &mut findings);
    sticks::check(configuration, &mut findings);
    failsafe::check(configuration, &mut findings);
    modes::check(configuration, mode, &mut findings);
    power::check(configuration, &mut findings);
    findings.0
}

/// The rules that a controller breaks by its firmware, if it is to be flown in `mode`. No setting mends them.
#[must_use]
pub fn check_firmware(identity: &Identity, mode: ReceiverMode) -> Vec<Finding> {
    let mut findings = Findings::default();
    receiver::check_firmware(identity, mode, &mut findings);
    findings.0
}

/// Index of a channel's name in `rxfail`, from an aux channel.
fn channel_of_aux(aux: u8) -> usize {
    4 + usize::from(aux)
}
