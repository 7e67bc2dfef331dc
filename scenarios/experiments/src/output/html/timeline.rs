//! Timeline of the drones' mission states: one row per drone, one colour per phase.

use maud::{Markup, html};
use muster_machines::mission::State;
use muster_machines::time::Timestamp;
use muster_runtime::text::{drones, figure};
use muster_scenarios::report::{DroneReport, Flight, FlightOfDrone, Report, count};

use super::axis::{Axis, decimals, px, stride, ticks};
use crate::output::figures::Kind;

const WIDTH_PX: f64 = 1100.0;
const LEFT_PX: f64 = 58.0;
const RIGHT_PX: f64 = 16.0;
const TOP_PX: f64 = 40.0;
const BOTTOM_PX: f64 = 44.0;
/// Minimum drawn length of a phase.
const SHORTEST_PX: f64 = 0.8;

/// CSS class and name of states that share a colour.
type Phase = (&'static str, &'static str);

/// All phases, in the order of a mission.
const PHASES: [Phase; 16] = [
    ("p-start", "start"),
    ("p-setup", "set-up"),
    ("p-takeoff", "taking off"),
    ("p-discovery", "neighbour discovery"),
    ("p-hops", "hop update"),
    ("p-moving", "moving to a waypoint"),
    ("p-waiting", "waiting at a waypoint"),
    ("p-changing", "changing formation"),
    ("p-following", "following"),
    ("p-assembling", "assembling"),
    ("p-toland", "moving to land"),
    ("p-landing", "landing"),
    ("p-finished", "finished"),
    ("p-task", "on task"),
    ("p-independent", "independent"),
    DEAD,
];
const DEAD: Phase = ("p-dead", "dead");

const fn phase(state: State) -> Phase {
    PHASES[match state {
        State::Start => 0,
        State::SetUp => 1,
        State::TakingOff => 2,
        State::NeighbourDiscovery => 3,
        State::HopUpdate => 4,
        State::MovingToWaypoint { .. } => 5,
        State::WaypointReached { .. } => 6,
        State::ChangingFormation { .. } => 7,
        State::Following => 8,
        State::Assembling => 9,
        State::MovingToLand => 10,
        State::Landing => 11,
        State::Finished => 12,
        State::OnTask => 13,
        State::Independent => 14,
    }]
}

/// The timeline with its legend.
pub(super) fn timeline(report: &Report, flight: &Flight) -> Markup {
    let row = row_px(report.drones.len());
    let base = TOP_PX + row * count(report.drones.len() as u64);
    let height = base + BOTTOM_PX;
    let end_s = report.simulated_s;
    let x = Axis::new((0.0, end_s), (LEFT_PX, WIDTH_PX - RIGHT_PX));
    let gap = if row > 10.0 { 3.0 } else { 0.6 };
    html! {
        (legend(report, flight))
        div.scroll {
            svg.wide role="img" aria-label={ "Mission state of each drone over " (time(report)) }
                viewBox={ "0 0 " (WIDTH_PX) " " (px(height)) }
            {
                (seconds(report, &x, base))
                (ids(&report.drones, row))
                @for (place, (drone, flown)) in report.drones.iter().zip(&flight.drones).enumerate() {
                    g transform={ "translate(0 " (px(TOP_PX + row * count(place as u64))) ")" } {
                        (states(drone, flown, &x, end_s, row - gap))
                    }
                }
                (barriers(report, &x))
                (violations(report, &x, base))
            }
        }
    }
}

/// Height of a row.
fn row_px(drones: usize) -> f64 {
    match drones {
        0..=20 => 22.0,
        21..=70 => 14.0,
        _ => 6.0,
    }
}

/// Legend of the phases that occur in the run.
fn legend(report: &Report, flight: &Flight) -> Markup {
    let states = flight.drones.iter().flat_map(|drone| &drone.states);
    let dead = (flight.drones.iter()).filter_map(|drone| drone.died_at.map(|_| DEAD));
    let seen: Vec<_> = (states.map(|&(_, state)| phase(state)))
        .chain(dead)
        .collect();
    html! {
        ul.legend {
            @for (class, name) in PHASES.into_iter().filter(|phase| seen.contains(phase)) {
                li { span.chip.(class) {} (name) }
            }
            @if !report.violations.is_empty() {
                li {
                    svg.swatch viewBox="-9 -9 18 18" aria-hidden="true" {
                        g.broken { path d="M0 -6l-6 11h12z" {} }
                    }
                    "rule broken"
                }
            }
        }
    }
}

/// Name of the time axis.
const fn time(report: &Report) -> &'static str {
    match report.engine {
        Some(_) => "simulated time",
        None => "time",
    }
}

/// Grid lines at round times, labelled below.
fn seconds(report: &Report, x: &Axis, base: f64) -> Markup {
    let times = ticks(0.0, report.simulated_s, 10.0);
    let digits = decimals(&times);
    html! {
        @for time_s in times {
            @let at = px(x.px(time_s));
            line.grid x1=(at) x2=(at) y1=(TOP_PX) y2=(px(base)) {}
            text.tick x=(at) y=(px(base + 17.0)) text-anchor="middle" { (figure(time_s, digits)) }
        }
        text.axis-name x=(px(f64::midpoint(LEFT_PX, WIDTH_PX - RIGHT_PX))) y=(px(base + 37.0))
            text-anchor="middle" { (time(report)) " in seconds" }
    }
}

fn ids(drones: &[DroneReport], row: f64) -> Markup {
    let every = stride(row, 14.0);
    html! {
        text.axis-name x=(LEFT_PX - 7.0) y=(TOP_PX - 8.0) text-anchor="end" { "drone" }
        @for (place, drone) in drones.iter().enumerate() {
            @let leads = Kind::of(drone) == Kind::Master;
            @let near_master = drones.iter().enumerate().any(|(other, drone)| {
                Kind::of(drone) == Kind::Master && other.abs_diff(place) < every
            });
            @if leads || (place.is_multiple_of(every) && !near_master) {
                text.tick.leads[leads] x=(LEFT_PX - 7.0) y=(px(TOP_PX + row * (count(place as u64) + 0.5)))
                    dy="0.3em" text-anchor="end"
                {
                    @if leads { "◆ " }
                    (drone.id)
                }
            }
        }
    }
}

/// A drone's row. The latest state is drawn first, so that a short state stays visible over its successor.
fn states(drone: &DroneReport, flown: &FlightOfDrone, x: &Axis, end_s: f64, height: f64) -> Markup {
    let end = Timestamp::from_secs_f64(end_s);
    let begun = flown.states.iter();
    let begun = begun.map(|&(since, state)| (since, phase(state).0, state.to_string()));
    let died = flown.died_at;
    let begun: Vec<_> = begun
        .filter(|(since, ..)| died.is_none_or(|at| *since <= at))
        .chain(died.map(|at| (at, DEAD.0, DEAD.1.to_owned())))
        .collect();
    let ends = begun.iter().skip(1).map(|(at, ..)| *at).chain([end]);
    let stretches: Vec<_> = begun.iter().zip(ends).collect();
    html! {
        @for ((since, class, name), until) in stretches.into_iter().rev() {
            @let (from_s, to_s) = (since.as_secs_f64(), until.as_secs_f64());
            @let (from, to) = (x.px(from_s), x.px(to_s.max(from_s)));
            rect.(class) x=(px(from)) width=(px((to - from).max(SHORTEST_PX))) height=(px(height)) {
                title {
                    "drone " (drone.id) ": " (name) ", "
                    (figure(from_s, 1)) " s to " (figure(to_s, 1)) " s (" (figure(to_s - from_s, 2)) " s)"
                }
            }
        }
    }
}

/// The number of each waypoint, above the time of the last departure from it.
fn barriers(report: &Report, x: &Axis) -> Markup {
    let mut free_from_px = f64::NEG_INFINITY;
    let lines = report.barriers.iter().map(|barrier| {
        let at = x.px(barrier.moving_s);
        let named = at >= free_from_px;
        if named {
            free_from_px = at + 22.0;
        }
        (barrier, at, named)
    });
    html! {
        @for (barrier, at, named) in lines {
            g.barrier {
                title {
                    "waypoint " (barrier.waypoint) ": last arrival at " (figure(barrier.arrived_s, 1)) " s, last departure at "
                    (figure(barrier.moving_s, 1)) " s, barrier wait " (figure(barrier.wait_s(), 2)) " s"
                }
                line x1=(px(at)) x2=(px(at)) y1=(TOP_PX - 8.0) y2=(TOP_PX) {}
                @if named {
                    circle cx=(px(at)) cy=(TOP_PX - 16.0) r="9" {}
                    text x=(px(at)) y=(TOP_PX - 16.0) dy="0.36em" text-anchor="middle" { (barrier.waypoint) }
                }
            }
        }
    }
}

fn violations(report: &Report, x: &Axis, base: f64) -> Markup {
    html! {
        @for violation in &report.violations {
            @let at = px(x.px(violation.at_s));
            g.broken {
                title { "rule " (violation.rule) " broken by " (drones(&violation.drones)) ": " (violation.what) }
                line x1=(at) x2=(at) y1=(TOP_PX) y2=(px(base)) {}
                path d={ "M" (at) " " (px(base)) "l-6 11h12z" } {}
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::sample;

    #[test]
    fn dead_drone_is_shown_dead_until_the_end() {
        let (report, mut flight) = sample::swarm(3);
        let end = Timestamp::from_secs_f64(report.simulated_s);
        assert!(!timeline(&report, &flight).into_string().contains("dead"));
        flight.drones[1].died_at = Some(Timestamp::from_secs_f64(60.0));
        let page = timeline(&report, &flight).into_string();
        let until = figure(end.as_secs_f64(), 1);
        let shown = format!("drone 1: dead, 60.0 s to {until} s");
        assert!(page.contains(&shown), "{shown}");
        assert!(
            !page.contains("drone 1: landing"),
            "nothing comes after that"
        );
    }
}
