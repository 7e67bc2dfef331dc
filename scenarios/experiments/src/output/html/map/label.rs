//! Labels on a map that don't overlap.

use maud::{Markup, html};
use muster_machines::geometry::Ned;

use super::super::axis::px;
use super::frame::Frame;
use super::mark;

/// Half the height of a line of text.
const HALF_HEIGHT_PX: f64 = 7.0;
/// The width of a digit.
const DIGIT_PX: f64 = 8.0;
/// Waypoints closer than this share a pin.
const PIN_PX: f64 = 22.0;
/// Maximum number of waypoints listed on a pin.
const NAMED_MAX: usize = 4;

/// Ids at the given points: all if there is room, else the multiples of 2, 5, 10, …, and always the first.
///
/// They stand below the marks, or beside them if the marks form a column.
pub(super) fn ids(points: &[(u32, (f64, f64))], size_px: f64) -> Markup {
    let shown = [1, 2, 5, 10, 20, 50, 100, 200, 500]
        .into_iter()
        .map(|every| every_nth(points, every))
        .find(|chosen| no_overlap(chosen))
        .unwrap_or_else(|| points.iter().take(1).copied().collect());
    let (right, down, anchor) = if in_a_column(points) {
        (size_px / 2.0 + 5.0, 4.5, "start")
    } else {
        (0.0, size_px / 2.0 + 12.0, "middle")
    };
    html! {
        @for (id, (x, y)) in shown {
            text.id.halo x=(px(x + right)) y=(px(y + down)) text-anchor=(anchor) { (id) }
        }
    }
}

/// Whether the points spread more vertically than horizontally.
fn in_a_column(points: &[(u32, (f64, f64))]) -> bool {
    let spread = |value: fn(&(u32, (f64, f64))) -> f64| {
        let values = || points.iter().map(value);
        values().fold(f64::MIN, f64::max) - values().fold(f64::MAX, f64::min)
    };
    spread(|(_, (_, y))| *y) > spread(|(_, (x, _))| *x)
}

/// The first point, and the multiples of `every` that don't overlap it.
fn every_nth(points: &[(u32, (f64, f64))], every: u32) -> Vec<(u32, (f64, f64))> {
    let Some((&first, others)) = points.split_first() else {
        return vec![];
    };
    let fits = |&&other: &&(u32, (f64, f64))| {
        other.0.is_multiple_of(every) && (every == 1 || !overlap(first, other))
    };
    std::iter::once(first)
        .chain(others.iter().filter(fits).copied())
        .collect()
}

fn no_overlap(points: &[(u32, (f64, f64))]) -> bool {
    let mut rest = points;
    while let Some((&one, others)) = rest.split_first() {
        if others.iter().any(|&other| overlap(one, other)) {
            return false;
        }
        rest = others;
    }
    true
}

fn overlap((a, (ax, ay)): (u32, (f64, f64)), (b, (bx, by)): (u32, (f64, f64))) -> bool {
    let digits = f64::from(a.checked_ilog10().unwrap_or(0) + b.checked_ilog10().unwrap_or(0) + 2);
    (ax - bx).abs() < digits * DIGIT_PX / 2.0 + 5.0 && (ay - by).abs() < 2.0 * HALF_HEIGHT_PX
}

/// One pin per waypoint; waypoints close together share one.
pub(super) fn pins(frame: &Frame, waypoints: &[Ned]) -> Markup {
    let mut pins: Vec<((f64, f64), Vec<usize>)> = vec![];
    for (number, &waypoint) in waypoints.iter().enumerate() {
        let (x, y) = frame.point_px(waypoint);
        let near = |((px, py), _): &&mut ((f64, f64), Vec<usize>)| (px - x).hypot(py - y) < PIN_PX;
        match pins.iter_mut().find(near) {
            Some((_, numbers)) => numbers.push(number),
            None => pins.push(((x, y), vec![number])),
        }
    }
    html! {
        @for (point, numbers) in &pins {
            g {
                title { "waypoint " (list(numbers)) }
                (mark::pin(*point, &short_list(numbers)))
            }
        }
    }
}

fn list(numbers: &[usize]) -> String {
    let numbers: Vec<_> = numbers.iter().map(usize::to_string).collect();
    numbers.join(", ")
}

fn short_list(numbers: &[usize]) -> String {
    match numbers.get(..NAMED_MAX) {
        Some(first) if numbers.len() > NAMED_MAX => format!("{} …", list(first)),
        _ => list(numbers),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(drones: u32, pitch_px: f64) -> Vec<(u32, (f64, f64))> {
        (0..drones)
            .map(|id| (id, (f64::from(id) * pitch_px, 0.0)))
            .collect()
    }

    fn shown(points: &[(u32, (f64, f64))]) -> Vec<String> {
        let text = ids(points, 9.0).into_string();
        let numbers = text
            .split("</text>")
            .filter_map(|label| label.split_once('>'));
        numbers.map(|(_, id)| id.to_owned()).collect()
    }

    #[test]
    fn all_ids_are_shown_if_there_is_room() {
        assert_eq!(shown(&line(15, 48.0)).len(), 15);
    }

    #[test]
    fn only_round_ids_and_the_first_are_shown_without_room() {
        let mut points = line(200, 5.0);
        points.swap(0, 99);
        let shown = shown(&points);
        assert_eq!(shown[0], "99");
        assert!(shown[1..].iter().all(|id| id.ends_with('0')), "{shown:?}");
    }

    #[test]
    fn only_the_first_id_is_shown_on_one_spot() {
        assert_eq!(shown(&line(15, 0.0)), ["0"]);
        assert!(shown(&[]).is_empty());
    }

    #[test]
    fn ids_stand_beside_a_column() {
        let row = line(4, 30.0);
        let column: Vec<_> = row.iter().map(|&(id, (x, y))| (id, (y, x))).collect();
        assert!(
            ids(&row, 9.0)
                .into_string()
                .contains(r#"text-anchor="middle""#)
        );
        assert!(
            ids(&column, 9.0)
                .into_string()
                .contains(r#"text-anchor="start""#)
        );
    }

    #[test]
    fn waypoints_on_one_spot_share_a_pin() {
        assert_eq!(short_list(&[0, 6]), "0, 6");
        assert_eq!(short_list(&[0, 1, 2, 3, 4, 5]), "0, 1, 2, 3 …");
    }
}
