use super::shape::Shape;

/// Line: from left to right. The centre is the middle slot, or the one right of the middle for an even number.
pub(super) fn linear(drones: u32, spacing_m: f64) -> Shape {
    let centre = drones / 2;
    let slots = (0..drones).map(|index| {
        let right_m = (f64::from(index) - f64::from(centre)) * spacing_m;
        ((0.0, right_m), u64::from(index.abs_diff(centre)))
    });
    Shape::new(centre, slots)
}
