//! Whether the autopilot is to arm.

/// The drone's order to arm.
///
/// Invariant: once the order has left, a restarted link does not order again. Until the autopilot arms, this link repeats it.
#[derive(Debug)]
pub(super) struct Arming {
    /// It is to arm as soon as it can.
    is_due: bool,
    /// It was ordered to arm, by this link or before a restart.
    has_flown: bool,
}

impl Arming {
    /// Without an order of the drone. `has_flown`: from a checkpoint.
    pub(super) const fn new(has_flown: bool) -> Self {
        Self {
            is_due: false,
            has_flown,
        }
    }

    /// Whether the autopilot is to arm as soon as it can.
    pub(super) const fn is_due(&self) -> bool {
        self.is_due
    }

    /// Whether the autopilot was ordered to arm, by this link or before a restart.
    pub(super) const fn has_flown(&self) -> bool {
        self.has_flown
    }

    /// The drone is to arm.
    pub(super) const fn order(&mut self) {
        self.is_due |= !self.has_flown;
    }

    /// The order leaves for the autopilot.
    pub(super) const fn send(&mut self) {
        self.has_flown = true;
    }

    /// The autopilot has armed, or must not any more.
    pub(super) const fn end(&mut self) {
        self.is_due = false;
    }
}
