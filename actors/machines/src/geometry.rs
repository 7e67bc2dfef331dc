//! Positions and displacements, each in a frame that its type names.

use std::ops::{Add, Sub};

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// A position or a displacement in the swarm's local frame: metres north, east and down of the mission's home.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(from = "[f64; 3]", into = "[f64; 3]")]
pub struct Ned(pub Vector3<f64>);

impl Ned {
    /// The mission's home, on the ground.
    pub const HOME: Self = Self(Vector3::new(0.0, 0.0, 0.0));

    /// Metres north, east and down of home.
    #[must_use]
    pub const fn new(north_m: f64, east_m: f64, down_m: f64) -> Self {
        Self(Vector3::new(north_m, east_m, down_m))
    }

    /// Metres north of home.
    #[must_use]
    pub fn north_m(self) -> f64 {
        self.0.x
    }

    /// Metres east of home.
    #[must_use]
    pub fn east_m(self) -> f64 {
        self.0.y
    }

    /// Metres above home.
    #[must_use]
    pub fn altitude_m(self) -> f64 {
        -self.0.z
    }

    /// The same position at another altitude above home, in metres.
    #[must_use]
    pub fn at_altitude(self, altitude_m: f64) -> Self {
        Self::new(self.0.x, self.0.y, -altitude_m)
    }

    /// Horizontal distance in metres.
    #[must_use]
    pub fn horizontal_distance_m(self, other: Self) -> f64 {
        (self.0.xy() - other.0.xy()).norm()
    }

    /// Absolute difference in altitude, in metres.
    #[must_use]
    pub fn vertical_distance_m(self, other: Self) -> f64 {
        (self.0.z - other.0.z).abs()
    }

    /// Distance in metres.
    #[must_use]
    #[inline]
    pub fn distance_m(self, other: Self) -> f64 {
        (self.0 - other.0).norm()
    }

    /// Rotated about the vertical through home, clockwise as seen from above.
    #[must_use]
    pub fn turned(self, heading_rad: f64) -> Self {
        let (sin, cos) = (libm::sin(heading_rad), libm::cos(heading_rad));
        Self::new(
            self.0.x * cos - self.0.y * sin,
            self.0.x * sin + self.0.y * cos,
            self.0.z,
        )
    }
}

/// A velocity in the swarm's local frame: metres per second north, east and down.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(from = "[f64; 3]", into = "[f64; 3]")]
pub struct Velocity(pub Vector3<f64>);

impl Velocity {
    /// At rest.
    pub const ZERO: Self = Self(Vector3::new(0.0, 0.0, 0.0));

    /// Metres per second north, east and down.
    #[must_use]
    pub const fn new(north_mps: f64, east_mps: f64, down_mps: f64) -> Self {
        Self(Vector3::new(north_mps, east_mps, down_mps))
    }
}

impl Add for Ned {
    type Output = Self;

    fn add(self, displacement: Self) -> Self {
        Self(self.0 + displacement.0)
    }
}

impl Sub for Ned {
    type Output = Self;

    fn sub(self, origin: Self) -> Self {
        Self(self.0 - origin.0)
    }
}

impl From<[f64; 3]> for Ned {
    fn from(components: [f64; 3]) -> Self {
        Self(components.into())
    }
}

impl From<Ned> for [f64; 3] {
    fn from(it: Ned) -> Self {
        it.0.into()
    }
}

impl From<[f64; 3]> for Velocity {
    fn from(components: [f64; 3]) -> Self {
        Self(components.into())
    }
}

impl From<Velocity> for [f64; 3] {
    fn from(it: Velocity) -> Self {
        it.0.into()
    }
}
