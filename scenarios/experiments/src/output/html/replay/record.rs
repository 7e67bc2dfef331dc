//! The record of a run as compact JSON, for the page's script.

use std::collections::BTreeMap;

use muster_machines::geometry::Ned;
use muster_machines::mission::State;
use muster_machines::time::Timestamp;
use muster_scenarios::report::{
    Condition, Flight, FlightOfDrone, History, LinkChange, LinkState, MarkKind, NodeHistory, Report,
};
use serde::Serialize;

use super::values::{Values, values};
use crate::output::closest::closest;
use crate::output::simplify::simplified;

/// A run. Times are in milliseconds from its start, lengths in centimetres; north and east are from home.
#[derive(Debug, Serialize)]
pub(super) struct Record {
    end: i64,
    range: i64,
    /// Least separation required, horizontal and vertical.
    separation: [i64; 2],
    swarms: Vec<Swarm>,
    nodes: Vec<Node>,
    /// Names of states; each with the waypoint that it is about, or -1.
    states: Vec<(String, i32)>,
    conditions: Vec<&'static str>,
    epochs: Vec<Epoch>,
    /// For each link its two nodes, then each change: time, and 0 for down, 1 for weak, 2 for up. `None` if not recorded.
    links: Option<Vec<Vec<i64>>>,
    kinds: Vec<&'static str>,
    marks: Vec<Mark>,
    /// Time, end or -1, north, east, radius.
    jams: Vec<[i64; 5]>,
    closest: Closest,
    values: Values,
}

#[derive(Debug, Serialize)]
struct Swarm {
    name: String,
    waypoints: Vec<[i64; 3]>,
}

#[derive(Debug, Serialize)]
struct Node {
    id: u32,
    swarm: usize,
    /// Whether it is a pure relay, which does not fly.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    fixed: bool,
    /// Time, north, east and height of each point, each as the difference from the point before.
    track: Vec<i64>,
    /// Pairs of time and index of the state.
    states: Vec<i64>,
    /// Time, hops or -1, parent or -1, and 1 if it relays.
    routes: Vec<i64>,
    /// Pairs of time and index of the epoch.
    epochs: Vec<i64>,
    /// Pairs of time and index of the condition.
    conditions: Vec<i64>,
    /// When its vehicle took off and landed, or -1.
    air: [i64; 2],
}

#[derive(Debug, Serialize)]
struct Epoch {
    swarm: usize,
    term: u32,
    master: u32,
    since: i64,
}

#[derive(Debug, Serialize)]
struct Mark {
    at: i64,
    until: i64,
    kind: usize,
    nodes: Vec<u32>,
    text: String,
}

/// The closest pair of flying drones.
#[derive(Debug, Serialize)]
struct Closest {
    /// Interval between samples.
    step: i64,
    /// Distance and the two drones of each sample; -1 if fewer than two fly.
    pairs: Vec<i64>,
}

const CONDITIONS: [Condition; 7] = [
    Condition::Runs,
    Condition::Hangs,
    Condition::Stopped,
    Condition::Dead,
    Condition::Empty,
    Condition::Fell,
    Condition::Failed,
];

const KINDS: [MarkKind; 12] = [
    MarkKind::Fault,
    MarkKind::Death,
    MarkKind::Return,
    MarkKind::Restart,
    MarkKind::AgentFailure,
    MarkKind::Election,
    MarkKind::Leader,
    MarkKind::Partition,
    MarkKind::Merge,
    MarkKind::Waypoint,
    MarkKind::Landing,
    MarkKind::Violation,
];

/// The record of a run.
pub(super) fn record(report: &Report, flight: &Flight) -> Record {
    let mut states = States::default();
    let (mut nodes, mut epochs, mut marks, mut jams) = (vec![], vec![], vec![], vec![]);
    let mut swarms = vec![];
    let several = !report.others.is_empty();
    let pairs = report.swarms().zip(flight.swarms());
    for (swarm, (report_of, flight)) in pairs.enumerate() {
        swarms.push(Swarm {
            name: report_of.name().to_owned(),
            waypoints: flight.waypoints.iter().map(|it| place(*it)).collect(),
        });
        let nodes_of = of_swarm(swarm, (report_of, flight), epochs.len(), &mut states);
        nodes.extend(nodes_of);
        let history = &flight.history;
        epochs.extend(history.epochs.iter().map(|epoch| Epoch {
            swarm,
            term: epoch.term,
            master: epoch.master,
            since: ms(epoch.since),
        }));
        marks.extend(marks_of(history, several.then(|| report_of.name())));
        jams.extend(jams_of(history));
    }
    marks.sort_by_key(|mark: &Mark| mark.at);
    let history = &flight.history;
    Record {
        end: ms(Timestamp::from_secs_f64(report.simulated_s)),
        range: cm(flight.range_m),
        separation: [cm(history.separation_m.0), cm(history.separation_m.1)],
        swarms,
        nodes,
        states: states.names,
        conditions: CONDITIONS.iter().map(|it| it.name()).collect(),
        epochs,
        links: links(flight),
        kinds: KINDS.iter().map(|it| it.name()).collect(),
        marks,
        jams,
        closest: closest_pairs(report, flight),
        values: values(report),
    }
}

fn closest_pairs(report: &Report, flight: &Flight) -> Closest {
    let closest = closest(report, flight);
    let pairs = closest.pairs.iter().flat_map(|pair| match *pair {
        Some((distance_m, a, b)) => [cm(distance_m), i64::from(a), i64::from(b)],
        None => [-1; 3],
    });
    Closest {
        step: ms(Timestamp::from_secs_f64(closest.step_s)),
        pairs: pairs.collect(),
    }
}

/// The names of states, each once.
#[derive(Debug, Default)]
struct States {
    names: Vec<(String, i32)>,
    known: BTreeMap<String, usize>,
}

impl States {
    fn index(&mut self, state: State) -> i64 {
        let name = state.to_string();
        let waypoint = match state {
            State::WaypointReached { waypoint } | State::MovingToWaypoint { waypoint } => {
                i32::from(waypoint)
            }
            _ => -1,
        };
        let names = &mut self.names;
        let index = *self.known.entry(name.clone()).or_insert_with(|| {
            names.push((name, waypoint));
            names.len() - 1
        });
        int(index)
    }
}

/// Drones and relays of a swarm; `first_epoch` is the index of its first epoch in the record.
fn of_swarm(
    swarm: usize,
    (report, flight): (&Report, &Flight),
    first_epoch: usize,
    states: &mut States,
) -> Vec<Node> {
    let empty = NodeHistory::default();
    let history_of = |id: u32| {
        let mut nodes = flight.history.nodes.iter();
        nodes.find(|node| node.id == id).unwrap_or(&empty)
    };
    let node = |id, history: &NodeHistory| Node {
        id,
        swarm,
        fixed: false,
        track: vec![],
        states: vec![],
        routes: (history.routes.iter())
            .flat_map(|&(at, route)| {
                let hops = route.hops.map_or(-1, i64::from);
                let parent = route.parent.map_or(-1, i64::from);
                [ms(at), hops, parent, i64::from(route.relay)]
            })
            .collect(),
        epochs: (history.epochs.iter())
            .flat_map(|&(at, epoch)| [ms(at), epoch.map_or(-1, |it| int(first_epoch + it))])
            .collect(),
        conditions: (history.conditions.iter())
            .flat_map(|&(at, condition)| [ms(at), int(index_of(&CONDITIONS, &condition))])
            .collect(),
        air: history
            .airborne
            .map_or([-1, -1], |(from, to)| [ms(from), to.map_or(-1, ms)]),
    };
    let drones = report.drones.iter().zip(&flight.drones);
    let drones = drones.map(|(report, flown)| Node {
        track: track(flown),
        states: (flown.states.iter())
            .flat_map(|&(at, state)| [ms(at), states.index(state)])
            .collect(),
        ..node(report.id, history_of(report.id))
    });
    let mut nodes: Vec<_> = drones.collect();
    nodes.extend(report.relays.iter().map(|relay| {
        let place = Ned::new(relay.north_m, relay.east_m, -relay.altitude_m);
        Node {
            fixed: true,
            track: point(Timestamp::ZERO, place).to_vec(),
            ..node(relay.id, history_of(relay.id))
        }
    }));
    nodes
}

/// The points of a track that matter, each as the difference from the one before.
fn track(flown: &FlightOfDrone) -> Vec<i64> {
    let mut before = [0; 4];
    let mut track = Vec::new();
    for (at, place) in simplified(&flown.track) {
        let point = point(at, place);
        track.extend(
            point
                .iter()
                .zip(before)
                .map(|(value, before)| value - before),
        );
        before = point;
    }
    track
}

fn links(flight: &Flight) -> Option<Vec<Vec<i64>>> {
    let mut links: BTreeMap<(u32, u32), Vec<i64>> = BTreeMap::new();
    for swarm in flight.swarms() {
        for &LinkChange { at, ends, link } in swarm.history.links.as_ref()? {
            let start = || vec![i64::from(ends.0), i64::from(ends.1)];
            let state = match link {
                LinkState::Down => 0,
                LinkState::Weak => 1,
                LinkState::Up => 2,
            };
            links
                .entry(ends)
                .or_insert_with(start)
                .extend([ms(at), state]);
        }
    }
    Some(links.into_values().collect())
}

/// The marks of a swarm; with its name, if there are several, but for broken rules, which are of all.
fn marks_of<'a>(history: &'a History, swarm: Option<&'a str>) -> impl Iterator<Item = Mark> + 'a {
    let text = move |mark: &muster_scenarios::report::Mark| match swarm
        .filter(|_| mark.kind != MarkKind::Violation)
    {
        Some(swarm) => format!("{swarm}: {}", mark.text),
        None => mark.text.clone(),
    };
    history.marks.iter().map(move |mark| Mark {
        at: ms(mark.at),
        until: mark.until.map_or(-1, ms),
        kind: index_of(&KINDS, &mark.kind),
        nodes: mark.nodes.clone(),
        text: text(mark),
    })
}

fn jams_of(history: &History) -> impl Iterator<Item = [i64; 5]> + '_ {
    history.jams.iter().map(|jam| {
        let [north, east, _] = place(jam.centre);
        let until = jam.until.map_or(-1, ms);
        [ms(jam.at), until, north, east, cm(jam.radius_m)]
    })
}

fn index_of<T: PartialEq>(all: &[T], one: &T) -> usize {
    let found = all.iter().position(|it| it == one);
    found.expect("all kinds are listed")
}

fn point(at: Timestamp, at_place: Ned) -> [i64; 4] {
    let [north, east, height] = place(at_place);
    [ms(at), north, east, height]
}

/// North, east and height, in centimetres.
fn place(place: Ned) -> [i64; 3] {
    [
        cm(place.north_m()),
        cm(place.east_m()),
        cm(place.altitude_m()),
    ]
}

fn ms(at: Timestamp) -> i64 {
    milliseconds(at.as_secs_f64())
}

pub(super) fn milliseconds(seconds: f64) -> i64 {
    rounded(seconds * 1e3)
}

fn cm(metres: f64) -> i64 {
    rounded(metres * 1e2)
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "the longest flights and distances are far below 2^52"
)]
fn rounded(value: f64) -> i64 {
    value.round() as i64
}

fn int(index: usize) -> i64 {
    i64::try_from(index).unwrap_or(i64::MAX)
}
