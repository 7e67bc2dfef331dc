//! Places on a path of straight legs.

use crate::frames::MapXy;

/// Distance from a path, and the place on it: leg and metres along that.
pub(super) fn along(path: &[MapXy], from: MapXy) -> (f64, (usize, f64)) {
    let mut best = (f64::INFINITY, (0, 0.0));
    for (leg, ends) in path.windows(2).enumerate() {
        let length_m = ends[0].distance_m(ends[1]);
        let (dx, dy) = (ends[1].x_m - ends[0].x_m, ends[1].y_m - ends[0].y_m);
        let dot = (from.x_m - ends[0].x_m) * dx + (from.y_m - ends[0].y_m) * dy;
        let along_m = (dot / length_m.max(1e-9)).clamp(0.0, length_m);
        let away_m = from.distance_m(on_leg(ends[0], ends[1], along_m));
        // Of places equally near, the later one: the drone has passed the others.
        if away_m <= best.0 {
            best = (away_m, (leg, along_m));
        }
    }
    if path.len() < 2 {
        best.0 = path.first().map_or(0.0, |only| from.distance_m(*only));
    }
    best
}

fn on_leg(from: MapXy, to: MapXy, along_m: f64) -> MapXy {
    from.towards(from.bearing_rad(to), along_m)
}

/// Length of a path from a place on it, in metres.
pub(super) fn length_from(path: &[MapXy], (leg, along_m): (usize, f64)) -> f64 {
    let rest = path
        .windows(2)
        .skip(leg)
        .map(|ends| ends[0].distance_m(ends[1]));
    rest.sum::<f64>() - along_m
}

/// The point `ahead_m` metres along a path from a place on it.
pub(super) fn point_at(path: &[MapXy], (leg, along_m): (usize, f64), ahead_m: f64) -> MapXy {
    let mut left_m = along_m + ahead_m;
    for ends in path.windows(2).skip(leg) {
        let length_m = ends[0].distance_m(ends[1]);
        if left_m <= length_m {
            return on_leg(ends[0], ends[1], left_m);
        }
        left_m -= length_m;
    }
    path[path.len() - 1]
}
