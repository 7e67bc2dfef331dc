//! Who is connected with whom, and so who is to have the same master.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use muster_machines::identity::NodeId;
use muster_machines::mission::{LandingReason, State};
use muster_machines::node::Address;

use super::{Swarm, World};
use crate::checkers::MemberState;
use crate::scenario::Trigger;
use crate::segments::Link;

/// How often links are looked at while drones fly, besides whenever something happens that depends on them: at 10 m/s
/// each, two drones come 20 m nearer to each other meanwhile.
const LOOK_AT_LINKS_EVERY: Duration = Duration::from_secs(1);
/// Links that were looked at within this time are as they were: a drone flies less than a metre.
const LOOKED_AT_LATELY: Duration = Duration::from_millis(50);

impl World {
    /// Looks at the links if it is time to.
    pub(super) fn watch_links(&mut self) {
        if self.checks && self.now >= self.next_look {
            self.look_at_links();
            self.check_masters();
        }
    }

    /// Looks at the links before a drone falls silent, unless that was just done: where a thousand land at once, each look
    /// at all of them would find what the last one found.
    pub(super) fn look_at_links_before_silence(&mut self) {
        if self.now + LOOK_AT_LINKS_EVERY >= self.next_look + LOOKED_AT_LATELY {
            self.look_at_links();
        }
    }

    /// Takes in how the links are now.
    pub(super) fn look_at_links(&mut self) {
        self.next_look = self.now + LOOK_AT_LINKS_EVERY;
        let seen = Some((self.process_changes, self.medium.changes()));
        if self.looked_at == seen {
            return;
        }
        self.looked_at = seen;
        let ids = (0..).map(NodeId).take(self.drones.len());
        // Any number that is another one once it has failed, or does something else.
        let changes = |id: NodeId| {
            let recorder = &self.swarm(id).recorder;
            let failures = recorder.restarts_of(id) + self.drones[id.0 as usize].hangs;
            let does = match recorder.state(id) {
                State::Start | State::SetUp | State::Finished => 0,
                State::MovingToLand => 1,
                // A master that goes to land alone says so only now.
                State::Landing => 2,
                state if state.is_spreading() => 3,
                _ => 4,
            };
            failures * 5 + does
        };
        let live: Vec<_> = ids
            .map(|id| self.passes_on(id).then(|| changes(id)))
            .collect();
        let links = Link::all(&mut self.medium, |from| self.tampering.corrupted(from));
        for swarm in &mut self.swarms {
            let mut own = live.clone();
            for (id, live) in (0..).map(NodeId).zip(&mut own) {
                *live = live.filter(|_| swarm.has(id));
            }
            swarm.segments.look(self.now, own, links.clone());
            let nodes = u32::try_from(self.drones.len()).unwrap_or(u32::MAX);
            let news = swarm.settled.settling().news(nodes);
            swarm.segments.forget_older(self.now, news);
        }
    }

    /// For whom a master is to wait at a waypoint: those that have been of its part for long enough that it knows, and
    /// obey it; of those that turned to it only who did so long enough ago.
    pub(super) fn awaited_by(&self, master: NodeId) -> BTreeSet<NodeId> {
        let swarm = self.swarm(master);
        let mut segment = swarm.segments.segment_of(master);
        let Some(epoch) = self.election.leader(master) else {
            return segment;
        };
        let settling = swarm.settled.settling();
        let hops = u32::try_from(segment.len()).unwrap_or(u32::MAX);
        let news = settling.news(hops);
        let is_known = |id: NodeId| {
            let followed_for = self.now.since(self.election.since(id));
            let has_turned_lately = epoch.is_elected() && followed_for <= settling.time(hops);
            !has_turned_lately
                && swarm
                    .segments
                    .have_been_together((id, master), self.now, news)
        };
        segment.retain(|id| self.election.leader(*id) == Some(epoch) && is_known(*id));
        segment
    }

    /// Each part has its master, once it has had the time to settle.
    pub(super) fn check_masters(&mut self) {
        if !self.checks {
            return;
        }
        let member_state = |id| MemberState {
            flies: self.flies(id),
            leads: self.may_lead(id),
            spreads: self.swarm(id).recorder.state(id).is_spreading(),
            obeys: self.election.leader(id),
        };
        let mut looked_at = self.swarms.iter();
        let found = looked_at.find_map(|it| it.settled.look(self.now, &it.segments, member_state));
        self.find(found);
    }

    /// Whether frames get through a drone to others: what passes them on runs, and has not fallen silent because the drone
    /// is done or has no mission any more.
    pub(super) fn passes_on(&self, id: NodeId) -> bool {
        let drone = &self.drones[id.0 as usize];
        let runs = |address| drone.is_up(address) && !drone.is_hung(address);
        runs(Address::Radio)
            && runs(Address::Routing)
            && drone.is_up(Address::Mission)
            && self.swarm(id).recorder.state(id) != State::Finished
    }

    /// Whether a drone is in the air, flies the mission, and can be led. One without a master, or that has been told to land,
    /// may be on its last way.
    fn flies(&self, id: NodeId) -> bool {
        let recorder = &self.swarm(id).recorder;
        let is_last_way = matches!(
            recorder.of(id).reason,
            Some(LandingReason::MasterSilent | LandingReason::MissionOver)
        );
        recorder.state(id).is_following() && !is_last_way && self.drones[id.0 as usize].is_sound()
    }

    /// Whether a drone leads others that fly: one that goes to land alone does until it says so, which it does once it
    /// is out of their way.
    fn may_lead(&self, id: NodeId) -> bool {
        let recorder = &self.swarm(id).recorder;
        let reason = recorder.of(id).reason;
        let is_in_their_way = match recorder.state(id) {
            State::MovingToLand => reason != Some(LandingReason::MissionOver),
            State::Landing => reason == Some(LandingReason::PositionLost),
            _ => false,
        };
        self.flies(id) || is_in_their_way && self.drones[id.0 as usize].is_sound()
    }

    /// Writes down when a swarm has lost a master, or some of it obey another, and when each part has one again.
    pub(super) fn look_at_elections(&mut self) {
        self.look_at_links();
        self.check_masters();
        for index in 0..self.swarms.len() {
            let mut own = self.swarms[index].ids();
            if !own.any(|id| self.vehicles[id.0 as usize].is_armed()) {
                continue;
            }
            let masters = self.masters_if_settled(&self.swarms[index]);
            self.swarms[index].at_odds = masters.as_ref().err().copied();
            let masters = masters.ok();
            let recorder = &mut self.swarms[index].recorder;
            if recorder.election(self.now, masters) {
                let centre = recorder.centre();
                self.occurs(centre, Trigger::Settled);
            }
        }
    }

    /// A swarm's masters, if those that fly the mission obey, among all that some link connects, one drone of these; two
    /// that are connected and don't otherwise, or one whose master is none.
    fn masters_if_settled(&self, swarm: &Swarm) -> Result<BTreeSet<NodeId>, (NodeId, NodeId)> {
        let is_at_odds = |(a, b): (NodeId, NodeId)| {
            swarm.segments.are_connected(a, b)
                && self.flies(a)
                && self.flies(b)
                && self.election.leader(a) != self.election.leader(b)
        };
        if let Some(pair) = swarm.at_odds.filter(|pair| is_at_odds(*pair)) {
            return Err(pair);
        }
        // Of each connected group, by its first node, the first that flies and whom that obeys.
        let mut groups = BTreeMap::new();
        for id in swarm.ids().filter(|id| self.flies(*id)) {
            let leader = self.election.leader(id).ok_or((id, id))?;
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
}
