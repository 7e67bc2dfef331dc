//! Speeds along a straight leg.

/// A straight leg from rest to rest: a trapezoid of speed, or a triangle if the leg is too short for the full speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Leg {
    length_m: f64,
    /// Highest speed that is reached, in m/s.
    peak_mps: f64,
    acceleration_mps2: f64,
}

impl Leg {
    /// A leg of this length in metres, with at most this speed in m/s, and this acceleration in m/s².
    #[must_use]
    pub fn new(length_m: f64, speed_mps: f64, acceleration_mps2: f64) -> Self {
        Self {
            length_m,
            peak_mps: speed_mps.min((length_m * acceleration_mps2).sqrt()),
            acceleration_mps2,
        }
    }

    pub(super) const fn peak_mps(&self) -> f64 {
        self.peak_mps
    }

    /// Time to reach the highest speed, and to brake from it, in seconds.
    pub(super) const fn ramp_s(&self) -> f64 {
        self.peak_mps / self.acceleration_mps2
    }

    /// Distance flown in that time, in metres.
    pub(super) const fn ramp_m(&self) -> f64 {
        self.peak_mps * self.ramp_s() / 2.0
    }

    /// Time at the highest speed, in seconds.
    pub(super) const fn cruise_s(&self) -> f64 {
        (self.length_m - 2.0 * self.ramp_m()).max(0.0) / self.peak_mps
    }

    /// Time from rest to rest, in seconds; 0 for a leg without length.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        if self.length_m > 0.0 {
            2.0 * self.ramp_s() + self.cruise_s()
        } else {
            0.0
        }
    }

    /// Distance flown after a time in seconds, in metres; the length of the leg once that is over.
    #[must_use]
    pub fn flown_m(&self, after_s: f64) -> f64 {
        let left_s = self.duration_s() - after_s;
        let on_ramp_m = |ramp_s: f64| ramp_s * ramp_s * self.acceleration_mps2 / 2.0;
        if left_s <= 0.0 {
            self.length_m
        } else if after_s < self.ramp_s() {
            on_ramp_m(after_s.max(0.0))
        } else if left_s < self.ramp_s() {
            self.length_m - on_ramp_m(left_s)
        } else {
            self.ramp_m() + (after_s - self.ramp_s()) * self.peak_mps
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::geometry::Ned;
    use crate::motion::Motion;
    use crate::time::Timestamp;

    proptest! {
        #[test]
        fn leg_is_flown_as_a_simulated_vehicle_flies_it(
            length_m in 0.01..500.0_f64,
            speed_mps in 0.5..20.0_f64,
            acceleration_mps2 in 0.5..8.0_f64,
            share in 0.0..1.2_f64,
        ) {
            let mut motion = Motion::at_rest(Ned::HOME);
            motion.fly(Ned::new(length_m, 0.0, 0.0), speed_mps, acceleration_mps2);
            let leg = Leg::new(length_m, speed_mps, acceleration_mps2);
            let after_s = share * leg.duration_s();
            let flown_m = motion.position(Timestamp::from_secs_f64(after_s)).north_m();
            prop_assert!((leg.flown_m(after_s) - flown_m).abs() < 1e-5);
        }
    }
}
