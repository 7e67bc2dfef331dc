//! A swarm of a few drones and all its possible events, as a model for stateright.
//!
//! Each drone runs the shipped mission and leader epoch. Left out: time (a drone may miss its master at any moment),
//! positions (no drone arrives at the next waypoint), and routes of frames (every drone repeats what it knows).

mod drone;
mod faults;
mod journal;
mod routing;
mod rules;
mod search;
mod setting;

use std::sync::Arc;

use muster_machines::identity::NodeId;
use muster_machines::leader::LinkSymmetry;
use muster_machines::mission;
use muster_machines::node::Address;
use stateright::{Model, Property};

pub(crate) use self::drone::Drone;
pub(crate) use self::faults::{Faults, Flaw, Pace};
pub(crate) use self::search::{Found, search};
use self::setting::Links;

/// The model.
#[derive(Debug, Clone)]
pub(crate) struct Swarm {
    configs: Vec<mission::Config>,
    faults: Faults,
    pace: Pace,
    flaw: Flaw,
    settles: bool,
}

/// State of the model.
#[derive(Debug, Clone, PartialEq, Hash)]
pub(crate) struct State {
    pub(crate) drones: Vec<Arc<Drone>>,
    links: Links,
    /// Faults that may still occur.
    remaining: Faults,
}

/// Next event.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Action {
    Send(NodeId),
    Receive {
        from: NodeId,
        frame: usize,
        to: NodeId,
    },
    Handle(NodeId, Address),
    MissMaster(NodeId),
    Suspect(NodeId),
    Fail(NodeId, Address),
    RestartActor(NodeId, Address),
    /// A process crashes; these numbers of each machine's unsynced checkpoints remain.
    Crash {
        drone: NodeId,
        epochs: usize,
        missions: usize,
    },
    Restart(NodeId),
    /// The drones in this set, one bit each, are cut off from the others.
    Split(u16),
    OneWay {
        from: NodeId,
        to: NodeId,
    },
    Heal,
}

/// The two modelled actors.
const ACTORS: [Address; 2] = [Address::Routing, Address::Mission];

impl Swarm {
    /// Drones in a line, in the air at the first waypoint, where the master waits for them.
    pub(crate) fn new(drones: u32, faults: Faults, pace: Pace) -> Self {
        Self {
            configs: setting::configs(drones),
            faults,
            pace,
            flaw: Flaw::None,
            settles: false,
        }
    }

    /// Adds a deliberate flaw.
    pub(crate) fn with(self, flaw: Flaw) -> Self {
        Self { flaw, ..self }
    }

    /// Also follows every state until nothing changes, which takes ten times as long.
    pub(crate) fn that_settles(self) -> Self {
        Self {
            settles: true,
            ..self
        }
    }

    fn ids(&self) -> impl Iterator<Item = NodeId> + use<> {
        (0..).map(NodeId).take(self.configs.len())
    }

    fn config(&self, id: NodeId) -> &mission::Config {
        &self.configs[id.0 as usize]
    }

    /// Changes one drone; `None` if it stays the same.
    fn change(&self, state: &State, id: NodeId, change: impl FnOnce(&mut Drone)) -> Option<State> {
        let before = state.drone(id);
        let mut drone = before.clone();
        change(&mut drone);
        if self.pace == Pace::Prompt {
            drone.handle_all(self.flaw);
        }
        if drone == *before {
            return None;
        }
        drone.compare(before);
        let mut next = state.clone();
        next.drones[id.0 as usize] = Arc::new(drone);
        Some(next)
    }

    fn actions_of(&self, state: &State, id: NodeId, actions: &mut Vec<Action>) {
        let drone = state.drone(id);
        if !drone.is_up {
            actions.push(Action::Restart(id));
            return;
        }
        self.progress_of(state, id, actions);
        let remaining = state.remaining;
        if remaining.suspicions > 0 && state.may_miss(id) && !state.has_lost_master(id) {
            actions.push(Action::Suspect(id));
        }
        if remaining.failures > 0 {
            let is_up = |address: &Address| match address {
                Address::Routing => drone.routing.is_some(),
                _ => drone.mission.is_some(),
            };
            let up = ACTORS.into_iter().filter(is_up);
            actions.extend(up.map(|address| Action::Fail(id, address)));
        }
        if remaining.crashes > 0 {
            for epochs in 0..=drone.journal.epoch.unsynced() {
                let found = 0..=drone.journal.mission.unsynced();
                actions.extend(found.map(|missions| Action::Crash {
                    drone: id,
                    epochs,
                    missions,
                }));
            }
        }
    }

    /// Events of a drone without a fault.
    fn progress_of(&self, state: &State, id: NodeId, actions: &mut Vec<Action>) {
        let drone = state.drone(id);
        if !drone.is_up {
            return;
        }
        if drone
            .frame()
            .is_some_and(|frame| !drone.sent.contains(&frame))
        {
            actions.push(Action::Send(id));
        }
        for from in self.ids().filter(|from| state.links.carries(*from, id)) {
            let frames = 0..state.drone(from).sent.len();
            actions.extend(frames.map(|frame| Action::Receive {
                from,
                frame,
                to: id,
            }));
        }
        let waiting = ACTORS.into_iter().filter(|it| drone.has_message_for(*it));
        actions.extend(waiting.map(|address| Action::Handle(id, address)));
        if state.may_miss(id) && state.has_lost_master(id) {
            actions.push(Action::MissMaster(id));
        }
        if drone.routing.is_none() {
            actions.push(Action::RestartActor(id, Address::Routing));
        }
        if drone.mission.is_none() {
            actions.push(Action::RestartActor(id, Address::Mission));
        }
    }

    fn faults_of_links(&self, state: &State, actions: &mut Vec<Action>) {
        if state.links.is_whole() {
            if state.remaining.splits > 0 {
                // Each partition once: the first drone is never in the cut-off set.
                let sets = 1..1_u16 << (self.configs.len() - 1);
                actions.extend(sets.map(|set| Action::Split(set << 1)));
            }
        } else {
            actions.push(Action::Heal);
        }
        if state.remaining.one_way > 0 {
            for from in self.ids() {
                let others = self.ids().filter(|to| *to != from);
                actions.extend(others.map(|to| Action::OneWay { from, to }));
            }
        }
    }
}

impl State {
    pub(crate) fn drone(&self, id: NodeId) -> &Drone {
        &self.drones[id.0 as usize]
    }

    /// Whether a drone's routing can miss its master and has not reported it.
    fn may_miss(&self, id: NodeId) -> bool {
        let routing = self.drone(id).routing.as_ref();
        routing.is_some_and(|it| !it.master_silent && !it.epoch.is_led_by(id))
    }

    /// Whether a drone has no route to its master.
    fn has_lost_master(&self, id: NodeId) -> bool {
        let master = self.drone(id).ballot().map(|ballot| ballot.master);
        master.is_some_and(|master| !self.segment_of(id).contains(&master))
    }

    /// Running drones connected to `id` by mutual links.
    fn segment_of(&self, id: NodeId) -> Vec<NodeId> {
        let is_up = |id: NodeId| self.drone(id).is_up;
        self.links.segment_of(id, self.drones.len(), is_up)
    }
}

impl Model for Swarm {
    type State = State;
    type Action = Action;

    fn init_states(&self) -> Vec<State> {
        vec![State {
            drones: setting::in_flight(&self.configs),
            links: Links::whole(),
            remaining: self.faults,
        }]
    }

    fn actions(&self, state: &State, actions: &mut Vec<Action>) {
        for id in self.ids() {
            self.actions_of(state, id, actions);
        }
        self.faults_of_links(state, actions);
    }

    fn next_state(&self, state: &State, action: Action) -> Option<State> {
        let flaw = self.flaw;
        let mut next = match action {
            Action::Send(id) => {
                let frame = state.drone(id).frame()?;
                self.change(state, id, |drone| drone.send_frame(frame, flaw))
            }
            Action::Receive { from, frame, to } => {
                let frame = &state.drone(from).sent[frame];
                let symmetry = if state.links.carries(to, from) {
                    LinkSymmetry::Symmetric
                } else {
                    LinkSymmetry::OneWay
                };
                let has_route = !state.has_lost_master(to);
                self.change(state, to, |drone| {
                    drone.receive(frame, symmetry, has_route, flaw);
                })
            }
            Action::Handle(id, address) => {
                self.change(state, id, |drone| drone.handle_next(address, flaw))
            }
            Action::MissMaster(id) | Action::Suspect(id) => {
                self.change(state, id, Drone::miss_master)
            }
            Action::Fail(id, address) => self.change(state, id, |drone| drone.fail(address)),
            Action::RestartActor(id, address) => {
                let config = self.config(id);
                self.change(state, id, |drone| drone.restart_actor(address, config))
            }
            Action::Crash {
                drone,
                epochs,
                missions,
            } => self.change(state, drone, |drone| drone.crash(epochs, missions)),
            Action::Restart(id) => self.change(state, id, |drone| {
                if flaw == Flaw::ForgetsItsJournal {
                    drone.journal = setting::in_flight(&self.configs)[id.0 as usize]
                        .journal
                        .clone();
                }
                drone.restart(self.config(id));
            }),
            Action::Split(_) | Action::OneWay { .. } | Action::Heal => {
                let mut next = state.clone();
                next.links = state.links.after(&action, self.configs.len());
                Some(next)
            }
        }?;
        match action {
            Action::Suspect(_) => next.remaining.suspicions -= 1,
            Action::Fail(..) => next.remaining.failures -= 1,
            Action::Crash { .. } => next.remaining.crashes -= 1,
            Action::Split(_) => next.remaining.splits -= 1,
            Action::OneWay { .. } => next.remaining.one_way -= 1,
            _ => {}
        }
        Some(next)
    }

    fn properties(&self) -> Vec<Property<Self>> {
        rules::properties(self.faults, self.settles)
    }
}
