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
                    node.epochs.push((at, Some(index)));
                }
                Incident::Leaves => node.epochs.push((at, None)),
                what => {
                    if let Some(condition) = condition(what, &node.conditions) {
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
fn condition(what: Incident, before: &[(Timestamp, Condition)]) -> Option<Condition> {
    let last = before.last().map(|(_, condition)| *condition);
    match what {
        // An empty battery ends the process, too.
        Incident::Killed if last == Some(Condition::Empty) => None,
        Incident::Killed => Some(Condition::Dead),
        Incident::RanEmpty => Some(Condition::Empty),
        Incident::Fell => Some(Condition::Fell),
        Incident::Stopped => Some(Condition::Stopped),
        Incident::Hangs(None) => Some(Condition::Hangs),
        Incident::GivenUp(_) => Some(Condition::Failed),
        Incident::Rebooted => Some(Condition::Runs),
        Incident::Resumed => after_hang(before),
        Incident::Routes { .. }
        | Incident::Follows(_)
        | Incident::Leaves
        | Incident::LeavesLockstep
        | Incident::Lands(_)
        | Incident::Hangs(Some(_))
        | Incident::Restarts(_) => None,
    }
}

/// The condition after a hang: that before it. `None` if only an actor hung.
fn after_hang(before: &[(Timestamp, Condition)]) -> Option<Condition> {
    let (_, last) = before.last()?;
    let mut others = before.iter().rev().map(|(_, condition)| *condition);
    let other = others.find(|it| *it != Condition::Hangs);
    (*last == Condition::Hangs).then_some(other.unwrap_or(Condition::Runs))
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

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::time::Duration;

    use muster_machines::node::Address;

    use super::*;
    use crate::engine;
    use crate::report::Engine;
    use crate::scenario::{self, DroneFault, Fault, Target};

    #[test]
    fn a_drone_that_failed_does_not_run_again_after_an_actor_hung() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("thesis-1.toml");
        let mut world = scenario::load(&path, &[]).unwrap();
        let fault = |at_s: f64, what| {
            let kind = FaultKind::Drone(Target::Drone(NodeId(1)), what);
            Fault::at(Timestamp::from_secs_f64(at_s), kind)
        };
        world.faults = vec![
            Fault {
                times: 40,
                every: Duration::from_millis(500),
                ..fault(60.0, DroneFault::CrashActor(Address::Routing))
            },
            Fault {
                duration: Some(Duration::from_millis(50)),
                ..fault(81.0, DroneFault::Hang(Some(Address::Radio)))
            },
        ];
        let (_, flight) = engine::run(&world, Engine::Events, None).unwrap();
        let node = &flight.history.nodes[1];
        let seen = [80.9, 82.0].map(|at_s| node.condition_at(Timestamp::from_secs_f64(at_s)));
        assert_eq!(seen, [Condition::Failed; 2], "{:?}", node.conditions);
    }

    #[test]
    fn a_drone_with_an_empty_battery_is_not_shown_as_one_of_a_failed_computer() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("thesis-1.toml");
        let mut world = scenario::load(&path, &[]).unwrap();
        let empty = FaultKind::Drone(Target::Drone(NodeId(1)), DroneFault::Drain(0.0));
        world.faults = vec![Fault::at(Timestamp::from_secs_f64(60.0), empty)];
        let (report, flight) = engine::run(&world, Engine::Events, None).unwrap();
        assert!(report.drones[1].state.starts_with("battery empty"));
        let at = Timestamp::from_secs_f64(61.0);
        let condition = flight.history.nodes[1].condition_at(at);
        assert_eq!(condition, Condition::Empty);
    }

    #[test]
    fn a_hang_ends_with_the_condition_before_it() {
        let (failed, hangs) = (
            (Timestamp::ZERO, Condition::Failed),
            (Timestamp::ZERO, Condition::Hangs),
        );
        assert_eq!(after_hang(&[]), None);
        assert_eq!(after_hang(&[failed]), None);
        assert_eq!(after_hang(&[hangs, hangs]), Some(Condition::Runs));
        assert_eq!(after_hang(&[failed, hangs]), Some(Condition::Failed));
    }
}
