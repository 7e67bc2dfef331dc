//! Whether the controller is armed.

/// Statuses in a row that must say disarmed before the controller counts as landed: a single false one must not close the
/// port of one that flies.
const DISARMED_MIN: u8 = 2;

/// What the controller's statuses say about arming, and whether it must still be looked at.
///
/// Invariant: `disarmed` counts statuses since the port was opened and since the last one that said armed.
#[derive(Debug, Default)]
pub(super) struct ArmedStatus {
    /// As the controller said last; `None` if it never has.
    is_armed: Option<bool>,
    /// Statuses in a row that said disarmed.
    disarmed: u8,
    /// The port was opened in flight, and the settings of its controller not looked at.
    is_unlooked: bool,
}

impl ArmedStatus {
    /// The port was opened. `is_unlooked`: the controller was not looked at, and is to be once it has landed.
    pub(super) const fn opened(&mut self, is_unlooked: bool) {
        self.is_unlooked = is_unlooked;
        self.disarmed = 0;
    }

    /// Takes in whether the controller is armed.
    pub(super) const fn update(&mut self, is_armed: bool) {
        self.is_armed = Some(is_armed);
        self.disarmed = if is_armed {
            0
        } else {
            self.disarmed.saturating_add(1)
        };
    }

    /// Whether the controller was armed at its last status. `None` if there was none.
    pub(super) const fn is_armed(&self) -> Option<bool> {
        self.is_armed
    }

    /// Whether the controller is disarmed for sure.
    pub(super) const fn is_disarmed(&self) -> bool {
        self.disarmed >= DISARMED_MIN
    }

    /// Whether a controller that was not looked at in flight has landed.
    pub(super) const fn must_look(&self) -> bool {
        self.is_unlooked && self.is_disarmed()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_false_status_does_not_close_the_port_in_flight() {
        let mut arming = ArmedStatus::default();
        arming.opened(true);
        for is_armed in [true, false, true, false] {
            arming.update(is_armed);
            assert!(!arming.must_look());
        }
        arming.update(false);
        assert!(arming.must_look());
        arming.opened(false);
        assert!(!arming.must_look());
        assert_eq!(arming.is_armed(), Some(false));
        assert!(!arming.is_disarmed(), "the port was opened again");
    }
}
