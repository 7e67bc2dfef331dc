use super::shape::Shape;
use crate::flaw::{self, Flaw};

/// Regular matrix: ⌈√n⌉ columns, filled row by row from the front left. The centre is in column ⌊(columns − 1) / 2⌋ of
/// row ⌊rows / 2⌋, as flown for the thesis's tables 12 and 13.
pub(super) fn regular(drones: u32, spacing_m: f64) -> Shape {
    let columns = ceiling_of_root(drones);
    let rows = drones.div_ceil(columns);
    let (column, row) = ((columns - 1) / 2, rows / 2);
    let slots = (0..drones).map(|index| {
        let right = i64::from(index % columns) - i64::from(column);
        let behind = i64::from(index / columns) - i64::from(row);
        on_grid(-behind, right, spacing_m)
    });
    Shape::new(row * columns + column, slots)
}

/// Compact matrix: the centre first, then square rings. Each ring is filled from the nearest place, so the drones of an
/// incomplete last ring stand at the middles of its sides.
pub(super) fn compact(drones: u32, spacing_m: f64) -> Shape {
    let rings = (0..).flat_map(|ring: i64| {
        let mut places: Vec<(i64, i64)> = (-ring..=ring)
            .flat_map(|ahead| (-ring..=ring).map(move |right| (ahead, right)))
            .filter(|(ahead, right)| {
                ahead.abs().max(right.abs()) == ring || flaw::has(Flaw::RepeatsInnerRings)
            })
            .collect();
        places.sort_by_key(|(ahead, right)| (ahead * ahead + right * right, -ahead, *right));
        places
    });
    let places = rings.take(drones as usize);
    Shape::new(
        0,
        places.map(|(ahead, right)| on_grid(ahead, right, spacing_m)),
    )
}

fn on_grid(ahead: i64, right: i64, spacing_m: f64) -> ((f64, f64), u64) {
    #[expect(
        clippy::cast_precision_loss,
        reason = "a side has fewer rows than drones"
    )]
    let place = (ahead as f64 * spacing_m, right as f64 * spacing_m);
    (place, (ahead * ahead + right * right).unsigned_abs())
}

fn ceiling_of_root(number: u32) -> u32 {
    let root = number.isqrt();
    root + u32::from(root * root < number)
}
