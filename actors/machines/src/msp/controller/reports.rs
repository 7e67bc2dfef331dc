//! What the controller says of itself, and when it is believed.

use muster_msp::{BoxIds, Mode, Status};

/// What the controller says of itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Reported {
    /// The motors are armed.
    pub(super) armed: bool,
    /// Something prevents arming, besides an arm switch that is high.
    pub(super) is_prevented: bool,
    /// The controller's own failsafe flies.
    pub(super) failsafe: bool,
    /// MSP has the sticks. `None` if the controller has no such mode.
    pub(super) overridden: Option<bool>,
    /// Sticks are tilts: the mode ANGLE is on, and none that takes them for something else.
    pub(super) levels: bool,
}

impl Reported {
    /// What a status says; `boxes`: the controller's modes.
    pub(super) fn of(status: &Status, boxes: &BoxIds) -> Self {
        let is_active = |mode| boxes.is_active(mode, status.modes());
        let arming = status.flags.arming;
        Self {
            armed: is_active(Mode::Arm) == Some(true),
            is_prevented: arming.bits & !arm_switch(arming.count) != 0,
            failsafe: is_active(Mode::Failsafe) == Some(true),
            overridden: is_active(Mode::MspOverride),
            levels: is_active(Mode::Angle) == Some(true)
                && Mode::OTHER_STICKS
                    .iter()
                    .all(|it| is_active(*it) != Some(true)),
        }
    }

    /// Whether motors and sticks are in the same hands.
    fn agrees(self, other: Self) -> bool {
        let key = |it: Self| (it.armed, it.failsafe, it.overridden, it.levels);
        key(self) == key(other)
    }
}

/// `ARM_SWITCH` is the last of the reasons not to arm.
const fn arm_switch(count: u8) -> u32 {
    1_u32.wrapping_shl(count.saturating_sub(1) as u32)
}

/// The newest report that is believed.
///
/// Invariant: a report that contradicts it is believed once the next one agrees. A checksum of one byte lets one of 255 frames
/// with two wrong bytes through, and a single false "disarmed" would lower the arm switch in mid-air.
#[derive(Debug)]
pub(super) struct Reports {
    believed: Option<Reported>,
    doubted: Option<Reported>,
    /// Whether it was said since the port was opened.
    is_current: bool,
    /// What the first report is to say of the motors to be believed by itself.
    expects_armed: bool,
}

impl Reports {
    /// Without a report. `has_flown`: from a checkpoint.
    pub(super) const fn new(has_flown: bool) -> Self {
        Self {
            believed: None,
            doubted: None,
            is_current: false,
            expects_armed: has_flown,
        }
    }

    /// The newest report that is believed, perhaps from before the port was closed.
    pub(super) const fn last(&self) -> Option<Reported> {
        self.believed
    }

    /// The same, of a port that is open.
    pub(super) fn current(&self) -> Option<Reported> {
        self.believed.filter(|_| self.is_current)
    }

    /// The port was closed.
    pub(super) const fn close(&mut self) {
        (self.doubted, self.is_current) = (None, false);
    }

    /// Takes a report.
    pub(super) fn take(&mut self, reported: Reported) {
        let is_expected = match self.believed {
            Some(believed) => believed.agrees(reported),
            None => reported.armed == self.expects_armed && !reported.failsafe,
        };
        let is_confirmed = self.doubted.is_some_and(|it| it.agrees(reported));
        if is_expected || is_confirmed {
            (self.believed, self.doubted) = (Some(reported), None);
            self.is_current = true;
        } else {
            self.doubted = Some(reported);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DISARMED: Reported = Reported {
        armed: false,
        is_prevented: false,
        failsafe: false,
        overridden: None,
        levels: true,
    };
    const ARMED: Reported = Reported {
        armed: true,
        ..DISARMED
    };

    #[test]
    fn sticks_are_no_tilts_in_a_mode_that_takes_them_for_something_else() {
        for other in Mode::OTHER_STICKS {
            let boxes = BoxIds {
                modes: vec![Mode::Arm, Mode::Angle, other],
            };
            let with = |modes| {
                let mut status = Status::default();
                status.head.modes = modes;
                Reported::of(&status, &boxes).levels
            };
            assert!(with(0b011), "{other}");
            assert!(!with(0b111), "{other}");
        }
    }

    #[test]
    fn a_change_is_believed_when_it_is_reported_twice_in_a_row() {
        let mut reports = Reports::new(false);
        reports.take(DISARMED);
        reports.take(ARMED);
        assert_eq!(reports.current(), Some(DISARMED));
        reports.take(DISARMED);
        reports.take(ARMED);
        assert_eq!(reports.current(), Some(DISARMED), "not in a row");
        reports.take(ARMED);
        assert_eq!(reports.current(), Some(ARMED));
    }

    #[test]
    fn the_first_report_is_believed_by_itself_if_it_says_what_is_expected() {
        for (has_flown, expected, other) in [(false, DISARMED, ARMED), (true, ARMED, DISARMED)] {
            let mut reports = Reports::new(has_flown);
            reports.take(other);
            assert_eq!(reports.current(), None);
            reports.take(expected);
            assert_eq!(reports.current(), Some(expected));
            reports.close();
            assert_eq!((reports.current(), reports.last()), (None, Some(expected)));
            reports.take(other);
            assert_eq!(reports.current(), None);
            reports.take(other);
            assert_eq!(reports.current(), Some(other));
        }
    }
}
