//! Rules for every state, and states that must be reachable for the model to prove anything.

use std::collections::BTreeSet;

use muster_machines::identity::NodeId;
use stateright::{Model, Property};

use super::routing::Violation;
use super::{Faults, State, Swarm};

/// Rule 1a.
pub(crate) const NAMED: &str = "1a: only the drone named in a ballot acts under it";
/// Rule 1b.
pub(crate) const NEVER_FALLS: &str = "1b: the ballot of a drone's leader never falls";
/// Settled segments exist.
pub(crate) const SETTLES: &str = "without further faults all segments settle";
/// Rule 1c.
pub(crate) const ONE_MASTER: &str =
    "1c: each settled segment has one master, the leader of all its members";

pub(crate) fn properties(faults: Faults, settles: bool) -> Vec<Property<Swarm>> {
    let mut all = vec![
        Property::<Swarm>::always(NAMED, |_, state| state.only_the_named_acts()),
        Property::<Swarm>::always(NEVER_FALLS, |_, state| {
            !state.is_violated(Violation::BallotFell)
        }),
        Property::<Swarm>::always(ONE_MASTER, |swarm, state| {
            !swarm.is_settled(state) || state.each_segment_has_one_master()
        }),
    ];
    if settles {
        all.push(Property::<Swarm>::always(SETTLES, |swarm, state| {
            swarm.settles(state)
        }));
    }
    let can_lose_master = faults.crashes + faults.splits + faults.suspicions > 0;
    if can_lose_master {
        all.push(Property::<Swarm>::sometimes(
            "a master is elected",
            |_, state| {
                let mut led = state.drones.iter().filter(|drone| drone.leads());
                led.any(|drone| drone.ballot().is_some_and(|it| it.is_elected()))
            },
        ));
        all.push(Property::<Swarm>::sometimes(
            "a master steps down",
            |_, state| {
                state.drones.iter().any(|drone| {
                    let led = drone
                        .sent
                        .iter()
                        .any(|frame| frame.ballot.master == drone.id);
                    led && drone.ballot().is_some_and(|it| it.master != drone.id)
                })
            },
        ));
    }
    if faults.splits > 0 {
        all.push(Property::<Swarm>::sometimes(
            "two segments settle under a master each",
            |swarm, state| state.masters().len() > 1 && swarm.is_settled(state),
        ));
        all.push(Property::<Swarm>::sometimes(
            "segments with a master each have merged",
            |swarm, state| {
                let ever = state.drones.iter().flat_map(|drone| drone.sent.iter());
                let masters: BTreeSet<_> = ever.map(|frame| frame.ballot.master).collect();
                masters.len() > 1
                    && state.remaining.splits < swarm.faults.splits
                    && state.remaining.suspicions == swarm.faults.suspicions
                    && state.remaining.crashes == swarm.faults.crashes
                    && state.links.is_whole()
                    && swarm.is_settled(state)
            },
        ));
    }
    if faults.crashes > 0 {
        all.push(Property::<Swarm>::sometimes(
            "a restarted drone has rejoined under another master",
            |swarm, state| {
                let up = state.drones.iter().all(|drone| drone.is_up);
                let elected = |it: &super::Drone| it.ballot().is_some_and(|it| it.is_elected());
                state.remaining.crashes < swarm.faults.crashes
                    && up
                    && state.links.is_whole()
                    && state.drones.iter().all(|drone| elected(drone))
                    && swarm.is_settled(state)
            },
        ));
    }
    all
}

impl State {
    fn is_violated(&self, rule: Violation) -> bool {
        self.drones
            .iter()
            .any(|drone| drone.violation == Some(rule))
    }

    /// No drone leads or gave orders under another's ballot, and no ballot has two orders with the same sequence.
    fn only_the_named_acts(&self) -> bool {
        let leads_for_another = self
            .drones
            .iter()
            .any(|it| it.leads() && it.mission_ballot().is_none_or(|own| own.master != it.id));
        let mut frames = self.drones.iter().flat_map(|drone| drone.sent.iter());
        let contradicts = frames.clone().any(|one| {
            frames.clone().any(|other| {
                one.ballot == other.ballot
                    && one.sequence == other.sequence
                    && one.order != other.order
            })
        });
        // The master of a ballot has sent frames under it, so no other drone made it up.
        let made_up = frames.any(|frame| {
            let master = self.drone(frame.ballot.master);
            !master.sent.iter().any(|it| it.ballot == frame.ballot)
        });
        let rules = [
            Violation::OrderedForAnother,
            Violation::AcknowledgedForAnother,
        ];
        let acted_for_another = rules.into_iter().any(|rule| self.is_violated(rule));
        !leads_for_another && !contradicts && !made_up && !acted_for_another
    }

    /// Drones that lead according to their routing.
    fn masters(&self) -> Vec<NodeId> {
        let leads = |it: &&super::drone::Drone| it.ballot().is_some_and(|own| own.master == it.id);
        let drones = self.drones.iter().map(AsRef::as_ref);
        drones.filter(leads).map(|it| it.id).collect()
    }

    /// Whether each segment has one leading master, followed by all its members in routing and mission.
    fn each_segment_has_one_master(&self) -> bool {
        let up = self.drones.iter().filter(|drone| drone.is_up);
        up.into_iter().all(|drone| {
            let Some(ballot) = drone.ballot() else {
                return false;
            };
            let segment = self.segment_of(drone.id);
            let follows = |id: &NodeId| {
                let drone = self.drone(*id);
                drone.ballot() == Some(ballot) && drone.mission_ballot() == Some(ballot)
            };
            segment.contains(&ballot.master)
                && self.drone(ballot.master).leads()
                && segment.iter().all(follows)
        })
    }
}

/// More steps than any swarm of these cases needs to settle.
const SETTLING_STEPS_MAX: usize = 1_000;

impl Swarm {
    /// Whether it settles without further faults, with actions taken in turn.
    fn settles(&self, state: &State) -> bool {
        let mut state = state.clone();
        (0..SETTLING_STEPS_MAX).any(|step| {
            let mut actions = Vec::new();
            for id in self.ids() {
                self.progress_of(&state, id, &mut actions);
            }
            let first = step % actions.len().max(1);
            actions.rotate_left(first);
            let next = actions
                .into_iter()
                .find_map(|action| self.next_state(&state, action));
            let is_settled = next.is_none();
            if let Some(next) = next {
                state = next;
            }
            is_settled
        })
    }

    /// Whether nothing changes without a fault or healed links.
    fn is_settled(&self, state: &State) -> bool {
        let mut actions = Vec::new();
        for id in self.ids() {
            let drone = state.drone(id);
            let is_busy =
                !drone.mailbox.is_empty() || state.may_miss(id) && state.has_lost_master(id);
            if is_busy && drone.is_up {
                return false;
            }
            self.progress_of(state, id, &mut actions);
        }
        actions
            .into_iter()
            .all(|action| self.next_state(state, action).is_none())
    }
}
