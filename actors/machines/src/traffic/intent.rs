use crate::formation::Path;
use crate::geometry::Ned;
use crate::wire::Intent;

/// Altitude below which a path ends on the ground, in metres.
pub(super) const GROUND_ALTITUDE_M: f64 = 1.0;
/// Largest horizontal length of a vertical path, in metres.
pub(super) const VERTICAL_M: f64 = 1.0;

/// Largest rounding error of an announced path, in metres: positions are rounded to decimetres on each axis.
pub(super) const ROUNDING_M: f64 = 0.1;

/// Number of steps of the announced progress.
const PROGRESS_STEPS: f64 = 128.0;

impl Intent {
    /// The closest encoding of a path with this fraction flown.
    #[must_use]
    pub fn of(path: Path, share: f64, has_priority: bool) -> Self {
        // No mission reaches 2^31 decimetres.
        let decimetres = |place: Ned| <[f64; 3]>::from(place).map(|it| (it * 10.0).round() as i32);
        Self {
            from_dm: decimetres(path.from),
            to_dm: decimetres(path.to),
            flown: (share * PROGRESS_STEPS).clamp(0.0, PROGRESS_STEPS - 1.0) as u8,
            has_priority,
        }
    }

    /// The path, in metres.
    #[must_use]
    pub fn path(self) -> Path {
        let metres = |place: [i32; 3]| Ned::from(place.map(|it| f64::from(it) / 10.0));
        Path {
            from: metres(self.from_dm),
            to: metres(self.to_dm),
        }
    }

    /// Whether the path is vertical and ends on the ground.
    pub(super) fn lands(self) -> bool {
        let path = self.path();
        is_vertical(path) && path.to.altitude_m() < GROUND_ALTITUDE_M
    }

    /// Whether the drone follows a master.
    pub(super) fn is_following(self) -> bool {
        self.has_priority && !self.lands()
    }

    /// The same at the end of the path.
    pub(super) const fn arrived(self) -> Self {
        Self {
            from_dm: self.to_dm,
            ..self
        }
    }

    /// Remaining path, in metres.
    pub(super) fn remaining(self) -> Path {
        let path = self.path();
        Path {
            from: path.at(f64::from(self.flown) / PROGRESS_STEPS),
            ..path
        }
    }
}

/// Whether a path is stationary or vertical.
pub(super) fn is_vertical(path: Path) -> bool {
    path.from.horizontal_distance_m(path.to) <= VERTICAL_M
}
