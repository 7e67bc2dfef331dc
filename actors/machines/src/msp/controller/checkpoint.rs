//! What a link keeps, to go on after a restart.

use serde::{Deserialize, Serialize};

use super::authority::Taken;
use crate::geometry::Ned;
use crate::msp::{LandingCause, Setpoint};

/// What a link needs to go on after a restart.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Flight {
    /// The motors were or may have been armed.
    pub has_flown: bool,
    /// What it was told to fly.
    pub setpoint: Option<Setpoint>,
    /// Where it began to fly that, in its drone's local frame.
    pub from: Option<Ned>,
    /// Where it was when it was first told to fly.
    pub start: Option<Ned>,
    /// Whether it was well above that place.
    pub is_high: bool,
    /// Whether it was landing.
    pub is_landing: bool,
    /// Throttle at which the vehicle hovers, 0 to 1.
    pub hover_throttle: f64,
    /// The barometer's altitude on the ground, in metres.
    pub ground_m: Option<f64>,
    /// Whether the pilot or the controller's failsafe took the aircraft.
    pub taken: Taken,
    /// Why it lands, if the aircraft does not do what it is told.
    pub impaired: Option<LandingCause>,
}

/// Change of the hover throttle for which a checkpoint is written: with one so far off a vehicle sinks or climbs 0.2 m before that
/// is learnt. Ours.
const HOVER_THROTTLE_STEP: f64 = 0.01;

impl Flight {
    /// Whether nothing has changed that a checkpoint is written for: the hover throttle always changes a little.
    pub(in crate::msp) fn is_same(&self, other: &Self) -> bool {
        if (self.hover_throttle - other.hover_throttle).abs() >= HOVER_THROTTLE_STEP {
            return false;
        }
        let hover_throttle = other.hover_throttle;
        *other
            == Self {
                hover_throttle,
                ..*self
            }
    }
}
