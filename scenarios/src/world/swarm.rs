//! The swarms of a world. The world numbers all drones and relays through, the scenario's own swarm first. Each swarm
//! numbers its members from 0; what passes between a drone and the world is renumbered.

use std::collections::BTreeSet;
use std::time::Duration;

use muster_machines::identity::NodeId;
use muster_machines::node::Observation;
use muster_machines::time::Timestamp;
use muster_machines::{mission, routing, wire};
use muster_runtime::plan::{Follow, Plan};

use super::recorder::Recorder;
use crate::checkers::{BarrierChecker, SettledChecker};
use crate::scenario::{Links, Scenario};
use crate::segments::Segments;

/// A swarm in the middle of a run.
///
/// Invariant: its drones and relays have consecutive numbers in the world.
#[derive(Debug)]
pub(super) struct Swarm {
    /// The world's number of its drone 0.
    first: u32,
    /// How many drones and relays it has.
    nodes: u32,
    /// The longest that a vehicle takes to come to rest at the end of a leg.
    pub(super) settle: Duration,
    /// What the pilot and the operator do once the master is followed.
    pub(super) follow: Option<Follow>,
    pub(super) recorder: Recorder,
    pub(super) segments: Segments,
    pub(super) settled: SettledChecker,
    pub(super) barrier: BarrierChecker,
    /// Two connected members that followed different masters when last looked at.
    pub(super) at_odds: Option<(NodeId, NodeId)>,
}

impl Swarm {
    /// A swarm at the start of a run, whose drone 0 is number `first` of its world.
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

    /// The world's numbers of its drones and relays.
    pub(super) fn ids(&self) -> impl Iterator<Item = NodeId> + use<> {
        (self.first..self.first + self.nodes).map(NodeId)
    }

    /// Whether a drone or relay is one of its own.
    pub(super) fn has(&self, id: NodeId) -> bool {
        (self.first..self.first + self.nodes).contains(&id.0)
    }

    /// The world's number of a member.
    pub(super) const fn number(&self, member: NodeId) -> NodeId {
        NodeId(self.first + member.0)
    }

    /// The swarm's number of one of its own.
    pub(super) const fn member(&self, number: NodeId) -> NodeId {
        NodeId(number.0 - self.first)
    }

    /// An observation with the world's numbers.
    pub(super) fn renumbered(&self, mut seen: Observation) -> Observation {
        let renumber = |id: &mut NodeId| *id = self.number(*id);
        match &mut seen {
            Observation::Mission(event) => match event {
                mission::Event::Follows(ballot) => renumber(&mut ballot.master),
                mission::Event::LeftOut(id) => renumber(id),
                mission::Event::State(_)
                | mission::Event::Opened { .. }
                | mission::Event::LeftLockstep
                | mission::Event::Landing(_)
                | mission::Event::Refused
                | mission::Event::Checkpoint(_)
                | mission::Event::AgentCheckpoint(_)
                | mission::Event::AgentFailed(_)
                | mission::Event::Observed(_) => {}
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
                routing::Event::Left | routing::Event::Checkpoint(_) => {}
            },
            Observation::Radio(_) | Observation::Navigation(_) => {}
        }
        seen
    }

    /// Records the masters of its segments, or two members at odds. Returns whether that ended an election.
    pub(super) fn record_masters(
        &mut self,
        now: Timestamp,
        masters: Result<BTreeSet<NodeId>, (NodeId, NodeId)>,
    ) -> bool {
        self.at_odds = masters.as_ref().err().copied();
        self.recorder.masters(now, masters.ok())
    }

    /// Whether it has flown, or never will since its master is out.
    fn is_done(&self) -> bool {
        self.recorder.has_flown() || self.recorder.is_out(self.recorder.centre())
    }
}

/// All swarms of a world, the scenario's own first.
///
/// Invariant: every drone and relay is of exactly one of them.
#[derive(Debug)]
pub(super) struct Swarms(Vec<Swarm>);

impl Swarms {
    /// Swarms in the order of their numbers; at least one.
    pub(super) const fn new(swarms: Vec<Swarm>) -> Self {
        Self(swarms)
    }

    /// The scenario's own swarm.
    pub(super) fn own(&self) -> &Swarm {
        &self.0[0]
    }

    /// Whether there are no other swarms.
    pub(super) const fn is_one(&self) -> bool {
        self.0.len() == 1
    }

    pub(super) const fn len(&self) -> usize {
        self.0.len()
    }

    pub(super) fn get(&self, index: usize) -> &Swarm {
        &self.0[index]
    }

    pub(super) fn get_mut(&mut self, index: usize) -> &mut Swarm {
        &mut self.0[index]
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &Swarm> {
        self.0.iter()
    }

    pub(super) fn iter_mut(&mut self) -> impl Iterator<Item = &mut Swarm> {
        self.0.iter_mut()
    }

    /// How many drones and relays they have together.
    pub(super) fn nodes(&self) -> u32 {
        self.0.last().map_or(0, |last| last.first + last.nodes)
    }

    /// The swarm of a drone or relay.
    pub(super) fn of(&self, id: NodeId) -> &Swarm {
        &self.0[self.index_of(id)]
    }

    pub(super) fn of_mut(&mut self, id: NodeId) -> &mut Swarm {
        let index = self.index_of(id);
        &mut self.0[index]
    }

    fn index_of(&self, id: NodeId) -> usize {
        if self.is_one() {
            return 0;
        }
        self.0.partition_point(|swarm| swarm.first <= id.0) - 1
    }

    /// The sender in a frame's header, not authenticated. `None` if it is of no swarm here.
    pub(super) fn sender(&self, datagram: &[u8]) -> Option<NodeId> {
        let header = wire::decode_frame(datagram).ok()?.header;
        let index = header.swarm.0.checked_sub(Plan::FIRST_SWARM.0)? as usize;
        let swarm = self.0.get(index)?;
        Some(swarm.number(header.sender))
    }

    /// Whether each has flown or never will.
    pub(super) fn are_done(&self) -> bool {
        self.0.iter().all(Swarm::is_done)
    }

    /// How many waypoints the drones have reached so far; take-offs and landings count as one each.
    pub(super) fn steps_done(&self) -> u64 {
        self.0.iter().map(|it| it.recorder.steps_done()).sum()
    }

    /// Records how often the medium has sent a frame again so far.
    pub(super) fn retried(&mut self, retries: u64) {
        for swarm in &mut self.0 {
            swarm.recorder.retried(retries);
        }
    }

    /// Links between two groups have changed in their losses.
    pub(super) fn links_changed(&mut self, now: Timestamp, links: &Links) {
        for swarm in &mut self.0 {
            let ids = links.from.iter().chain(&*links.to).copied();
            swarm.segments.links_changed(now, ids);
        }
    }

    /// Frames of a drone, or of all, arrive later or no longer so.
    pub(super) fn delays_changed(&mut self, now: Timestamp, from: Option<NodeId>) {
        let nodes = self.nodes();
        for swarm in &mut self.0 {
            let ids = (0..nodes).map(NodeId);
            let ids = ids.filter(|id| from.is_none_or(|it| it == *id));
            swarm.segments.links_changed(now, ids);
        }
    }

    /// The longest delay of frames that all swarms put up with.
    pub(super) fn tolerated_delay(&self) -> Duration {
        let tolerated = self
            .0
            .iter()
            .map(|it| it.settled.settling().tolerated_delay);
        tolerated.min().unwrap_or_default()
    }

    /// The recorders of all swarms, with the number of drones and relays of each.
    pub(super) fn finish(self) -> impl Iterator<Item = (Recorder, usize)> {
        let swarms = self.0.into_iter();
        swarms.map(|swarm| (swarm.recorder, swarm.nodes as usize))
    }
}
