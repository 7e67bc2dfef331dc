//! Simplified track paths.

use std::fmt::Write as _;

use super::super::axis::px;

/// Maximum deviation of a drawn track, in pixels; less than the line width.
const TOLERANCE_PX: f64 = 0.4;

/// The path through `points` as an SVG path's `d`, clipped to a paper of this width and height.
///
/// Points less than [`TOLERANCE_PX`] off the remaining line are left out (Douglas and Peucker, Cartographica 10(2), 1973).
pub(super) fn path(points: &[(f64, f64)], paper_px: (f64, f64)) -> String {
    let mut data = String::new();
    for section in clipped(points, paper_px) {
        for (at, (x, y)) in simplified(section).into_iter().enumerate() {
            let command = if at == 0 { 'M' } else { 'L' };
            write!(data, "{command}{} {}", px(x), px(y)).expect("writing to a string never fails");
        }
    }
    data
}

/// Sections of points on the paper, each with one neighbour beyond its ends.
fn clipped(points: &[(f64, f64)], (width, height): (f64, f64)) -> Vec<&[(f64, f64)]> {
    let on = |&(x, y): &(f64, f64)| (0.0..=width).contains(&x) && (0.0..=height).contains(&y);
    let mut sections: Vec<&[_]> = vec![];
    let mut from = 0;
    for run in points.chunk_by(|a, b| on(a) == on(b)) {
        let to = from + run.len();
        if run.first().is_some_and(on) {
            sections.push(&points[from.saturating_sub(1)..(to + 1).min(points.len())]);
        }
        from = to;
    }
    sections
}

fn simplified(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut kept = vec![false; points.len()];
    let mut pending = vec![];
    if let Some(last) = points.len().checked_sub(1) {
        kept[0] = true;
        kept[last] = true;
        pending.push((0, last));
    }
    while let Some((from, to)) = pending.pop() {
        let offs = (from + 1..to).map(|at| (at, off_px(points[at], points[from], points[to])));
        let farthest = offs.max_by(|(_, a), (_, b)| a.total_cmp(b));
        if let Some((at, _)) = farthest.filter(|&(_, off_px)| off_px > TOLERANCE_PX) {
            kept[at] = true;
            pending.push((from, at));
            pending.push((at, to));
        }
    }
    points
        .iter()
        .zip(kept)
        .filter(|&(_, kept)| kept)
        .map(|(&point, _)| point)
        .collect()
}

/// Distance of `point` from the segment between `from` and `to`.
fn off_px(point: (f64, f64), from: (f64, f64), to: (f64, f64)) -> f64 {
    let (along_x, along_y) = (to.0 - from.0, to.1 - from.1);
    let (x, y) = (point.0 - from.0, point.1 - from.1);
    let squared = along_x * along_x + along_y * along_y;
    let share = if squared > 0.0 {
        ((x * along_x + y * along_y) / squared).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (x - share * along_x).hypot(y - share * along_y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn straight_line_becomes_two_points() {
        let points: Vec<_> = (0..100).map(|x| (f64::from(x), 5.0)).collect();
        assert_eq!(path(&points, (99.0, 10.0)), "M0 5L99 5");
    }

    #[test]
    fn turning_point_is_kept() {
        let points = [
            (0.0, 0.0),
            (50.0, 0.0),
            (100.0, 0.0),
            (50.0, 0.0),
            (0.0, 0.0),
        ];
        assert_eq!(path(&points, (100.0, 10.0)), "M0 0L100 0L0 0");
    }

    #[test]
    fn points_off_the_paper_are_left_out() {
        let points: Vec<_> = (0..=100).map(|x| (f64::from(x), 5.0)).collect();
        assert_eq!(path(&points, (10.0, 10.0)), "M0 5L11 5");
        let loops = [
            (5.0, 5.0),
            (15.0, 5.0),
            (25.0, 5.0),
            (15.0, 6.0),
            (5.0, 6.0),
        ];
        assert_eq!(path(&loops, (10.0, 10.0)), "M5 5L15 5M15 6L5 6");
        assert_eq!(path(&points, (10.0, 4.0)), "");
    }

    #[test]
    fn path_of_no_points_is_empty() {
        assert_eq!(path(&[], (10.0, 10.0)), "");
        assert_eq!(path(&[(1.0, 2.0)], (10.0, 10.0)), "M1 2");
    }
}
