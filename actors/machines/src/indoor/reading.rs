//! What a range sensor measured, whatever its kind.

use std::time::Duration;

use super::frames::BodyXy;

/// What came back.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Echo {
    /// From this far away, metres from the sensor.
    At(f64),
    /// Nothing came back from within the sensor's range: the way is free, or the echo was lost.
    Silence,
    /// The measurement failed; it says nothing about the room.
    Failed,
}

/// Where a sensor is on the drone, and what it can measure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mounting {
    /// Where it is, in the body frame.
    pub at: BodyXy,
    /// The direction of its axis, radians counter-clockwise from forward.
    pub bearing_rad: f64,
    /// The full angle of its cone, radians; 0 for a ray. In a cone the nearest thing answers.
    pub aperture_rad: f64,
    /// Nearer things are not measured, metres.
    pub range_min_m: f64,
    /// Things farther away do not answer, metres.
    pub range_max_m: f64,
}

impl Mounting {
    /// A laser at `at` that looks in the direction `bearing_rad` and reaches `range_max_m`.
    #[must_use]
    pub const fn laser(at: BodyXy, bearing_rad: f64, range_max_m: f64) -> Self {
        Self {
            at,
            bearing_rad,
            aperture_rad: 0.0,
            range_min_m: 0.0,
            range_max_m,
        }
    }
}

/// One measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// The sensor.
    pub mounting: Mounting,
    /// What came back.
    pub echo: Echo,
    /// When, since the origin of the drone's clock.
    pub taken: Duration,
    /// From when on it is no longer to be used.
    pub expires: Duration,
}

impl Reading {
    /// The time since the measurement; zero if it lies in the future.
    #[must_use]
    pub fn age(&self, now: Duration) -> Duration {
        now.saturating_sub(self.taken)
    }

    /// The measured distance in metres, if it may be used: neither failed nor expired, and within the sensor's range.
    #[must_use]
    pub fn range_m(&self, now: Duration) -> Option<f64> {
        let Mounting {
            range_min_m,
            range_max_m,
            ..
        } = self.mounting;
        match self.echo {
            Echo::At(range_m) if range_m >= range_min_m && range_m <= range_max_m => {
                (now < self.expires).then_some(range_m)
            }
            _ => None,
        }
    }

    /// Whether nothing answered, and that still holds.
    #[must_use]
    pub fn is_silent(&self, now: Duration) -> bool {
        self.echo == Echo::Silence && now < self.expires
    }
}
