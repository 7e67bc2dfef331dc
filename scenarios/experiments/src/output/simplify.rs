//! Leaves out points of a track that a replay does not need.

use muster_machines::geometry::Ned;
use muster_machines::time::Timestamp;

/// Largest distance of a drone in the replay from its place in the track, at any time, in metres.
const TOLERANCE_M: f64 = 0.05;

/// The points of a track without those that lie between their neighbours, in space and time, within [`TOLERANCE_M`].
///
/// As Douglas and Peucker (Cartographica 10(2), 1973), with the distance from the place at the same time.
pub(super) fn simplified(track: &[(Timestamp, Ned)]) -> Vec<(Timestamp, Ned)> {
    let mut kept = vec![false; track.len()];
    let mut pending = vec![];
    if let Some(last) = track.len().checked_sub(1) {
        kept[0] = true;
        kept[last] = true;
        pending.push((0, last));
    }
    while let Some((from, to)) = pending.pop() {
        let offs = (from + 1..to).map(|at| (at, off_m(track[at], track[from], track[to])));
        let farthest = offs.max_by(|(_, a), (_, b)| a.total_cmp(b));
        if let Some((at, _)) = farthest.filter(|&(_, off_m)| off_m > TOLERANCE_M) {
            kept[at] = true;
            pending.push((from, at));
            pending.push((at, to));
        }
    }
    let points = track.iter().zip(kept);
    points
        .filter(|&(_, kept)| kept)
        .map(|(&point, _)| point)
        .collect()
}

/// Distance of a point from the place between two others at the same time, in metres.
fn off_m(
    (at, place): (Timestamp, Ned),
    (from_t, from): (Timestamp, Ned),
    (to_t, to): (Timestamp, Ned),
) -> f64 {
    let span_s = to_t.since(from_t).as_secs_f64();
    let share = if span_s > 0.0 {
        at.since(from_t).as_secs_f64() / span_s
    } else {
        0.0
    };
    Ned(from.0.lerp(&to.0, share)).distance_m(place)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(seconds: f64, north_m: f64) -> (Timestamp, Ned) {
        let at = Timestamp::from_secs_f64(seconds);
        (at, Ned::new(north_m, 0.0, 0.0))
    }

    #[test]
    fn constant_speed_needs_two_points() {
        let track: Vec<_> = (0..60)
            .map(|s| point(f64::from(s), f64::from(s) * 5.0))
            .collect();
        assert_eq!(simplified(&track), [track[0], track[59]]);
        assert_eq!(simplified(&[]), []);
    }

    #[test]
    fn stop_on_a_straight_line_is_kept() {
        let track = [
            point(0.0, 0.0),
            point(5.0, 50.0),
            point(9.0, 50.0),
            point(14.0, 100.0),
        ];
        assert_eq!(simplified(&track), track);
    }
}
