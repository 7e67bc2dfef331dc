//! Records of a swarm's flight.

mod elections;
mod history;
mod milestones;
mod record;

use std::collections::{BTreeMap, BTreeSet};
use std::hint::black_box;

use muster_machines::identity::NodeId;
use muster_machines::mission::{self, State};
use muster_machines::node::Address;
use muster_machines::radio::{self, DropReason};
use muster_machines::routing;
use muster_machines::time::Timestamp;

pub(crate) use self::elections::Election;
use self::elections::Elections;
pub(crate) use self::history::{History, Incident, InjectedFault, LINKED_NODES_MAX};
use self::milestones::Milestones;
pub(crate) use self::milestones::{Change, Crossing};
pub(crate) use self::record::Record;
use self::record::is_in_discovery_or_beyond;
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
    traffic: Vec<Traffic>,
    milestones: Milestones,
    elections: Elections,
    /// Members out of the master's range, and the neighbour that relays their acknowledgements to it.
    out_of_range: BTreeMap<NodeId, NodeId>,
    frames: Frames,
    dropped: BTreeMap<DropReason, u64>,
    has_flown: bool,
    history: History,
}

/// Frames sent by all nodes of a swarm.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Frames {
    /// Sent because of a change or a loss.
    pub(crate) news: u64,
    /// Sent because a period elapsed.
    pub(crate) keep_alives: u64,
    /// Sent again by the medium without an acknowledgement; of all swarms.
    pub(crate) retries: u64,
}

/// Frames sent and admitted from the start of neighbour discovery to the end of the landing; by a relay, all.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Traffic {
    pub(crate) sent: u64,
    pub(crate) received: u64,
    /// Whether frames count at present.
    counts: bool,
}

impl Recorder {
    /// For this many drones, and this many drones and relays, numbered from `first` on.
    pub(super) fn new(first: NodeId, (drones, nodes): (u32, u32), centre: NodeId) -> Self {
        let (drones, nodes) = (drones as usize, nodes as usize);
        let traffic = |node| Traffic {
            // A relay works from the start.
            counts: node >= drones,
            ..Traffic::default()
        };
        Self {
            first,
            centre,
            drones,
            nodes: vec![Record::new(); nodes],
            traffic: (0..nodes).map(traffic).collect(),
            milestones: Milestones::default(),
            elections: Elections::default(),
            out_of_range: BTreeMap::new(),
            frames: Frames::default(),
            dropped: BTreeMap::new(),
            has_flown: false,
            history: History::default(),
        }
    }
}

/// Incident happens.
impl Recorder {
    /// A node sends a frame.
    pub(super) fn sent(&mut self, id: NodeId, keep_alive: bool) {
        if keep_alive {
            self.frames.keep_alives += 1;
        } else {
            self.frames.news += 1;
        }
        let traffic = self.traffic_mut(id);
        traffic.sent += u64::from(traffic.counts);
    }

    /// A node admits a frame.
    pub(super) fn received(&mut self, id: NodeId) {
        let traffic = self.traffic_mut(id);
        traffic.received += u64::from(traffic.counts);
    }

    /// How often the medium has sent a frame again so far.
    pub(super) const fn retried(&mut self, retries: u64) {
        self.frames.retries = retries;
    }

    pub(super) fn armed(&mut self, id: NodeId, now: Timestamp) {
        self.record(id).armed = Some(now);
        self.has_flown = true;
    }

    pub(super) fn disarmed(&mut self, id: NodeId, now: Timestamp) {
        self.record(id).disarmed = Some(now);
        self.traffic_mut(id).counts = false;
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
                let sent = self.frames;
                let record = self.record(id);
                let before = record.states.last().map(|(_, state)| *state);
                record.states.push((now, state));
                self.traffic_mut(id).counts |= is_in_discovery_or_beyond(state);
                self.milestones.enters(now, before, state, sent);
            }
            mission::Event::Landing(reason) => {
                self.history.happens(now, id, Incident::Lands(reason));
                self.record(id).reason = Some(reason);
            }
            mission::Event::Obeys(ballot) => {
                self.history.happens(now, id, Incident::Follows(ballot));
                if ballot.is_elected() && ballot.master == id {
                    self.elections.led(now);
                }
            }
            _ => {}
        }
    }

    /// A node's routing reports an event.
    pub(super) fn routing(&mut self, now: Timestamp, id: NodeId, event: &routing::Event) {
        if let routing::Event::Routes(routes) = event {
            let what = Incident::Routes {
                hops: routes.hops,
                parent: routes.parent,
                relay: routes.relay,
            };
            self.history.happens(now, id, what);
        }
        match event {
            // Once the master goes to land, routes to it break; the last one before counts.
            routing::Event::Routes(routes) if !self.is_landing(self.centre) => {
                let record = self.record(id);
                if routes.hops.is_some() || record.routes.hops.is_none() {
                    record.routes = routes.clone();
                }
            }
            routing::Event::Reached {
                member,
                via,
                out_of_range: true,
            } => {
                self.out_of_range.insert(*member, *via);
            }
            routing::Event::Reached { member, .. } => {
                self.out_of_range.remove(member);
            }
            _ => {}
        }
    }

    /// A node's radio reports an event.
    pub(super) fn radio(&mut self, event: &radio::Event) {
        if let radio::Event::Dropped(reason) = event {
            *self.dropped.entry(*reason).or_default() += 1;
        }
    }

    /// Loads what changes with each frame, as
    /// [`NodeMachine::read_ahead`](muster_machines::node::NodeMachine::read_ahead) does.
    pub(super) fn read_ahead(&self, id: NodeId) {
        black_box(self.traffic(id).counts);
    }

    fn traffic_mut(&mut self, id: NodeId) -> &mut Traffic {
        &mut self.traffic[(id.0 - self.first.0) as usize]
    }

    fn record(&mut self, id: NodeId) -> &mut Record {
        &mut self.nodes[(id.0 - self.first.0) as usize]
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
        &self.nodes[(id.0 - self.first.0) as usize]
    }

    /// The traffic of a drone or relay.
    pub(crate) fn traffic(&self, id: NodeId) -> Traffic {
        self.traffic[(id.0 - self.first.0) as usize]
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

    /// Members that the master knows to be out of its range, and the neighbour through which it hears of each.
    pub(crate) fn out_of_range(&self) -> impl Iterator<Item = (NodeId, NodeId)> + '_ {
        self.out_of_range
            .iter()
            .map(|(member, via)| (*member, *via))
    }

    /// Frames that radios did not admit, by reason.
    pub(crate) const fn dropped(&self) -> &BTreeMap<DropReason, u64> {
        &self.dropped
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
