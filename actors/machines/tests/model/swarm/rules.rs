//! What must hold in every state, and what must happen in some, or the model would prove nothing.

use std::collections::BTreeSet;

use muster_machines::identity::NodeId;
use stateright::{Model, Property};

use super::routing::Broken;
use super::{Faults, State, Swarm};

/// Rule 1a.
pub(crate) const NAMED: &str = "1a: only the drone named in a ballot acts under it";
/// Rule 1b.
pub(crate) const NEVER_FALLS: &str = "1b: the ballot that a drone obeys never falls";
/// That there are such parts.
pub(crate) const SETTLES: &str = "once nothing more goes wrong, all parts settle";
/// Rule 1c.
pub(crate) const ONE_MASTER: &str =
    "1c: each part that has settled has one master, leader by all its members";

pub(crate) fn properties(faults: Faults, settles: bool) -> Vec<Property<Swarm>> {
    let mut all = vec![
        Property::<Swarm>::always(NAMED, |_, state| state.only_the_named_acts()),
        Property::<Swarm>::always(NEVER_FALLS, |_, state| !state.broke(Broken::BallotFell)),
        Property::<Swarm>::always(ONE_MASTER, |swarm, state| {
            !swarm.is_settled(state) || state.each_part_has_one_master()
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
            "somebody is elected",
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
                        .said
                        .iter()
                        .any(|frame| frame.ballot.master == drone.id);
                    led && drone.ballot().is_some_and(|it| it.master != drone.id)
                })
            },
        ));
    }
    if faults.splits > 0 {
        all.push(Property::<Swarm>::sometimes(
            "two parts settle under a master each",
            |swarm, state| state.masters().len() > 1 && swarm.is_settled(state),
        ));
        all.push(Property::<Swarm>::sometimes(
            "parts that had a master each are one again",
            |swarm, state| {
                let ever = state.drones.iter().flat_map(|drone| drone.said.iter());
                let masters: BTreeSet<_> = ever.map(|frame| frame.ballot.master).collect();
                masters.len() > 1
                    && state.left.splits < swarm.faults.splits
                    && state.left.suspicions == swarm.faults.suspicions
                    && state.left.crashes == swarm.faults.crashes
                    && state.links.is_whole()
                    && swarm.is_settled(state)
            },
        ));
    }
    if faults.crashes > 0 {
        all.push(Property::<Swarm>::sometimes(
            "a drone that restarted is one of its swarm again, under another master",
            |swarm, state| {
                let up = state.drones.iter().all(|drone| drone.is_up);
                let elected = |it: &super::Drone| it.ballot().is_some_and(|it| it.is_elected());
                state.left.crashes < swarm.faults.crashes
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
    fn broke(&self, what: Broken) -> bool {
        self.drones.iter().any(|drone| drone.broke == Some(what))
    }

    /// Nobody leads, or ever ordered, under the ballot of another; and no ballot has two orders of one number.
    fn only_the_named_acts(&self) -> bool {
        let leads_for_another = self
            .drones
            .iter()
            .any(|it| it.leads() && it.mission_ballot().is_none_or(|own| own.master != it.id));
        let mut frames = self.drones.iter().flat_map(|drone| drone.said.iter());
        let contradicts = frames.clone().any(|one| {
            frames.clone().any(|other| {
                one.ballot == other.ballot
                    && one.sequence == other.sequence
                    && one.order != other.order
            })
        });
        // What is said under a ballot its master knows of; unless it has lost its journal, nobody else made it up.
        let made_up = frames.any(|frame| {
            let master = self.drone(frame.ballot.master);
            !master.said.iter().any(|it| it.ballot == frame.ballot)
        });
        let broke = [Broken::OrderedForAnother, Broken::AcknowledgedForAnother];
        let meddled = broke.into_iter().any(|what| self.broke(what));
        !leads_for_another && !contradicts && !made_up && !meddled
    }

    /// Whoever leads, as far as its routing knows.
    fn masters(&self) -> Vec<NodeId> {
        let leads = |it: &&super::drone::Drone| it.ballot().is_some_and(|own| own.master == it.id);
        let drones = self.drones.iter().map(AsRef::as_ref);
        drones.filter(leads).map(|it| it.id).collect()
    }

    /// Whether in each part all obey the ballot of one of them, in routing and mission, who leads.
    fn each_part_has_one_master(&self) -> bool {
        let up = self.drones.iter().filter(|drone| drone.is_up);
        up.into_iter().all(|drone| {
            let Some(ballot) = drone.ballot() else {
                return false;
            };
            let part = self.part_of(drone.id);
            let obeys = |id: &NodeId| {
                let drone = self.drone(*id);
                drone.ballot() == Some(ballot) && drone.mission_ballot() == Some(ballot)
            };
            part.contains(&ballot.master)
                && self.drone(ballot.master).leads()
                && part.iter().all(obeys)
        })
    }
}

/// More steps than any swarm here needs to settle.
const SETTLING_STEPS_MAX: usize = 1_000;

impl Swarm {
    /// Whether it comes to rest if nothing goes wrong from here on, each taking its turn.
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

    /// Whether nothing changes any more unless something goes wrong, or heals.
    fn is_settled(&self, state: &State) -> bool {
        let mut actions = Vec::new();
        for id in self.ids() {
            let drone = state.drone(id);
            let is_busy = !drone.post.is_empty() || state.may_miss(id) && state.has_lost_master(id);
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
