//! A track with no more points than the eye can tell.

use std::fmt::Write as _;

use super::super::axis::px;

/// How far, in pixels, a drawn track may be from the flown one: less than a line is thick.
const TOLERANCE_PX: f64 = 0.4;

/// The path through `points`, as an SVG path's `d`, as far as it is on a paper of this width and height.
///
/// Points that are less than half a pixel off the line between those that remain are left out (Douglas and Peucker,
/// Cartographica 10(2), 1973).
pub(super) fn path(points: &[(f64, f64)], paper_px: (f64, f64)) -> String {
    let mut data = String::new();
    for stretch in on_paper(points, paper_px) {
        for (at, (x, y)) in thinned(stretch).into_iter().enumerate() {
            let command = if at == 0 { 'M' } else { 'L' };
            write!(data, "{command}{} {}", px(x), px(y))
                .expect("a string takes all that is written");
        }
    }
    data
}

/// The stretches of points that are on the paper or next to one that is.
fn on_paper(points: &[(f64, f64)], (width, height): (f64, f64)) -> Vec<&[(f64, f64)]> {
    let on = |&(x, y): &(f64, f64)| (0.0..=width).contains(&x) && (0.0..=height).contains(&y);
    let mut stretches: Vec<&[_]> = vec![];
    let mut from = 0;
    for run in points.chunk_by(|a, b| on(a) == on(b)) {
        let to = from + run.len();
        if run.first().is_some_and(on) {
            stretches.push(&points[from.saturating_sub(1)..(to + 1).min(points.len())]);
        }
        from = to;
    }
    stretches
}

fn thinned(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut kept = vec![false; points.len()];
    let mut stretches = vec![];
    if let Some(last) = points.len().checked_sub(1) {
        kept[0] = true;
        kept[last] = true;
        stretches.push((0, last));
    }
    while let Some((from, to)) = stretches.pop() {
        let offs = (from + 1..to).map(|at| (at, off_px(points[at], points[from], points[to])));
        let farthest = offs.max_by(|(_, a), (_, b)| a.total_cmp(b));
        if let Some((at, _)) = farthest.filter(|&(_, off_px)| off_px > TOLERANCE_PX) {
            kept[at] = true;
            stretches.push((from, at));
            stretches.push((at, to));
        }
    }
    points
        .iter()
        .zip(kept)
        .filter(|&(_, kept)| kept)
        .map(|(&point, _)| point)
        .collect()
}

/// How far `point` is from the stretch between `from` and `to`.
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
    fn a_straight_line_is_two_points() {
        let points: Vec<_> = (0..100).map(|x| (f64::from(x), 5.0)).collect();
        assert_eq!(path(&points, (99.0, 10.0)), "M0 5L99 5");
    }

    #[test]
    fn a_way_there_and_back_keeps_its_turning_point() {
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
    fn what_is_off_the_paper_is_left_out() {
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
    fn no_points_are_no_path() {
        assert_eq!(path(&[], (10.0, 10.0)), "");
        assert_eq!(path(&[(1.0, 2.0)], (10.0, 10.0)), "M1 2");
    }
}
