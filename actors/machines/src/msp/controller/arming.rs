//! When the arm switch may be high.

use std::time::Duration;

use super::config::{Receiver, Stage};
use super::reports::Reported;
use crate::time::Timestamp;

/// Time with the arm switch low and the throttle closed before it may go high. Betaflight must have seen it low.
const LOW_FIRST: Duration = Duration::from_millis(500);
/// Time after which an arm switch that armed nothing goes low again.
const GIVE_UP_AFTER: Duration = Duration::from_secs(1);
/// How often the switch of a controller goes high to arm it. One that never arms is left alone then, however often it is
/// ordered.
const TRIES: u8 = 3;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Switch {
    /// Low, since this time.
    Low(Timestamp),
    /// High, since this time.
    High(Timestamp),
}

/// The arm switch.
///
/// Invariant: it is high only if the controller says that it is armed, or within [`GIVE_UP_AFTER`] of an order to arm, by a
/// drone that has not flown yet, in a stage that arms.
#[derive(Debug)]
pub(super) struct Arming {
    may_arm: bool,
    switch: Switch,
    /// An order to arm is being carried out.
    is_ordered: bool,
    /// How often the switch may still go high before the controller has armed.
    tries: u8,
    /// The motors were or may have been armed. It never arms again.
    has_flown: bool,
    /// The motors are to stop.
    is_over: bool,
}

impl Arming {
    /// With a low switch. `has_flown`: from a checkpoint.
    pub(super) const fn new(receiver: Receiver, has_flown: bool, now: Timestamp) -> Self {
        Self {
            may_arm: matches!(receiver, Receiver::Sole),
            switch: Switch::Low(now),
            is_ordered: false,
            tries: TRIES,
            has_flown,
            is_over: false,
        }
    }

    pub(super) const fn has_flown(&self) -> bool {
        self.has_flown
    }

    pub(super) const fn is_high(&self) -> bool {
        matches!(self.switch, Switch::High(_))
    }

    /// The drone is to arm.
    pub(super) const fn order(&mut self) {
        self.is_ordered = !self.has_flown && self.tries > 0;
    }

    /// The motors are to stop, for good.
    pub(super) const fn end(&mut self) {
        self.is_ordered = false;
        self.is_over = true;
    }

    /// Moves the switch. `is_simulation`: the controller says that it is none that drives motors.
    pub(super) fn step(
        &mut self,
        now: Timestamp,
        stage: Stage,
        is_simulation: bool,
        reported: Reported,
    ) {
        if reported.armed {
            self.is_ordered = false;
            self.has_flown = true;
            return self.set(now, !self.is_over && may_go_high(stage, is_simulation));
        }
        match self.switch {
            // It was armed, and the controller or the pilot disarmed it; or nothing came of it.
            Switch::High(since) if !self.is_ordered || now.since(since) >= GIVE_UP_AFTER => {
                self.tries = self.tries.saturating_sub(1);
                self.is_ordered &= self.tries > 0;
                self.set(now, false);
            }
            Switch::Low(since)
                if self.is_ordered
                    && self.may_arm
                    && may_go_high(stage, is_simulation)
                    && !reported.is_prevented
                    && now.since(since) >= LOW_FIRST =>
            {
                self.set(now, true);
            }
            Switch::High(_) | Switch::Low(_) => {}
        }
    }

    const fn set(&mut self, now: Timestamp, is_high: bool) {
        match (self.switch, is_high) {
            (Switch::Low(_), true) => self.switch = Switch::High(now),
            (Switch::High(_), false) => self.switch = Switch::Low(now),
            _ => {}
        }
    }
}

/// Whether a stage lets the arm switch of such a controller be high.
const fn may_go_high(stage: Stage, is_simulation: bool) -> bool {
    match stage {
        Stage::Sim => is_simulation,
        // Above `bench` the pilot arms, and nobody else.
        Stage::Bench | Stage::Tethered | Stage::Flight => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(milliseconds: u64) -> Timestamp {
        Timestamp::from_nanos(milliseconds * 1_000_000)
    }

    const READY: Reported = Reported {
        armed: false,
        is_prevented: false,
        failsafe: false,
        overridden: None,
        levels: true,
    };
    const ARMED: Reported = Reported {
        armed: true,
        ..READY
    };

    fn arming() -> Arming {
        Arming::new(Receiver::Sole, false, at(0))
    }

    #[test]
    fn switch_goes_high_once_it_was_low_for_a_while_and_nothing_prevents_arming() {
        let mut arming = arming();
        arming.order();
        arming.step(at(400), Stage::Sim, true, READY);
        assert!(!arming.is_high(), "not low for long enough");
        let prevented = Reported {
            is_prevented: true,
            ..READY
        };
        arming.step(at(600), Stage::Sim, true, prevented);
        assert!(!arming.is_high());
        arming.step(at(620), Stage::Sim, true, READY);
        assert!(arming.is_high());
        arming.step(at(700), Stage::Sim, true, ARMED);
        assert!(arming.is_high() && arming.has_flown());
    }

    #[test]
    fn no_stage_arms_what_it_must_not() {
        for (stage, is_simulation) in [
            (Stage::Sim, false),
            (Stage::Bench, true),
            (Stage::Tethered, true),
            (Stage::Flight, true),
        ] {
            let mut arming = arming();
            arming.order();
            arming.step(at(1_000), stage, is_simulation, READY);
            assert!(!arming.is_high());
            arming.step(at(2_000), stage, is_simulation, ARMED);
            assert!(!arming.is_high(), "not even if it is armed");
        }
    }

    #[test]
    fn nothing_arms_a_second_time() {
        let mut arming = Arming::new(Receiver::Sole, true, at(0));
        arming.order();
        arming.step(at(1_000), Stage::Sim, true, READY);
        assert!(!arming.is_high());
        // But a restarted link of an armed vehicle keeps it armed.
        arming.step(at(1_020), Stage::Sim, true, ARMED);
        assert!(arming.is_high());
        arming.step(at(1_040), Stage::Sim, true, READY);
        assert!(!arming.is_high(), "the controller has disarmed");
        arming.order();
        arming.step(at(3_000), Stage::Sim, true, READY);
        assert!(!arming.is_high());
    }

    #[test]
    fn switch_goes_low_at_the_end_and_if_nothing_came_of_it() {
        let mut first = arming();
        first.order();
        first.step(at(600), Stage::Sim, true, READY);
        first.step(at(700), Stage::Sim, true, ARMED);
        first.end();
        first.step(at(800), Stage::Sim, true, ARMED);
        assert!(!first.is_high());
        let mut second = arming();
        second.order();
        second.step(at(600), Stage::Sim, true, READY);
        second.step(at(1_500), Stage::Sim, true, READY);
        assert!(second.is_high());
        second.step(at(1_600), Stage::Sim, true, READY);
        assert!(!second.is_high());
    }

    #[test]
    fn controller_that_never_arms_is_left_alone_after_three_tries() {
        let mut arming = arming();
        let mut times_high = 0;
        for now in (0..60_000).step_by(20) {
            let was_high = arming.is_high();
            arming.order();
            arming.step(at(now), Stage::Sim, true, READY);
            times_high += u8::from(!was_high && arming.is_high());
        }
        assert_eq!(times_high, TRIES);
    }

    #[test]
    fn with_a_pilots_receiver_the_pilot_arms() {
        let mut arming = Arming::new(Receiver::Override, false, at(0));
        arming.order();
        arming.step(at(1_000), Stage::Sim, true, READY);
        assert!(!arming.is_high());
    }
}
