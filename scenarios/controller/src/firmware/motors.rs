//! Outputs of the motors.

/// Duty cycles of the four motors, from 0 to 1.
#[derive(Debug, Clone, Default)]
pub(crate) struct Motors {
    /// The last duty cycles.
    duties: [f64; 4],
    /// What `SET_MOTOR` asks of a disarmed aircraft.
    test: [f64; 4],
}

impl Motors {
    /// Turns the motors as the stabiliser says.
    #[inline]
    pub(crate) fn drive(&mut self, duties: [f64; 4]) {
        self.duties = duties;
    }

    /// Turns the motors of a disarmed aircraft as `SET_MOTOR` said last.
    pub(crate) fn drive_test(&mut self) {
        self.duties = self.test;
    }

    /// Sets what [`Self::drive_test`] does, in µs from 1,000 to 2,000. Motors without a value keep theirs.
    pub(crate) fn set_test(&mut self, outputs_us: &[u16]) {
        for (duty, output_us) in self.test.iter_mut().zip(outputs_us) {
            *duty = ((f64::from(*output_us) - 1_000.0) / 1_000.0).clamp(0.0, 1.0);
        }
    }

    /// The last duty cycles.
    pub(crate) fn duties(&self) -> &[f64; 4] {
        &self.duties
    }
}
