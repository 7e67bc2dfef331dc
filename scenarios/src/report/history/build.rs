use std::collections::BTreeMap;

use muster_machines::identity::{Ballot, NodeId};
use muster_machines::time::Timestamp;

use super::{Condition, Epoch, History, Jam, LinkChange, LinkState, NodeHistory, Route, marks};
use crate::scenario::{FaultKind, Scenario};
use crate::world::{Incident, LINKED_NODES_MAX, Record, Recorder, SwarmOutcome};

impl History {
    /// The history of a swarm. Faults affect the scenario's own swarm only; `own` says whether it is that.
    pub(crate) fn of(world: &Scenario, swarm: &Scenario, own: bool, flown: &SwarmOutcome) -> Self {
        let recorder = &flown.recorder;
        let mut history = Self {
            links: links(world, swarm, recorder),
            home: Some(world.plan.home),
            separation_m: (
                world.plan.limits.separation.horizontal_m,
                world.plan.limits.separation.vertical_m,
            ),
            ..Self::default()
        };
        let records = recorder.drones().chain(recorder.relays());
        history.nodes = records.map(|(id, record)| node(id, record)).collect();
        history.follow(recorder);
        let faults = if own { &world.faults[..] } else { &[] };
        history.marks = marks::marks(recorder, &history, faults);
        history.jams = jams(world, own, recorder);
        history
    }

    /// Takes what happened to each node.
    fn follow(&mut self, recorder: &Recorder) {
        let first = self.nodes.first().map_or(0, |node| node.id);
        let mut epochs = BTreeMap::new();
        for happening in recorder.history().happenings() {
            let at = happening.at;
            let Some(node) = self.nodes.get_mut((happening.node.0 - first) as usize) else {
                continue;
            };
            match happening.what {
                Incident::Routes {
                    hops,
                    parent,
                    relay,
                } => {
                    let parent = parent.map(|id| id.0);
                    let route = Route {
                        hops,
                        parent,
                        relay,
                    };
                    if node.routes.last().map(|(_, last)| last) != Some(&route) {
                        node.routes.push((at, route));
                    }
                }
                Incident::Follows(ballot) => {
                    let index = epoch(&mut self.epochs, &mut epochs, ballot, at);
                    node.epochs.push((at, index));
                }
                what => {
                    if let Some(condition) = condition(what) {
                        node.conditions.push((at, condition));
                    }
                }
            }
        }
    }
}

/// The index of a ballot's epoch, which is new if no node has followed it.
fn epoch(
    epochs: &mut Vec<Epoch>,
    known: &mut BTreeMap<(u32, u32, NodeId), usize>,
    ballot: Ballot,
    since: Timestamp,
) -> usize {
    *known
        .entry((ballot.term, ballot.rank, ballot.master))
        .or_insert_with(|| {
            epochs.push(Epoch {
                term: ballot.term,
                rank: ballot.rank,
                master: ballot.master.0,
                since,
            });
            epochs.len() - 1
        })
}

/// The condition of a node after something happened to it; `None` if that is as before.
const fn condition(what: Incident) -> Option<Condition> {
    match what {
        Incident::Killed => Some(Condition::Dead),
        Incident::RanEmpty => Some(Condition::Empty),
        Incident::Fell => Some(Condition::Fell),
        Incident::Stopped => Some(Condition::Stopped),
        Incident::Hangs(None) => Some(Condition::Hangs),
        Incident::GivenUp(_) => Some(Condition::Failed),
        Incident::Rebooted | Incident::Resumed => Some(Condition::Runs),
        Incident::Routes { .. }
        | Incident::Follows(_)
        | Incident::Lands(_)
        | Incident::Hangs(Some(_))
        | Incident::Restarts(_) => None,
    }
}

fn node(id: NodeId, record: &Record) -> NodeHistory {
    NodeHistory {
        id: id.0,
        airborne: record.armed.map(|from| (from, record.disarmed)),
        ..NodeHistory::default()
    }
}

/// The changes of links; `None` if they were not recorded. Nobody looks at links if rules are not checked.
fn links(world: &Scenario, swarm: &Scenario, recorder: &Recorder) -> Option<Vec<LinkChange>> {
    if world.unchecked || swarm.plan.nodes() as usize > LINKED_NODES_MAX {
        return None;
    }
    let changes = recorder.history().link_changes();
    // Nothing moves before the first look, so links are as they are then from the start.
    let first = changes.first().map(|change| change.at);
    let changes = changes.iter().map(|change| LinkChange {
        at: if Some(change.at) == first {
            Timestamp::ZERO
        } else {
            change.at
        },
        ends: (change.ends.0.0, change.ends.1.0),
        link: match change.is_up {
            None => LinkState::Down,
            Some(false) => LinkState::Weak,
            Some(true) => LinkState::Up,
        },
    });
    Some(changes.collect())
}

fn jams(world: &Scenario, own: bool, recorder: &Recorder) -> Vec<Jam> {
    if !own {
        return Vec::new();
    }
    let injected = recorder.history().faults().iter();
    injected
        .filter_map(|injected| {
            let fault = world.faults.get(injected.index)?;
            let FaultKind::Jam { centre, radius_m } = fault.kind else {
                return None;
            };
            Some(Jam {
                at: injected.at,
                until: fault.duration.map(|lasts| injected.at + lasts),
                centre,
                radius_m,
            })
        })
        .collect()
}
