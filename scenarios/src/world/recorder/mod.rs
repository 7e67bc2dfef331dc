//! Records of a swarm's flight.

mod agents;
mod contact;
mod elections;
mod history;
mod milestones;
mod record;
mod traffic;

use std::collections::{BTreeMap, BTreeSet};

use muster_machines::agent::Observed;
use muster_machines::identity::NodeId;
use muster_machines::mission::{self, State};
use muster_machines::node::Address;
use muster_machines::radio::{self, DropReason};
use muster_machines::routing;
use muster_machines::time::Timestamp;

use self::agents::AgentReports;
use self::contact::Contact;
pub(crate) use self::elections::Election;
use self::elections::Elections;
pub(crate) use self::history::{History, Incident, InjectedFault, LINKED_NODES_MAX};
use self::milestones::Milestones;
pub(crate) use self::milestones::{Change, Crossing};
pub(crate) use self::record::Record;
use self::record::is_in_discovery_or_beyond;
use self::traffic::{Frames, Traffic, TrafficCounts};
use crate::segments::Segments;

/// The records of a swarm's drones and relays, and of what they did together.
///
/// Invariant: records and traffic are in the order of the nodes' numbers, drones first, then relays.
#[derive(Debug)]
pub(crate) struct Recorder {
    /// The world's number of the swarm's drone 0.
    first: NodeId,
    centre: NodeId,
    drones: usize,
    nodes: Vec<Record>,
    /// Apart from the records, since it changes with each frame.
    traffic: TrafficCounts,
    milestones: Milestones,
    elections: Elections,
    contact: Contact,
    has_flown: bool,
    agents: AgentReports,
    history: History,
}

impl Recorder {
    /// For this many drones, and this many drones and relays, numbered from `first` on.
    pub(super) fn new(first: NodeId, (drones, nodes): (u32, u32), centre: NodeId) -> Self {
        let (drones, nodes) = (drones as usize, nodes as usize);
        Self {
            first,
            centre,
            drones,
            nodes: vec![Record::new(); nodes],
            traffic: TrafficCounts::new(drones, nodes),
            milestones: Milestones::default(),
            elections: Elections::default(),
            contact: Contact::new(nodes),
            has_flown: false,
            agents: AgentReports::default(),
            history: History::default(),
        }
    }
}

/// What happens.
impl Recorder {
    /// Failures of agents, in order of time.
    pub(crate) fn agent_failures(&self) -> &[(Timestamp, NodeId, String)] {
        self.agents.failures()
    }

    /// Values that agents have reported: the first ones in order of time, then the last ones of each name.
    pub(crate) fn observed(&self) -> &[(Timestamp, NodeId, Observed)] {
        self.agents.observed()
    }

    /// A node sends a frame.
    pub(super) fn sent(&mut self, id: NodeId, keep_alive: bool) {
        self.traffic.sent(self.index(id), keep_alive);
    }

    /// A node admits a frame.
    pub(super) fn received(&mut self, id: NodeId) {
        self.traffic.received(self.index(id));
    }

    /// The nodes are processes that report their frames from time to time.
    pub(super) const fn frames_are_reported(&mut self) {
        self.traffic.are_reported();
    }

    /// How often the medium has sent a frame again so far.
    pub(super) const fn retried(&mut self, retries: u64) {
        self.traffic.retried(retries);
    }

    pub(super) fn armed(&mut self, id: NodeId, now: Timestamp) {
        self.record(id).armed = Some(now);
        self.has_flown = true;
    }

    pub(super) fn disarmed(&mut self, id: NodeId, now: Timestamp) {
        self.record(id).disarmed = Some(now);
        self.traffic.end(self.index(id));
        self.milestones.landed();
    }

    /// One of a node's actors is restarted.
    pub(super) fn restarts(&mut self, id: NodeId, now: Timestamp, actor: Address) {
        self.history.happens(now, id, Incident::Restarts(actor));
        self.record(id).restarts += 1;
    }

    /// A node's process has ended, and is to be started again.
    pub(super) fn stopped(&mut self, id: NodeId, now: Timestamp) {
        self.history.happens(now, id, Incident::Stopped);
        self.traffic.cut_off(self.index(id));
    }

    /// A node's process has been restarted.
    pub(super) fn rebooted(&mut self, id: NodeId, now: Timestamp) {
        self.history.happens(now, id, Incident::Rebooted);
        let record = self.record(id);
        record.reboots += 1;
        record.killed = None;
    }

    /// One of a node's actors could not be kept alive.
    pub(super) fn given_up(&mut self, id: NodeId, now: Timestamp, actor: Address) {
        self.history.happens(now, id, Incident::GivenUp(actor));
        self.record(id).given_up = true;
    }

    pub(super) fn killed(&mut self, id: NodeId, now: Timestamp) {
        self.history.happens(now, id, Incident::Killed);
        self.traffic.cut_off(self.index(id));
        self.record(id).killed = Some(now);
    }

    pub(super) fn ran_empty(&mut self, id: NodeId, now: Timestamp) {
        self.history.happens(now, id, Incident::RanEmpty);
        self.record(id).ran_empty = true;
    }

    pub(super) fn fell(&mut self, id: NodeId, now: Timestamp) {
        self.history.happens(now, id, Incident::Fell);
        let record = self.record(id);
        record.killed = Some(now);
        record.fell = true;
    }

    /// An actor hangs, or a whole process (`None`).
    pub(super) fn hangs(&mut self, id: NodeId, now: Timestamp, actor: Option<Address>) {
        self.history.happens(now, id, Incident::Hangs(actor));
    }

    pub(super) fn resumed(&mut self, id: NodeId, now: Timestamp) {
        self.history.happens(now, id, Incident::Resumed);
    }

    /// A fault of the plan is injected.
    pub(super) fn injected(&mut self, fault: InjectedFault) {
        self.history.injected(fault);
    }

    /// The swarm's links or segments have changed.
    pub(super) fn looked(&mut self, now: Timestamp, segments: &Segments) {
        self.history.looked(now, self.nodes.len(), segments);
    }

    /// The masters of all segments; `None` if some have none or several. Returns whether an election has settled by that.
    pub(super) fn masters(&mut self, now: Timestamp, masters: Option<BTreeSet<NodeId>>) -> bool {
        self.elections.masters(now, masters)
    }

    /// A drone's mission reports an event.
    pub(super) fn mission(&mut self, now: Timestamp, id: NodeId, event: &mission::Event) {
        match *event {
            mission::Event::State(state) => {
                let sent = self.traffic.total();
                let record = self.record(id);
                let before = record.states.last().map(|(_, state)| *state);
                record.states.push((now, state));
                let leader = self.leader_of(id);
                if self.is_landing(id) {
                    self.record(id).landed_under.get_or_insert(leader);
                }
                if is_in_discovery_or_beyond(state) {
                    self.traffic.begin(self.index(id));
                }
                if state == State::Independent {
                    self.history.happens(now, id, Incident::Leaves);
                }
                self.milestones.enters(now, before, state, sent);
            }
            mission::Event::LeftLockstep => {
                self.history.happens(now, id, Incident::LeavesLockstep);
            }
            mission::Event::Landing(reason) => {
                self.history.happens(now, id, Incident::Lands(reason));
                self.record(id).reason = Some(reason);
            }
            mission::Event::Follows(ballot) => {
                self.history.happens(now, id, Incident::Follows(ballot));
                self.record(id).leader = Some(ballot.master);
                if ballot.is_elected() && ballot.master == id {
                    self.elections.led(now);
                }
            }
            mission::Event::AgentFailed(ref what) => self.agents.failed(now, id, what),
            mission::Event::Observed(ref observed) => self.agents.observes(now, id, observed),
            _ => {}
        }
    }

    /// A node's routing reports an event.
    pub(super) fn routing(&mut self, now: Timestamp, id: NodeId, event: &routing::Event) {
        let routes = match event {
            routing::Event::Routes(routes) => routes,
            routing::Event::Left => return self.record(id).has_left = true,
            _ => return,
        };
        let what = Incident::Routes {
            hops: routes.hops,
            parent: routes.parent,
            relay: routes.relay,
        };
        self.history.happens(now, id, what);
        // Once the leader goes to land, routes to it break; the last one before counts.
        if !self.is_landing(self.leader_of(id)) {
            let record = self.record(id);
            if routes.hops.is_some() || record.routes.hops.is_none() {
                record.routes = routes.clone();
            }
        }
    }

    /// The links of the swarm, looked at from outside.
    pub(super) fn links(&mut self, links: impl Iterator<Item = (NodeId, NodeId)>) {
        for (a, b) in links {
            if self.takes_part(a) && self.takes_part(b) {
                self.contact.connect(self.index(a), self.index(b));
            }
        }
    }

    /// A node's radio reports an event.
    pub(super) fn radio(&mut self, event: &radio::Event) {
        if let radio::Event::Dropped(reason) = event {
            self.traffic.dropped(*reason);
        }
    }

    /// Loads what changes with each frame, as
    /// [`NodeMachine::read_ahead`](muster_machines::node::NodeMachine::read_ahead) does.
    pub(super) fn read_ahead(&self, id: NodeId) {
        self.traffic.read_ahead(self.index(id));
    }

    fn index(&self, id: NodeId) -> usize {
        (id.0 - self.first.0) as usize
    }

    fn record(&mut self, id: NodeId) -> &mut Record {
        let index = self.index(id);
        &mut self.nodes[index]
    }
}

/// Incident was recorded.
impl Recorder {
    /// The drone at the centre slot, which leads.
    pub(crate) const fn centre(&self) -> NodeId {
        self.centre
    }

    /// The drones, by the world's numbers.
    pub(crate) fn drones(&self) -> impl Iterator<Item = (NodeId, &Record)> {
        self.nodes().take(self.drones)
    }

    /// The relays, by the world's numbers.
    pub(crate) fn relays(&self) -> impl Iterator<Item = (NodeId, &Record)> {
        self.nodes().skip(self.drones)
    }

    fn nodes(&self) -> impl Iterator<Item = (NodeId, &Record)> {
        (self.first.0..).map(NodeId).zip(&self.nodes)
    }

    /// The record of a drone or relay.
    pub(crate) fn of(&self, id: NodeId) -> &Record {
        &self.nodes[self.index(id)]
    }

    /// The traffic of a drone or relay.
    pub(crate) fn traffic(&self, id: NodeId) -> Traffic {
        self.traffic.of(self.index(id))
    }

    /// A drone's present state.
    pub(crate) fn state(&self, id: NodeId) -> State {
        self.of(id).state()
    }

    /// The waits at waypoints.
    pub(crate) const fn barriers(&self) -> &BTreeMap<u16, Crossing> {
        &self.milestones.barriers
    }

    /// The changes of formation, by their numbers.
    pub(crate) const fn changes(&self) -> &BTreeMap<u16, Change> {
        &self.milestones.changes
    }

    /// The drone that a drone followed last, which may be itself.
    pub(crate) fn leader_of(&self, id: NodeId) -> NodeId {
        self.of(id).leader.unwrap_or(self.centre)
    }

    /// Drones out of their leader's range that have a route to it, and the neighbour of the leader on that route.
    pub(crate) fn bridged(&self) -> impl Iterator<Item = (NodeId, NodeId)> + '_ {
        let away = self
            .drones()
            .filter(|(id, record)| record.routes.out_of_range && self.leader_of(*id) != *id);
        away.filter_map(|(id, _)| Some((id, self.bridge_of(id)?)))
    }

    fn bridge_of(&self, id: NodeId) -> Option<NodeId> {
        let leader = self.leader_of(id);
        let mut at = id;
        // Routes that were recorded at different times may form a loop.
        for _ in 0..self.nodes.len() {
            match self.of(at).routes.parent? {
                parent if parent == leader => return Some(at),
                parent => at = parent,
            }
        }
        None
    }

    /// The drones that reached a waypoint, in groups that no link ever connected during the mission.
    pub(crate) fn groups(&self) -> Vec<Vec<NodeId>> {
        let mut groups: BTreeMap<usize, Vec<NodeId>> = BTreeMap::new();
        for (id, _) in self.drones().filter(|(_, record)| record.waypoints() > 0) {
            let group = self.contact.group(self.index(id));
            groups.entry(group).or_default().push(id);
        }
        groups.into_values().collect()
    }

    /// Whether a drone flies the mission, from its slot until it goes to land; a relay always does.
    fn takes_part(&self, id: NodeId) -> bool {
        self.index(id) >= self.drones || is_in_discovery_or_beyond(self.state(id))
    }

    /// Frames that radios did not admit, by reason.
    pub(crate) const fn dropped(&self) -> &BTreeMap<DropReason, u64> {
        self.traffic.drops_by_reason()
    }

    pub(crate) const fn history(&self) -> &History {
        &self.history
    }

    pub(crate) fn elections(&self) -> &[Election] {
        self.elections.all()
    }

    /// How many waypoints the drones have reached so far; take-offs and landings count as one each.
    pub(super) const fn steps_done(&self) -> u64 {
        self.milestones.steps_done()
    }

    /// Whether any of the swarm has been in the air.
    pub(super) const fn has_flown(&self) -> bool {
        self.has_flown
    }

    /// Whether some of the swarm have no master at present, or several.
    pub(super) fn is_electing(&self) -> bool {
        self.elections.is_open()
    }

    /// Restarts of a node's actors and process so far.
    pub(super) fn restarts_of(&self, id: NodeId) -> u32 {
        let record = self.of(id);
        record.restarts + record.reboots
    }

    /// Whether a drone has been given up, was killed or has finished.
    pub(super) fn is_out(&self, id: NodeId) -> bool {
        let record = self.of(id);
        record.given_up || record.killed.is_some() || record.state() == State::Finished
    }

    fn is_landing(&self, id: NodeId) -> bool {
        matches!(
            self.state(id),
            State::MovingToLand | State::Landing | State::Finished
        )
    }
}
