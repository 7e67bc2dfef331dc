use super::shape::Shape;

/// Side by side, from left to right; the centre is the middle or, of an even number, the one right of it.
pub(super) fn linear(drones: u32, spacing_m: f64) -> Shape {
    let centre = drones / 2;
    let slots = (0..drones).map(|index| {
        let right_m = (f64::from(index) - f64::from(centre)) * spacing_m;
        ((0.0, right_m), u64::from(index.abs_diff(centre)))
    });
    Shape::new(centre, slots)
}
