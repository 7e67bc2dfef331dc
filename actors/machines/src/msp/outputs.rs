//! What leaves a flight-controller link.

use muster_msp::SetRawRc;

use super::autopilot::Order;
use super::{Checkpoint, Event, Telemetry, Transmit};
use crate::machine::{Outbox, Output};
use crate::time::Timestamp;

/// Outputs of a link to a flight controller or an autopilot.
///
/// Invariant: `last` and `kept` are the telemetry and the checkpoint that were put into the outbox last.
#[derive(Debug)]
pub(super) struct Outputs {
    last: Option<Telemetry>,
    kept: Option<Checkpoint>,
    outbox: Outbox<Transmit, Event>,
}

impl Outputs {
    pub(super) const fn new() -> Self {
        Self {
            last: None,
            kept: None,
            outbox: Outbox::new(),
        }
    }

    /// Sends RC to a flight controller, or ends it.
    pub(super) fn rc(&mut self, rc: Option<SetRawRc>) {
        self.outbox.transmit(Transmit::Rc(rc));
    }

    /// Sends an order to an autopilot.
    pub(super) fn order(&mut self, order: Order) {
        self.outbox.transmit(Transmit::Order(order));
    }

    /// Asks the navigation for its goal, after a restart.
    pub(super) fn resync(&mut self) {
        self.outbox.transmit(Transmit::Resync);
    }

    /// Tells the navigation.
    pub(super) fn report(&mut self, telemetry: Telemetry) {
        self.last = Some(telemetry);
        self.outbox.transmit(Transmit::Telemetry(telemetry));
    }

    /// Tells the navigation, if it must know this at once.
    pub(super) fn report_if_news(&mut self, telemetry: Telemetry) {
        if telemetry.is_news(self.last) {
            self.report(telemetry);
        }
    }

    /// Keeps a checkpoint.
    pub(super) fn keep(&mut self, checkpoint: Checkpoint) {
        self.kept = Some(checkpoint);
        self.outbox.event(Event::Checkpoint(checkpoint));
    }

    /// Keeps a checkpoint, unless it is the same as the last one.
    pub(super) fn keep_if_changed(&mut self, checkpoint: Checkpoint) {
        if !self.kept.is_some_and(|kept| kept.is_same(&checkpoint)) {
            self.keep(checkpoint);
        }
    }

    /// The next output; idle until `deadline` if there is none.
    pub(super) fn poll(&mut self, deadline: Option<Timestamp>) -> Output<Transmit, Event> {
        self.outbox.poll(deadline)
    }
}
