use std::f64::consts::{FRAC_PI_3, PI};
use std::num::NonZeroU32;

use super::mesh::Hexagonal;
use super::shape::Shape;
use crate::flaw::{self, Flaw};

/// Split-up: the centre first, then one cluster after the other. Each cluster is a part of a mesh that spreads outwards
/// from its head. The heads are evenly spaced on a circle around the centre, clockwise from ahead.
///
/// Drones of different clusters are at least `distance_m` apart. A cluster lies in a wedge as wide as its share of the
/// circle, at most a third of the circle. So two drones of different clusters are never closer than two neighbouring
/// heads. The remainder of (n − 1) / clusters goes to the first clusters.
///
/// In succession the heads come right after the centre: without the centre, each leads its cluster.
pub(super) fn split_up(
    drones: u32,
    spacing_m: f64,
    clusters: NonZeroU32,
    distance_m: f64,
) -> Shape {
    let members = drones - 1;
    let count = clusters.get();
    let head_m = head_distance_m(spacing_m, clusters, distance_m);
    let half_wedge = FRAC_PI_3.min(PI / f64::from(count));
    let in_clusters = (0..count).flat_map(|cluster| {
        let has_extra_drone = cluster < members % count && !flaw::has(Flaw::DropsRemainder);
        let size = members / count + u32::from(has_extra_drone);
        let course = 2.0 * PI * f64::from(cluster) / f64::from(count);
        let (sin, cos) = (libm::sin(course), libm::cos(course));
        let head_m = if flaw::has(Flaw::StretchesDiagonals) {
            head_m / sin.abs().max(cos.abs())
        } else {
            head_m
        };
        wedge(half_wedge)
            .take(size as usize)
            .map(move |point| {
                let (out_m, right_m) = point.place_m(spacing_m);
                let out_m = out_m + head_m;
                let place = (out_m * cos - right_m * sin, out_m * sin + right_m * cos);
                (place, 1 + point.distance_squared())
            })
            .collect::<Vec<_>>()
    });
    Shape::new(0, std::iter::once(((0.0, 0.0), 0)).chain(in_clusters))
}

/// Distance of each cluster's head from the centre, in metres.
pub(super) fn head_distance_m(spacing_m: f64, clusters: NonZeroU32, distance_m: f64) -> f64 {
    if clusters.get() == 1 {
        return spacing_m;
    }
    let half_angle = PI / f64::from(clusters.get());
    spacing_m.max(distance_m / (2.0 * libm::sin(half_angle)))
}

/// Points of a mesh in a wedge that opens straight ahead, edges included, from the head outwards.
fn wedge(half_angle: f64) -> impl Iterator<Item = Hexagonal> {
    let slope = libm::tan(half_angle.min(FRAC_PI_3)) + 1e-9;
    (0..).flat_map(Hexagonal::ring).filter(move |point| {
        let (ahead, right) = point.place_m(1.0);
        right.abs() <= slope * ahead
    })
}
