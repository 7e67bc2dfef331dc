//! How well measurements agree with the estimate's covariance.

use super::axis::Correction;

/// Of 100 normal numbers 95 are within this many standard deviations.
const BOUND: f64 = 1.959_964;

/// What accepted measurements in flight differed by from their predictions, beside the standard deviations of those differences.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Innovations {
    /// Of positions of GPS or poses, on each horizontal axis.
    pub position: Agreement,
    /// Of velocities of GPS, on each horizontal axis.
    pub velocity: Agreement,
    /// Of heights of poses, or of the controller.
    pub height: Agreement,
}

/// How many differences were within the bounds that hold 95 of 100, if the covariance is honest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Agreement {
    /// All.
    pub counted: u64,
    /// Those within the bounds.
    pub inside: u64,
}

impl Agreement {
    pub(super) fn count(&mut self, corrections: impl IntoIterator<Item = Correction>) {
        for it in corrections {
            self.counted += 1;
            self.inside += u64::from(it.normalised.abs() <= BOUND);
        }
    }
}
