//! What happens, in words and along a line.

use maud::{Markup, html};
use muster_scenarios::report::{Flight, Mark, MarkKind};

use super::clock::Clock;
use super::keys::{duration, jumping};
use super::{MARGIN_PX, WIDTH_PX};
use crate::output::html::axis::{px, ticks};

/// Marks of one moment are shown together if they are nearer than this, in seconds of the picture.
const TOGETHER_S: f64 = 0.25;

/// Kinds of marks that are shown, the most important first.
const SHOWN: [MarkKind; 9] = [
    MarkKind::Death,
    MarkKind::Leader,
    MarkKind::Election,
    MarkKind::Partition,
    MarkKind::Merge,
    MarkKind::Violation,
    MarkKind::Return,
    MarkKind::Landing,
    MarkKind::Waypoint,
];

fn shown_marks<'a>(flight: &'a Flight, clock: &'a Clock) -> Vec<&'a Mark> {
    let marks = flight.swarms().flat_map(|swarm| &swarm.history.marks);
    let mut marks: Vec<_> = marks
        .filter(|mark| SHOWN.contains(&mark.kind) && clock.shows(mark.at.as_secs_f64()))
        .collect();
    marks.sort_by_key(|mark| mark.at);
    marks
}

/// The last thing that has happened, above the map.
pub(super) fn captions(flight: &Flight, clock: &Clock) -> Markup {
    let marks = shown_marks(flight, clock);
    let share = |mark: &Mark| clock.share(mark.at.as_secs_f64());
    let together = clock.share_of_played(TOGETHER_S);
    let groups: Vec<&[&Mark]> = marks
        .chunk_by(|a, b| share(b) - share(a) < together)
        .collect();
    html! {
        @for (index, group) in groups.iter().enumerate() {
            @let from = share(group[0]);
            @let to = groups.get(index + 1).map_or(1.0, |next| share(next[0]));
            @let chief = chief(group);
            text.caption.bad[chief.kind == MarkKind::Death] x="24" y="52" opacity="0" {
                (jumping(clock, "opacity", vec![(0.0, "0".to_owned()), (from, "1".to_owned()), (to, "0".to_owned())]))
                (format!("{:.2} s: {}", chief.at.as_secs_f64(), text(group)))
            }
        }
    }
}

/// The most important mark of a group.
fn chief<'a>(group: &[&'a Mark]) -> &'a Mark {
    group
        .iter()
        .min_by_key(|mark| rank(mark))
        .copied()
        .unwrap_or(group[0])
}

/// The place of a mark's kind in the order of importance.
fn rank(mark: &Mark) -> Option<usize> {
    SHOWN.iter().position(|kind| *kind == mark.kind)
}

/// The most important marks last, so that they are drawn on top.
fn by_importance(mut marks: Vec<&Mark>) -> Vec<&Mark> {
    marks.sort_by_key(|mark| std::cmp::Reverse(rank(mark)));
    marks
}

/// A line about a group: its most important marks of one kind.
fn text(group: &[&Mark]) -> String {
    let kind = chief(group).kind;
    let same: Vec<&str> = (group.iter())
        .filter(|mark| mark.kind == kind)
        .map(|mark| mark.text.as_str())
        .collect();
    let shown = same.iter().take(2).copied().collect::<Vec<_>>().join("; ");
    match same.len() {
        0..=2 => shown,
        number => format!("{shown}; and {} more", number - 2),
    }
}

/// The time, with marks and a cursor.
pub(super) fn time_line(flight: &Flight, clock: &Clock) -> Markup {
    let (left, right) = (MARGIN_PX / 2.0, WIDTH_PX - MARGIN_PX / 2.0);
    let (from_s, to_s) = clock.span_s();
    let last = clock.share(to_s);
    let x = |at_s: f64| px(left + clock.share(at_s) / last * (right - left));
    html! {
        line.axis x1=(left) x2=(right) y1="14" y2="14" {}
        @if let Some((slow_from_s, slow_to_s)) = clock.slow_s {
            line.slow x1=(x(slow_from_s)) x2=(x(slow_to_s)) y1="14" y2="14" {}
            text.tick x=(px(f64::midpoint(x(slow_from_s), x(slow_to_s)))) y="-4" text-anchor="middle" { "slow motion" }
        }
        @for at_s in ticks(from_s, to_s, 9.0) {
            text.tick x=(x(at_s)) y="40" text-anchor="middle" { (at_s) " s" }
        }
        @for mark in by_importance(shown_marks(flight, clock)) {
            @if mark.kind != MarkKind::Waypoint {
                circle.mark.(mark.kind.name().split(' ').next().unwrap_or_default()) cx=(x(mark.at.as_secs_f64())) cy="14" r="6" {}
            }
        }
        rect.now x=(px(right - 2.0)) y="2" width="4" height="24" rx="2" {
            animate attributeName="x" dur=(duration(clock)) repeatCount="indefinite"
                keyTimes={ "0;" (format!("{last:.5}")) ";1" }
                values={ (px(left - 2.0)) ";" (px(right - 2.0)) ";" (px(right - 2.0)) } {}
        }
    }
}
