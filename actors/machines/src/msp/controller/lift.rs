//! Whether an armed vehicle has left the ground.

/// Altitude and climb of a vehicle that has left the ground, in metres and m/s. Until then it is kept level: leaning on the
/// ground tips it over.
const LIFTED_M: f64 = 0.5;
/// See [`LIFTED_M`].
const LIFTED_MPS: f64 = 0.3;

/// What is known of whether a vehicle has left the ground.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Lift {
    /// It stands, as far as is known.
    Ground,
    /// It was armed when it was met, and nothing is known of its flight: it may be in the air.
    Unknown,
    /// It has left the ground.
    Left,
}

impl Lift {
    /// Takes in its altitude and its climb rate, in metres and m/s. Returns whether it is in the air now.
    pub(super) fn look(&mut self, altitude_m: f64, climb_mps: f64) -> bool {
        let is_high = altitude_m > LIFTED_M;
        if is_high && (climb_mps > LIFTED_MPS || *self == Self::Unknown) {
            *self = Self::Left;
        }
        is_high && *self == Self::Left
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stands_leaves_the_ground_by_climbing_and_what_was_met_armed_by_its_height() {
        let mut lift = Lift::Ground;
        assert!(!lift.look(0.6, 0.0), "a wrong height");
        assert!(!lift.look(0.4, 1.0));
        assert!(lift.look(0.6, 0.4) && lift.look(0.6, -1.0));
        assert!(!lift.look(0.4, -1.0) && lift == Lift::Left);
        let mut lift = Lift::Unknown;
        assert!(!lift.look(0.4, 0.0));
        assert!(lift.look(0.6, 0.0));
    }
}
