//! Altitude as the firmware estimates it from barometer and GPS.
//!
//! Behaviour: Betaflight 4.5, `flight/position.c`. Its filters have two poles, these one of the same delay.

/// Weight of GPS beside the barometer without a figure for its precision.
const GPS_TRUST: f64 = 0.3;

/// Difference of the two, in metres, above which GPS counts less.
const DISAGREEMENT_M: f64 = 1.0;

/// Delays of altitude and climb rate, in seconds: two poles at 3 Hz (`altitude_lpf`) and 1 Hz (`altitude_d_lpf`), whose cutoffs
/// are 1.55 times as high.
const ALTITUDE_LAG_S: f64 = 0.068;
const CLIMB_LAG_S: f64 = 0.205;

/// Climb rates that count as none, in m/s.
const CLIMB_DEADBAND_MPS: f64 = 0.1;

/// What barometer and GPS say, in metres.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Altitudes {
    pub(crate) barometer_m: f64,
    /// Above sea level; `None` without a fix.
    pub(crate) gps_m: Option<f64>,
}

#[derive(Debug, Clone, Default)]
pub(crate) struct AltitudeEstimate {
    barometer_zero_m: f64,
    gps_zero_m: Option<f64>,
    is_armed: bool,
    altitude_m: f64,
    climb_mps: f64,
    /// What is shown, in metres.
    shown_m: f64,
}

impl AltitudeEstimate {
    /// Moves on by `span_s` seconds.
    pub(crate) fn update(&mut self, is_armed: bool, measured: Altitudes, span_s: f64) {
        let target_m = if is_armed {
            self.above_start_m(measured)
        } else {
            self.barometer_zero_m = measured.barometer_m;
            self.gps_zero_m = measured.gps_m.or(self.gps_zero_m);
            0.0
        };
        let before_m = self.altitude_m;
        self.altitude_m += (target_m - self.altitude_m) * share(span_s, ALTITUDE_LAG_S);
        let climb_mps = (self.altitude_m - before_m) / span_s;
        self.climb_mps += (climb_mps - self.climb_mps) * share(span_s, CLIMB_LAG_S);
        self.is_armed = is_armed;
        self.shown_m = if is_armed {
            self.altitude_m
        } else {
            measured.gps_m.unwrap_or(0.0)
        };
    }

    fn above_start_m(&self, measured: Altitudes) -> f64 {
        let barometer_m = measured.barometer_m - self.barometer_zero_m;
        let Some((gps_m, zero_m)) = measured.gps_m.zip(self.gps_zero_m) else {
            return barometer_m;
        };
        let gps_m = gps_m - zero_m;
        let difference_m = (gps_m - barometer_m).abs();
        let trust = GPS_TRUST / (difference_m / DISAGREEMENT_M).max(1.0);
        gps_m * trust + barometer_m * (1.0 - trust)
    }

    /// Above the place of arming while armed; else above sea level by GPS, 0 without a fix. In metres.
    pub(crate) fn shown_m(&self) -> f64 {
        self.shown_m
    }

    /// Upward speed, in m/s; 0 within the deadband.
    pub(crate) fn climb_mps(&self) -> f64 {
        let beyond = (self.climb_mps.abs() - CLIMB_DEADBAND_MPS).max(0.0);
        libm::copysign(beyond, self.climb_mps)
    }
}

/// Share of the way to its input that a first-order lag goes in `span_s`.
pub(crate) fn share(span_s: f64, lag_s: f64) -> f64 {
    1.0 - libm::exp(-span_s / lag_s)
}
