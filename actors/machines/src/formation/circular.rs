use std::f64::consts::PI;

use super::shape::Shape;

/// Circle: the centre first, the others evenly around it, clockwise from ahead.
///
/// The radius is the spacing, or larger if neighbours on the circle would be closer than the spacing.
pub(super) fn circular(drones: u32, spacing_m: f64) -> Shape {
    let around = drones - 1;
    let half_angle = PI / f64::from(around.max(2));
    let radius_m = spacing_m.max(spacing_m / (2.0 * libm::sin(half_angle)));
    let on_circle = (0..around).map(|index| {
        let angle = 2.0 * PI * f64::from(index) / f64::from(around);
        let place = (radius_m * libm::cos(angle), radius_m * libm::sin(angle));
        (place, 1)
    });
    Shape::new(0, std::iter::once(((0.0, 0.0), 0)).chain(on_circle))
}
