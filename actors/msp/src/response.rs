//! How a controller answers sticks in the mode ANGLE.

/// Settings that turn a stick into a tilt: rates of the type ACTUAL without expo, the same for roll and pitch.
///
/// Betaflight from 4.5 on aims at `angle_limit` times the share of the largest rate that the stick asks for
/// (`flight/pid.c`). These rates grow with the deflection x, 0 to 1, as `centre · x + (max − centre) · x²` (`fc/rc.c`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StickResponse {
    /// `roll_rc_rate` and `pitch_rc_rate`: rate at small deflections, extended to a full one, in 10 °/s.
    pub rc_rate: u8,
    /// `roll_srate` and `pitch_srate`: rate at full deflection, in 10 °/s.
    pub srate: u8,
    /// `angle_limit`: tilt at full deflection, in °.
    pub angle_limit_deg: u8,
}

impl StickResponse {
    /// What flight by sticks assumes, and [`check`](crate::check::check) demands: Betaflight 4.6's defaults.
    pub const ASSUMED: Self = Self {
        rc_rate: 7,
        srate: 67,
        angle_limit_deg: 60,
    };

    /// The tilt that a stick's deflection asks for in the mode ANGLE, in radians. `deflection`: -1 to 1.
    #[must_use]
    pub fn tilt_rad(&self, deflection: f64) -> f64 {
        let (centre, max) = (f64::from(self.rc_rate), f64::from(self.srate));
        let rate = deflection * (centre + (max - centre) * deflection.abs());
        f64::from(self.angle_limit_deg).to_radians() * rate / max
    }
}
