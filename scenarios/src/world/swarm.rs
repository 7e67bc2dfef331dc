//! The swarms of a world. Their drones and relays are numbered through, the scenario's own first; each swarm knows its
//! members by numbers from 0, and what passes between a drone and the world is renumbered on its way.

use std::time::Duration;

use muster_machines::identity::NodeId;
use muster_machines::node::Observation;
use muster_machines::{mission, routing, wire};
use muster_runtime::plan::{Follow, Plan};

use super::{Recorder, World};
use crate::checkers::{BarrierChecker, SettledChecker};
use crate::scenario::Scenario;
use crate::segments::Segments;

/// A swarm in the middle of a run.
#[derive(Debug)]
pub(crate) struct Swarm {
    /// The number in this world of its drone 0.
    first: u32,
    /// How many drones and relays it has.
    nodes: u32,
    /// How long a vehicle takes at most to come to rest at the end of a leg.
    pub(super) settle: Duration,
    /// What is to happen once the master is followed.
    pub(super) follow: Option<Follow>,
    pub(super) recorder: Recorder,
    pub(super) segments: Segments,
    pub(super) settled: SettledChecker,
    pub(super) barrier: BarrierChecker,
    /// Two of it that were connected when last looked at and obeyed different masters.
    pub(super) at_odds: Option<(NodeId, NodeId)>,
}

impl Swarm {
    /// A swarm before anything has happened, whose drone 0 is number `first` of its world.
    pub(super) fn new(scenario: &Scenario, first: u32) -> Self {
        let formation = scenario.plan.layout.formation();
        let nodes = scenario.plan.nodes();
        let centre = NodeId(first + formation.centre().0);
        Self {
            first,
            nodes,
            settle: scenario.plan.settle,
            follow: scenario.plan.follow.clone(),
            recorder: Recorder::new(NodeId(first), (formation.drones(), nodes), centre),
            segments: Segments::default(),
            settled: SettledChecker::new(scenario.settling()),
            barrier: BarrierChecker::new(scenario.plan.protocol.barrier, (first + nodes) as usize),
            at_odds: None,
        }
    }

    /// Its drones and relays, as the world numbers them.
    pub(super) fn ids(&self) -> impl Iterator<Item = NodeId> + use<> {
        (self.first..self.first + self.nodes).map(NodeId)
    }

    /// Whether a drone or relay is one of its own.
    pub(super) fn has(&self, id: NodeId) -> bool {
        (self.first..self.first + self.nodes).contains(&id.0)
    }

    /// What the world calls a member.
    pub(super) const fn number(&self, member: NodeId) -> NodeId {
        NodeId(self.first + member.0)
    }

    /// What the swarm calls one of its own.
    pub(super) const fn member(&self, number: NodeId) -> NodeId {
        NodeId(number.0 - self.first)
    }

    /// The same with its members as the world calls them.
    pub(super) fn renumbered(&self, mut seen: Observation) -> Observation {
        let renumber = |id: &mut NodeId| *id = self.number(*id);
        match &mut seen {
            Observation::Mission(event) => match event {
                mission::Event::Obeys(ballot) => renumber(&mut ballot.master),
                mission::Event::LeftOut(id) => renumber(id),
                mission::Event::State(_)
                | mission::Event::Opened { .. }
                | mission::Event::Landing(_)
                | mission::Event::Refused
                | mission::Event::Checkpoint(_) => {}
            },
            Observation::Routing(event) => match event {
                routing::Event::NeighbourStable(id) | routing::Event::Ignored(id) => renumber(id),
                routing::Event::Routes(routes) => {
                    let ids = routes.parent.iter_mut().chain(&mut routes.routing_list);
                    ids.for_each(renumber);
                }
                routing::Event::Reached { member, via, .. } => {
                    renumber(member);
                    renumber(via);
                }
                routing::Event::Checkpoint(_) => {}
            },
            Observation::Radio(_) => {}
        }
        seen
    }

    /// Whether it has flown, or never will: its master is out of it.
    fn is_done(&self) -> bool {
        self.recorder.has_flown() || self.recorder.is_out_of_it(self.recorder.centre())
    }
}

impl World {
    /// The swarm of a drone or relay.
    pub(super) fn swarm(&self, of: NodeId) -> &Swarm {
        &self.swarms[self.index_of_swarm(of)]
    }

    pub(super) fn swarm_mut(&mut self, of: NodeId) -> &mut Swarm {
        let index = self.index_of_swarm(of);
        &mut self.swarms[index]
    }

    /// What is written down of the swarm of a drone or relay.
    pub(super) fn recorder(&mut self, of: NodeId) -> &mut Recorder {
        &mut self.swarm_mut(of).recorder
    }

    pub(super) fn index_of_swarm(&self, of: NodeId) -> usize {
        if self.swarms.len() == 1 {
            return 0;
        }
        self.swarms.partition_point(|swarm| swarm.first <= of.0) - 1
    }

    /// The swarm that the scenario is about; its fault plan is about it alone.
    pub(super) fn own_swarm(&self) -> &Swarm {
        &self.swarms[0]
    }

    /// Whose frame this is, by what it says of itself.
    pub(super) fn sender(&self, datagram: &[u8]) -> Option<NodeId> {
        let header = wire::decode_frame(datagram).ok()?.header;
        let index = header.swarm.0.checked_sub(Plan::FIRST_SWARM.0)? as usize;
        let swarm = self.swarms.get(index)?;
        Some(swarm.number(header.sender))
    }

    /// Nobody is in the air, and every swarm has flown or will never take off.
    pub(super) fn is_over(&self) -> bool {
        self.airborne == 0 && self.swarms.iter().all(Swarm::is_done)
    }

    /// How many waypoints the drones have reached so far, take-offs and landings counted as one each.
    pub(crate) fn steps_done(&self) -> u64 {
        self.swarms.iter().map(|it| it.recorder.steps_done()).sum()
    }
}
