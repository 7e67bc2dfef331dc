//! Who leads whom, as seen from outside.

use std::collections::{BTreeMap, BTreeSet};

use muster_machines::identity::NodeId;
use muster_machines::mission::{LandingReason, State};

use super::core::Core;
use super::processes::Processes;
use super::swarm::Swarm;
use crate::checkers::{MemberState, Violation};
use crate::scenario::Target;

/// A view of the world that answers who flies, who leads and who must follow. It has no state of its own.
#[derive(Debug, Clone, Copy)]
pub(super) struct Leadership<'a> {
    pub(super) core: &'a Core,
    pub(super) processes: &'a Processes,
}

impl Leadership<'_> {
    /// Whom a master must await at a waypoint: followers that have been in its segment long enough for it to know. After
    /// an election, also long enough under its ballot.
    pub(super) fn awaited_by(self, master: NodeId) -> BTreeSet<NodeId> {
        let (now, election) = (self.core.now(), &self.core.checkers.election);
        let swarm = self.core.swarms.of(master);
        let mut segment = swarm.segments.segment_of(master);
        let Some(epoch) = election.leader(master) else {
            return segment;
        };
        let settling = swarm.settled.settling();
        let hops = u32::try_from(segment.len()).unwrap_or(u32::MAX);
        let propagation = settling.propagation(hops);
        let is_known = |id: NodeId| {
            let followed_for = now.since(election.since(id));
            let turned_recently = epoch.is_elected() && followed_for <= settling.time(hops);
            !turned_recently
                && swarm
                    .segments
                    .have_been_together((id, master), now, propagation)
        };
        segment.retain(|id| election.leader(*id) == Some(epoch) && is_known(*id));
        segment
    }

    /// Checks that each segment has one master, once it has had time to settle.
    pub(super) fn check_settled(self) -> Option<Violation> {
        let member_state = |id| MemberState {
            flies: self.flies(id),
            leads: self.may_lead(id),
            spreads: self.state(id).is_spreading(),
            leader: self.core.checkers.election.leader(id),
        };
        let mut swarms = self.core.swarms.iter();
        swarms.find_map(|swarm| {
            let (now, segments) = (self.core.now(), &swarm.segments);
            swarm.settled.look(now, segments, member_state)
        })
    }

    /// The drone that a fault affects. `None` if it affects the master and nobody leads.
    pub(super) fn find(self, target: Target) -> Option<NodeId> {
        let election = &self.core.checkers.election;
        match target {
            Target::Drone(drone) => Some(drone),
            Target::Master => (self.core.swarms.own().ids())
                .filter(|id| {
                    let drone = &self.processes[*id];
                    drone.runs() && !drone.given_up
                })
                .filter_map(|id| election.leader(id).filter(|it| it.master == id))
                .reduce(|best, ballot| if ballot.beats(&best) { ballot } else { best })
                .map(|ballot| ballot.master),
        }
    }

    /// Whether a drone follows its own ballot.
    pub(super) fn leads(self, id: NodeId) -> bool {
        let leader = self.core.checkers.election.leader(id);
        leader.is_some_and(|it| it.master == id)
    }

    /// The masters of a swarm, if all connected drones that fly the mission follow the same one, and it may lead.
    /// Otherwise two of them that follow different masters, or twice the same that follows none.
    pub(super) fn masters_of(self, swarm: &Swarm) -> Result<BTreeSet<NodeId>, (NodeId, NodeId)> {
        let election = &self.core.checkers.election;
        let is_at_odds = |(a, b): (NodeId, NodeId)| {
            swarm.segments.are_connected(a, b)
                && self.flies(a)
                && self.flies(b)
                && election.leader(a) != election.leader(b)
        };
        if let Some(pair) = swarm.at_odds.filter(|pair| is_at_odds(*pair)) {
            return Err(pair);
        }
        // By the first node of each connected group: the first of the group that flies, and its leader.
        let mut groups = BTreeMap::new();
        for id in swarm.ids().filter(|id| self.flies(*id)) {
            let leader = election.leader(id).ok_or((id, id))?;
            let group = swarm.segments.first_connected_with(id);
            match groups.entry(group).or_insert((id, leader)) {
                (_, other) if *other == leader => {}
                (other, _) => return Err((*other, id)),
            }
        }
        let masters = groups.into_values().map(|(id, leader)| {
            let master = leader.master;
            let leads = swarm.segments.are_connected(id, master) && self.may_lead(master);
            leads.then_some(master).ok_or((id, id))
        });
        masters.collect()
    }

    fn state(self, id: NodeId) -> State {
        self.core.swarms.of(id).recorder.state(id)
    }

    fn landing_reason(self, id: NodeId) -> Option<LandingReason> {
        self.core.swarms.of(id).recorder.of(id).reason
    }

    /// Whether a drone is in the air, flies the mission and can be led. A drone that lands without a
    /// master, or with the mission over, may be on its last leg. One that has left the swarm can't be led.
    fn flies(self, id: NodeId) -> bool {
        let is_last_leg = matches!(
            self.landing_reason(id),
            Some(LandingReason::MasterSilent | LandingReason::MissionOver)
        );
        let state = self.state(id);
        let is_led = state.is_on_mission() && state != State::Independent;
        is_led && !is_last_leg && self.processes[id].is_sound()
    }

    /// Whether a drone may lead others that fly. One that goes to land alone leads until it announces that, once it has
    /// cleared their airspace.
    fn may_lead(self, id: NodeId) -> bool {
        let reason = self.landing_reason(id);
        let has_yet_to_clear = match self.state(id) {
            State::MovingToLand => reason != Some(LandingReason::MissionOver),
            State::Landing => reason == Some(LandingReason::PositionLost),
            _ => false,
        };
        self.flies(id) || has_yet_to_clear && self.processes[id].is_sound()
    }
}
