//! Points, poses and motions in the plane. The frame is part of the type, so frames can't be mixed.
//!
//! Metres and radians. x is forward in the body frame, y is left, angles grow counter-clockwise. Altitude is no concern here:
//! maps are flat.

use std::f64::consts::{PI, TAU};
use std::fmt;
use std::marker::PhantomData;

use serde::{Deserialize, Serialize};

/// The map's frame, as its file gives it: x right and y up as the map is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MapFrame {}

/// The odometry's frame: continuous, but it drifts from the map's.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OdometryFrame {}

/// The drone's own frame: x forward, y left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BodyFrame {}

/// A point in the map's frame.
pub type MapXy = Point<MapFrame>;
/// A point in the odometry's frame.
pub type OdometryXy = Point<OdometryFrame>;
/// A point in the body frame.
pub type BodyXy = Point<BodyFrame>;
/// Where the drone is on the map, and which way it looks.
pub type MapPose = Pose<MapFrame>;
/// Where the odometry has the drone, and which way it looks.
pub type OdometryPose = Pose<OdometryFrame>;

/// A point of the plane, metres.
#[derive(Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Point<F> {
    /// Metres along the frame's x axis.
    pub x_m: f64,
    /// Metres along the frame's y axis.
    pub y_m: f64,
    #[serde(skip)]
    frame: PhantomData<F>,
}

/// A place and a heading.
#[derive(Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Pose<F> {
    /// The place.
    pub at: Point<F>,
    /// Radians counter-clockwise from the frame's x axis, in (−π, π].
    pub heading_rad: f64,
}

/// A change of pose, in the body frame before the change.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Motion {
    /// Metres forward.
    pub forward_m: f64,
    /// Metres to the left.
    pub left_m: f64,
    /// Radians counter-clockwise.
    pub turn_rad: f64,
}

impl<F> Point<F> {
    /// The point at `x_m`, `y_m`.
    #[must_use]
    pub const fn new(x_m: f64, y_m: f64) -> Self {
        Self {
            x_m,
            y_m,
            frame: PhantomData,
        }
    }

    /// Metres to another point.
    #[must_use]
    pub fn distance_m(self, other: Self) -> f64 {
        libm::hypot(other.x_m - self.x_m, other.y_m - self.y_m)
    }

    /// Radians from the frame's x axis to `other`, seen from here; 0 for the same point.
    #[must_use]
    pub fn bearing_rad(self, other: Self) -> f64 {
        libm::atan2(other.y_m - self.y_m, other.x_m - self.x_m)
    }

    /// The point `distance_m` from here in the direction `bearing_rad`.
    #[must_use]
    pub fn towards(self, bearing_rad: f64, distance_m: f64) -> Self {
        Self::new(
            self.x_m + distance_m * libm::cos(bearing_rad),
            self.y_m + distance_m * libm::sin(bearing_rad),
        )
    }
}

impl<F> Pose<F> {
    /// The pose at `x_m`, `y_m`; the heading is wrapped.
    #[must_use]
    pub fn new(x_m: f64, y_m: f64, heading_rad: f64) -> Self {
        Self {
            at: Point::new(x_m, y_m),
            heading_rad: wrapped_rad(heading_rad),
        }
    }

    /// A point of the body frame, in this pose's frame.
    #[must_use]
    pub fn place(self, point: BodyXy) -> Point<F> {
        let (sin, cos) = (libm::sin(self.heading_rad), libm::cos(self.heading_rad));
        Point::new(
            self.at.x_m + cos * point.x_m - sin * point.y_m,
            self.at.y_m + sin * point.x_m + cos * point.y_m,
        )
    }

    /// A point of this pose's frame, as the drone sees it.
    #[must_use]
    pub fn sight(self, point: Point<F>) -> BodyXy {
        let (sin, cos) = (libm::sin(self.heading_rad), libm::cos(self.heading_rad));
        let (dx, dy) = (point.x_m - self.at.x_m, point.y_m - self.at.y_m);
        Point::new(cos * dx + sin * dy, cos * dy - sin * dx)
    }

    /// The pose after a motion.
    #[must_use]
    pub fn moved(self, motion: Motion) -> Self {
        let at = self.place(Point::new(motion.forward_m, motion.left_m));
        Self::new(at.x_m, at.y_m, self.heading_rad + motion.turn_rad)
    }

    /// The motion that leads to `later`.
    #[must_use]
    pub fn motion_to(self, later: Self) -> Motion {
        let seen = self.sight(later.at);
        Motion {
            forward_m: seen.x_m,
            left_m: seen.y_m,
            turn_rad: wrapped_rad(later.heading_rad - self.heading_rad),
        }
    }
}

/// The same angle in (−π, π].
#[must_use]
pub fn wrapped_rad(angle_rad: f64) -> f64 {
    if angle_rad > -PI && angle_rad <= PI {
        return angle_rad;
    }
    let turned = libm::fmod(angle_rad, TAU);
    if turned > PI {
        turned - TAU
    } else if turned <= -PI {
        turned + TAU
    } else {
        turned
    }
}

// Derives would ask the same of the frame.
impl<F> Clone for Point<F> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<F> Copy for Point<F> {}

impl<F> PartialEq for Point<F> {
    fn eq(&self, other: &Self) -> bool {
        (self.x_m, self.y_m) == (other.x_m, other.y_m)
    }
}

impl<F> fmt::Debug for Point<F> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "({} m, {} m)", self.x_m, self.y_m)
    }
}

impl<F> Clone for Pose<F> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<F> Copy for Pose<F> {}

impl<F> PartialEq for Pose<F> {
    fn eq(&self, other: &Self) -> bool {
        (self.at, self.heading_rad) == (other.at, other.heading_rad)
    }
}

impl<F> fmt::Debug for Pose<F> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?} heading {} rad", self.at, self.heading_rad)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn motion_between_poses_leads_from_one_to_the_other(
            a in prop::array::uniform3(-50.0..50.0),
            b in prop::array::uniform3(-50.0..50.0),
        ) {
            let (from, to) = (MapPose::new(a[0], a[1], a[2]), MapPose::new(b[0], b[1], b[2]));
            let reached = from.moved(from.motion_to(to));
            prop_assert!(reached.at.distance_m(to.at) < 1e-9);
            prop_assert!(wrapped_rad(reached.heading_rad - to.heading_rad).abs() < 1e-9);
        }

        #[test]
        fn what_is_seen_is_placed_where_it_is(
            pose in prop::array::uniform3(-50.0..50.0),
            point in prop::array::uniform2(-50.0..50.0),
        ) {
            let pose = MapPose::new(pose[0], pose[1], pose[2]);
            let point = MapXy::new(point[0], point[1]);
            prop_assert!(pose.place(pose.sight(point)).distance_m(point) < 1e-9);
        }

        #[test]
        fn angles_wrap_to_the_half_open_turn(angle in -1000.0..1000.0) {
            let wrapped = wrapped_rad(angle);
            prop_assert!(wrapped > -PI && wrapped <= PI);
            prop_assert!((libm::sin(wrapped) - libm::sin(angle)).abs() < 1e-9);
            prop_assert!((libm::cos(wrapped) - libm::cos(angle)).abs() < 1e-9);
        }
    }

    #[test]
    fn body_x_is_forward_and_y_is_left() {
        let north = MapPose::new(1.0, 2.0, PI / 2.0);
        let placed = north.place(BodyXy::new(3.0, 1.0));
        assert!(placed.distance_m(MapXy::new(0.0, 5.0)) < 1e-12);
    }
}
