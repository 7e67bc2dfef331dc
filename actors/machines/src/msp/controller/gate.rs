//! The last point before values leave for a controller.

use muster_msp::{Channel, Identity, Mode, SetRawRc, Sticks};

use super::config::{Config, Gains, Receiver, Stage};
use super::reports::Reported;
use super::tether;

/// Value of the switch of the mode ANGLE: always on.
const ANGLE: Channel = Channel::HIGH;

/// What may leave for a controller.
///
/// Invariant: no value above its stage leaves.
#[derive(Debug)]
pub(super) struct Gate {
    receiver: Receiver,
    configured: Stage,
    gains: Gains,
    /// Who the controller is, while its port is open.
    identity: Option<Identity>,
    /// The configured one, or what is left of it without a grant.
    stage: Stage,
}

impl Gate {
    /// Without a controller.
    pub(super) fn new(config: &Config) -> Self {
        Self {
            receiver: config.receiver,
            configured: config.stage,
            gains: config.gains,
            identity: None,
            stage: config.stage.min(Stage::Bench),
        }
    }

    /// The controller said who it is. `granted`: the highest stage above `bench` that a grant allows with it.
    pub(super) fn open(&mut self, identity: Identity, granted: Stage) {
        // Without ARM among its modes it can't say whether it is armed.
        let has_arm = identity.boxes.modes.contains(&Mode::Arm);
        self.identity = has_arm.then_some(identity);
        self.stage = match self.receiver {
            Receiver::Override => self.configured.min(granted.max(Stage::Bench)),
            Receiver::Sole => self.configured.min(Stage::Bench),
        };
    }

    /// The port was closed.
    pub(super) fn close(&mut self) {
        self.identity = None;
    }

    /// Who the controller is; `None` if its port is closed or it can't say whether it is armed.
    pub(super) const fn identity(&self) -> Option<&Identity> {
        self.identity.as_ref()
    }

    /// The stage in force.
    pub(super) const fn stage(&self) -> Stage {
        self.stage
    }

    /// Whether the controller says that no motor hangs on it.
    pub(super) fn is_simulation(&self) -> bool {
        self.identity.as_ref().is_some_and(Identity::is_simulation)
    }

    /// Whether its stage lets it fly this controller.
    pub(super) fn may_fly(&self) -> bool {
        match self.stage {
            Stage::Sim => self.is_simulation(),
            Stage::Bench => false,
            Stage::Tethered | Stage::Flight => true,
        }
    }

    /// What leaves of these sticks and of the arm switch.
    /// `None`: it does not take the sticks of a pilot who has armed what it may not fly, and gives none to a controller that
    /// would take them for something else.
    pub(super) fn rc(
        &self,
        sticks: Sticks,
        is_arm_high: bool,
        reported: Option<Reported>,
    ) -> Option<SetRawRc> {
        let is_heard =
            |it: Reported| self.receiver == Receiver::Sole || it.overridden == Some(true);
        let takes_others = |it: Reported| it.armed && !it.levels && is_heard(it);
        if reported.is_some_and(takes_others) {
            return None;
        }
        let arm = if is_arm_high {
            Channel::HIGH
        } else {
            Channel::LOW
        };
        let is_armed = reported.is_some_and(|it| it.armed);
        let (sticks, aux) = match self.stage {
            _ if !self.may_fly() => match self.receiver {
                Receiver::Override if is_armed => return None,
                Receiver::Override | Receiver::Sole => (Sticks::IDLE, [Channel::LOW; 2]),
            },
            Stage::Sim | Stage::Bench => (sticks, [arm, ANGLE]),
            Stage::Tethered => {
                let sticks = tether::sticks(sticks, &self.gains);
                (sticks, [Channel::LOW, ANGLE])
            }
            Stage::Flight => (sticks, [Channel::LOW, ANGLE]),
        };
        Some(SetRawRc::new(sticks, &aux).expect("two aux channels are within the limit"))
    }
}
