//! A simulated flight controller and its line, and what goes wrong with them.

use std::time::Duration;

use muster_controller::{Controller, Fault};
use muster_machines::time::Timestamp;

use super::line::Line;
use crate::scenario::ControllerFault;

/// A controller and its line, with the faults of a plan.
#[derive(Debug)]
pub struct FaultyController {
    /// The controller.
    pub controller: Controller,
    /// The line between it and its companion.
    pub line: Line,
    /// When the line can be opened again.
    closed_until: Timestamp,
    /// When the firmware goes on. `None` if it runs.
    frozen_until: Option<Timestamp>,
    /// When the battery's voltage is back. `None` if it is there.
    sags_until: Option<Timestamp>,
    /// When the motors have their thrust again. `None` if they have.
    weak_until: Option<Timestamp>,
    /// Shares of thrust that are lost.
    lost: [f64; 4],
    /// When the aircraft vibrates no more. `None` if it doesn't.
    shakes_until: Option<Timestamp>,
}

impl FaultyController {
    /// Without faults. `seed` draws which bytes a fault of the line meets.
    #[must_use]
    pub fn new(controller: Controller, seed: u64) -> Self {
        Self {
            controller,
            line: Line::new(seed),
            closed_until: Timestamp::ZERO,
            frozen_until: None,
            sags_until: None,
            weak_until: None,
            lost: [0.0; 4],
            shakes_until: None,
        }
    }

    /// Whether the line is closed.
    #[must_use]
    pub fn is_closed(&self, now: Timestamp) -> bool {
        now < self.closed_until
    }

    /// Whether the firmware hangs.
    #[must_use]
    pub fn is_frozen(&self, now: Timestamp) -> bool {
        self.frozen_until.is_some_and(|until| now < until)
    }

    /// Ends the faults of the controller that are over.
    pub fn recover(&mut self, now: Timestamp) {
        if self.frozen_until.take_if(|until| *until <= now).is_some() {
            self.controller.fault(now, Fault::Frozen(false));
        }
        if self.sags_until.take_if(|until| *until <= now).is_some() {
            self.controller.fault(now, Fault::Sag(0.0));
        }
        if self.weak_until.take_if(|until| *until <= now).is_some() {
            self.lost = [0.0; 4];
            self.controller.fault(now, Fault::Weak(self.lost));
        }
        if self.shakes_until.take_if(|until| *until <= now).is_some() {
            self.controller.fault(now, Fault::Shake(0.0));
        }
    }

    /// Injects a fault, for so long or for good. [`ControllerFault::TakeOver`] is the pilot's, and does nothing here.
    pub fn affect(&mut self, now: Timestamp, fault: ControllerFault, lasts: Option<Duration>) {
        let until = now + lasts.unwrap_or(Duration::MAX);
        match fault {
            ControllerFault::Freeze => {
                self.controller.fault(now, Fault::Frozen(true));
                self.frozen_until = Some(until);
            }
            ControllerFault::ClosePort => self.closed_until = until,
            ControllerFault::LoseBytes(share) => self.line.lose(share, until),
            ControllerFault::CorruptBytes(share) => self.line.corrupt(share, until),
            ControllerFault::DelayBytes(by) => self.line.delay(by, until),
            ControllerFault::SagBattery(volts) => {
                self.controller.fault(now, Fault::Sag(volts));
                self.sags_until = Some(until);
            }
            ControllerFault::WeakenMotor(motor, share) => {
                for (own, lost) in (1..).zip(&mut self.lost) {
                    if motor.is_none_or(|motor| motor == own) {
                        *lost = share;
                    }
                }
                self.controller.fault(now, Fault::Weak(self.lost));
                self.weak_until = Some(until);
            }
            ControllerFault::Shake(dps) => {
                self.controller.fault(now, Fault::Shake(dps.to_radians()));
                self.shakes_until = Some(until);
            }
            ControllerFault::TakeOver => {}
        }
    }
}
