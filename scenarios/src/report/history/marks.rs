use std::collections::{BTreeMap, BTreeSet};

use muster_machines::identity::NodeId;
use muster_machines::mission::LandingReason;
use muster_machines::time::Timestamp;
use muster_runtime::plan::raw::ActorName;

use super::labels::{fault, ids, masters};
use super::{History, Mark, MarkKind};
use crate::checkers::Violation;
use crate::report::cause;
use crate::report::summary::unplanned;
use crate::scenario::Fault;
use crate::world::{Incident, Recorder};

impl History {
    /// Adds a mark for each broken rule.
    pub(crate) fn add_violations(&mut self, violations: &[Violation]) {
        self.marks.extend(violations.iter().map(|violation| {
            let nodes = violation.drones.iter().map(|id| id.0).collect();
            let text = format!("rule {} broken: {}", violation.rule, violation.what);
            Mark::new(violation.at, MarkKind::Violation, nodes, text)
        }));
        self.marks.sort_by_key(|mark| mark.at);
    }
}

/// All marks of a swarm but those of broken rules, in order of time.
pub(super) fn marks(recorder: &Recorder, history: &History, faults: &[Fault]) -> Vec<Mark> {
    let mut marks = Vec::new();
    marks.extend(injections(recorder, faults));
    marks.extend(happenings(recorder, history));
    marks.extend(agent_failures(recorder));
    marks.extend(elections(recorder));
    marks.extend(leaders(recorder, history));
    marks.extend(segments(recorder));
    marks.extend(waypoints(recorder));
    marks.sort_by_key(|mark| (mark.at, mark.kind));
    marks
}

impl Mark {
    fn new(at: Timestamp, kind: MarkKind, nodes: Vec<u32>, text: String) -> Self {
        Self {
            at,
            until: None,
            kind,
            nodes,
            text,
        }
    }
}

fn injections<'a>(recorder: &'a Recorder, faults: &'a [Fault]) -> impl Iterator<Item = Mark> + 'a {
    let injected = recorder.history().faults().iter();
    injected.filter_map(|injected| {
        let of = faults.get(injected.index)?;
        let target = injected.target.map(|id| id.0);
        Some(Mark {
            until: of.duration.map(|lasts| injected.at + lasts),
            ..Mark::new(
                injected.at,
                MarkKind::Fault,
                target.into_iter().collect(),
                fault(of, target),
            )
        })
    })
}

fn happenings(recorder: &Recorder, history: &History) -> Vec<Mark> {
    let all = recorder.history().happenings().iter();
    all.filter_map(|happening| {
        let id = happening.node.0;
        let (kind, text) = incident(id, leads(history, id, happening.at), happening.what)?;
        Some(Mark::new(happening.at, kind, vec![id], text))
    })
    .collect()
}

/// An incident of a node, which may have led until then, in words. `None` if it is no mark of its own.
fn incident(id: u32, leads: bool, what: Incident) -> Option<(MarkKind, String)> {
    let name = format!("drone {id}");
    let subject = if leads {
        format!("{name}, a leader,")
    } else {
        name.clone()
    };
    let actor = |actor| ActorName::from(actor).name();
    let death = |what: &str| (MarkKind::Death, format!("{subject} {what}"));
    Some(match what {
        Incident::Killed => death("is dead: its computer failed, its flight controller lands it"),
        Incident::RanEmpty => death("has an empty battery"),
        Incident::Fell => death("falls"),
        Incident::Stopped => death("is off: its process ended"),
        Incident::Hangs(None) => death("hangs"),
        Incident::GivenUp(failed) => death(&format!("gives up: {} failed for good", actor(failed))),
        Incident::Rebooted => (MarkKind::Return, format!("{name} is on again")),
        Incident::Resumed => (MarkKind::Return, format!("{name} does not hang any more")),
        Incident::Restarts(failed) => (
            MarkKind::Restart,
            format!("{name} restarts its actor {}", actor(failed)),
        ),
        Incident::Lands(LandingReason::MissionOver)
        | Incident::Hangs(Some(_))
        | Incident::Routes { .. }
        | Incident::Leaves
        | Incident::LeavesLockstep
        | Incident::Follows(_) => return None,
        Incident::Lands(reason) => (
            MarkKind::Landing,
            format!("{subject} lands early: {}", unplanned(reason)?),
        ),
    })
}

/// Whether a node follows its own ballot.
fn leads(history: &History, id: u32, at: Timestamp) -> bool {
    let node = history.nodes.iter().find(|node| node.id == id);
    let epoch = node.and_then(|node| node.epoch_at(at));
    epoch.is_some_and(|epoch| history.epochs[epoch].master == id)
}

fn agent_failures(recorder: &Recorder) -> impl Iterator<Item = Mark> + '_ {
    let failures = recorder.agent_failures().iter();
    failures.map(|(at, drone, what)| {
        let text = format!("the agent of drone {} failed: {}", drone.0, cause(what));
        Mark::new(*at, MarkKind::AgentFailure, vec![drone.0], text)
    })
}

fn elections(recorder: &Recorder) -> impl Iterator<Item = Mark> + '_ {
    recorder.elections().iter().map(|election| {
        let settled = election.settled.as_ref();
        let text = match settled {
            Some((at, elected)) => format!(
                "election: settled after {:.1} s, led by {}",
                at.since(election.begun).as_secs_f64(),
                masters(elected.iter().map(|id| id.0)),
            ),
            None => "election that did not settle".to_owned(),
        };
        let nodes = settled.map_or_else(Vec::new, |(_, elected)| {
            elected.iter().map(|id| id.0).collect()
        });
        Mark {
            until: settled.map(|(at, _)| *at),
            ..Mark::new(election.begun, MarkKind::Election, nodes, text)
        }
    })
}

/// Each elected drone, when it first follows its own ballot.
fn leaders(recorder: &Recorder, history: &History) -> Vec<Mark> {
    let mut seen = BTreeSet::new();
    let all = recorder.history().happenings().iter();
    all.filter_map(|happening| {
        let Incident::Follows(ballot) = happening.what else {
            return None;
        };
        let is_new = ballot.is_elected()
            && ballot.master == happening.node
            && seen.insert((ballot.term, ballot.rank));
        let (id, term) = (ballot.master.0, ballot.term);
        let mut before = history.epochs.iter().filter(|it| it.term < term);
        let again = if before.any(|it| it.master == id) {
            " again"
        } else {
            ""
        };
        let text = format!("drone {id} leads{again}, term {term}");
        is_new.then(|| Mark::new(happening.at, MarkKind::Leader, vec![id], text))
    })
    .collect()
}

/// Partitions and merges: nodes that were connected and are not, or the other way round. A node that is gone is neither.
fn segments(recorder: &Recorder) -> Vec<Mark> {
    let looks = recorder.history().segments();
    let mut marks = Vec::new();
    for pair in looks.windows(2) {
        let ((_, before), (at, after)) = (&pair[0], &pair[1]);
        let shown = || {
            let segments = after.iter().filter(|segment| !segment.is_empty());
            let segments = segments.map(|segment| ids(segment.iter().map(|id| id.0)));
            segments.collect::<Vec<_>>().join(" | ")
        };
        if splits(before, after) {
            let text = format!("partition: {}", shown());
            marks.push(Mark::new(*at, MarkKind::Partition, Vec::new(), text));
        }
        if splits(after, before) {
            let text = format!("segments meet: {}", shown());
            marks.push(Mark::new(*at, MarkKind::Merge, Vec::new(), text));
        }
    }
    marks
}

/// Whether two nodes that are in one segment of `whole` are in different ones of `segments`.
fn splits(whole: &[Vec<NodeId>], segments: &[Vec<NodeId>]) -> bool {
    let segment_of: BTreeMap<NodeId, usize> = (segments.iter().enumerate())
        .flat_map(|(segment, members)| members.iter().map(move |id| (*id, segment)))
        .collect();
    whole.iter().any(|members| {
        let mut segments = members.iter().filter_map(|id| segment_of.get(id));
        let first = segments.next();
        segments.any(|segment| Some(segment) != first)
    })
}

fn waypoints(recorder: &Recorder) -> impl Iterator<Item = Mark> + '_ {
    let crossings = recorder.barriers().iter();
    crossings.filter_map(|(waypoint, crossing)| {
        let at = crossing.left?.at;
        let text = format!("the last drone leaves waypoint {waypoint}");
        Some(Mark::new(at, MarkKind::Waypoint, Vec::new(), text))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segments_of(segments: &[&[u32]]) -> Vec<Vec<NodeId>> {
        let segment = |ids: &&[u32]| ids.iter().copied().map(NodeId).collect();
        segments.iter().map(segment).collect()
    }

    #[test]
    fn only_nodes_that_were_connected_are_parted() {
        let whole = segments_of(&[&[0, 1, 2, 3, 4]]);
        assert!(splits(&whole, &segments_of(&[&[0, 1], &[3, 4]])));
        // Node 2 is gone, the others are still connected.
        assert!(!splits(&whole, &segments_of(&[&[0, 1, 3, 4]])));
        // Node 5 is new.
        assert!(!splits(&whole, &segments_of(&[&[0, 1, 2, 3, 4], &[5]])));
        assert!(!splits(&segments_of(&[&[0, 1], &[3, 4]]), &whole));
    }
}
