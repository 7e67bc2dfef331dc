use std::collections::{BTreeMap, BTreeSet};
use std::hint::black_box;

use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;
use muster_machines::mission::{self, LandingReason, State};
use muster_machines::radio::{self, DropReason};
use muster_machines::routing::{self, Routes};
use muster_machines::time::Timestamp;

use super::Injection;
use crate::checkers::Violation;
use muster_runtime::vehicle::Vehicle;

/// What is written down of a swarm's flight, drone by drone.
#[derive(Debug)]
pub(crate) struct Recorder {
    /// The swarm's drone 0.
    first: NodeId,
    centre: NodeId,
    /// Of drones first, then of relays.
    nodes: Vec<Record>,
    /// Of the same: apart from all else, for it changes with each frame.
    traffic: Vec<Traffic>,
    drones: usize,
    barriers: BTreeMap<u16, Crossing>,
    changes: BTreeMap<u16, Change>,
    /// Members that the master knows to be out of its range, and the neighbour that it hears of them through.
    out_of_range: BTreeMap<NodeId, NodeId>,
    frames: Frames,
    elections: Vec<Election>,
    dropped: BTreeMap<DropReason, u64>,
    steps_done: u64,
    has_flown: bool,
}

/// What has been sent, by anyone.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Frames {
    /// Because something has changed or was missed.
    pub(crate) news: u64,
    /// Only because the time for it had come.
    pub(crate) keep_alives: u64,
    /// Once more, by the medium, for want of an acknowledgement.
    pub(crate) retries: u64,
}

/// What is written down of one drone.
#[derive(Debug, Clone)]
pub(crate) struct Record {
    pub(crate) states: Vec<(Timestamp, State)>,
    /// Its ways, as they were until the master went to land.
    pub(crate) routes: Routes,
    pub(crate) reason: Option<LandingReason>,
    pub(crate) given_up: bool,
    /// When its companion computer died, or the aircraft fell.
    pub(crate) killed: Option<Timestamp>,
    /// Whether its battery is empty.
    pub(crate) ran_empty: bool,
    pub(crate) fell: bool,
    pub(crate) restarts: u32,
    /// How often its process started anew.
    pub(crate) reboots: u32,
    pub(crate) armed: Option<Timestamp>,
    pub(crate) disarmed: Option<Timestamp>,
}

/// Frames sent and let in between the start of neighbour discovery and the end of the landing; of a relay, all.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Traffic {
    pub(crate) sent: u64,
    pub(crate) received: u64,
    /// Whether it is that time.
    counts: bool,
}

/// A swarm's wait at a waypoint: its first arrival, its last and the last departure, with the frames sent until then.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Crossing {
    pub(crate) begun: Option<Frames>,
    pub(crate) arrived: Option<Timestamp>,
    pub(crate) moving: Option<(Timestamp, Frames)>,
}

/// A change of formation: when the first drone began it, when the last was done, and how many were.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Change {
    pub(crate) begun: Timestamp,
    pub(crate) done: Option<Timestamp>,
    pub(crate) drones: u32,
}

/// A time in which some of the swarm had no master, or several: until when, and who led then.
#[derive(Debug, Clone)]
pub(crate) struct Election {
    pub(crate) begun: Timestamp,
    /// When somebody first led that was elected meanwhile.
    pub(crate) led: Option<Timestamp>,
    pub(crate) settled: Option<(Timestamp, BTreeSet<NodeId>)>,
}

/// All that came of a run.
#[derive(Debug)]
pub(crate) struct Outcome {
    pub(crate) trace: String,
    pub(crate) ended: Timestamp,
    pub(crate) closest_m: Option<f64>,
    pub(crate) violations: Vec<Violation>,
    /// What the faults of the plan met, in the order in which they befell.
    pub(crate) struck: Vec<Injection>,
    /// What the radios did, on a medium that they share.
    pub(crate) medium: muster_transport::sim::Counters,
    /// The scenario's own swarm first.
    pub(crate) swarms: Vec<Flown>,
}

/// What came of a swarm's flight.
#[derive(Debug)]
pub(crate) struct Flown {
    pub(crate) recorder: Recorder,
    /// Of drones first, then of relays.
    pub(crate) vehicles: Vec<Vehicle>,
}

impl Recorder {
    /// Of so many drones, and so many drones and relays, numbered from `first` on.
    pub(crate) fn new(first: NodeId, (drones, nodes): (u32, u32), centre: NodeId) -> Self {
        let record = Record {
            states: vec![(Timestamp::ZERO, State::Start)],
            routes: Routes::default(),
            reason: None,
            given_up: false,
            killed: None,
            ran_empty: false,
            fell: false,
            restarts: 0,
            reboots: 0,
            armed: None,
            disarmed: None,
        };
        let (drones, nodes) = (drones as usize, nodes as usize);
        let traffic = |node| Traffic {
            // A relay is at work from the start.
            counts: node >= drones,
            ..Traffic::default()
        };
        Self {
            first,
            centre,
            nodes: vec![record; nodes],
            traffic: (0..nodes).map(traffic).collect(),
            drones,
            barriers: BTreeMap::new(),
            changes: BTreeMap::new(),
            out_of_range: BTreeMap::new(),
            frames: Frames::default(),
            elections: Vec::new(),
            dropped: BTreeMap::new(),
            steps_done: 0,
            has_flown: false,
        }
    }

    /// The drone at the centre slot, which leads.
    pub(crate) const fn centre(&self) -> NodeId {
        self.centre
    }

    /// Each drone, as the world numbers them.
    pub(crate) fn drones(&self) -> impl Iterator<Item = (NodeId, &Record)> {
        self.nodes().take(self.drones)
    }

    /// Likewise each relay.
    pub(crate) fn relays(&self) -> impl Iterator<Item = (NodeId, &Record)> {
        self.nodes().skip(self.drones)
    }

    fn nodes(&self) -> impl Iterator<Item = (NodeId, &Record)> {
        (self.first.0..).map(NodeId).zip(&self.nodes)
    }

    pub(crate) const fn barriers(&self) -> &BTreeMap<u16, Crossing> {
        &self.barriers
    }

    pub(crate) const fn changes(&self) -> &BTreeMap<u16, Change> {
        &self.changes
    }

    /// The master's own view of who is out of its range, and through whom it hears of them.
    pub(crate) fn out_of_range(&self) -> impl Iterator<Item = (NodeId, NodeId)> + '_ {
        self.out_of_range
            .iter()
            .map(|(member, via)| (*member, *via))
    }

    pub(crate) const fn dropped(&self) -> &BTreeMap<DropReason, u64> {
        &self.dropped
    }

    /// How many waypoints the drones have reached so far, take-offs and landings counted as one each.
    pub(crate) const fn steps_done(&self) -> u64 {
        self.steps_done
    }

    pub(crate) fn sent(&mut self, id: NodeId, keep_alive: bool) {
        if keep_alive {
            self.frames.keep_alives += 1;
        } else {
            self.frames.news += 1;
        }
        let traffic = self.traffic_mut(id);
        traffic.sent += u64::from(traffic.counts);
    }

    /// Reads what changes with each frame, as [`Cell::read_ahead`](muster_machines::node::Cell::read_ahead) does.
    pub(super) fn read_ahead(&self, id: NodeId) {
        black_box(self.traffic[(id.0 - self.first.0) as usize].counts);
    }

    pub(crate) fn received(&mut self, id: NodeId) {
        let traffic = self.traffic_mut(id);
        traffic.received += u64::from(traffic.counts);
    }

    /// How often the medium has sent a frame again so far.
    pub(crate) const fn retried(&mut self, retries: u64) {
        self.frames.retries = retries;
    }

    pub(crate) fn armed(&mut self, id: NodeId, now: Timestamp) {
        self.record(id).armed = Some(now);
        self.has_flown = true;
    }

    /// Whether any of the swarm has been in the air.
    pub(crate) const fn has_flown(&self) -> bool {
        self.has_flown
    }

    pub(crate) fn disarmed(&mut self, id: NodeId, now: Timestamp) {
        let record = self.record(id);
        record.disarmed = Some(now);
        self.traffic_mut(id).counts = false;
        self.steps_done += 1;
    }

    pub(crate) fn restarts(&mut self, id: NodeId) {
        self.record(id).restarts += 1;
    }

    /// Its process is there again.
    pub(crate) fn rebooted(&mut self, id: NodeId) {
        let record = self.record(id);
        record.reboots += 1;
        record.killed = None;
    }

    pub(crate) fn given_up(&mut self, id: NodeId) {
        self.record(id).given_up = true;
    }

    /// Whether each part has a master now, and who they are; whether an election has just ended by that.
    pub(crate) fn election(&mut self, now: Timestamp, masters: Option<BTreeSet<NodeId>>) -> bool {
        let open = self.elections.last_mut().filter(|it| it.settled.is_none());
        match (open, masters) {
            (Some(election), Some(masters)) => {
                election.settled = Some((now, masters));
                return true;
            }
            (None, None) => self.elections.push(Election {
                begun: now,
                led: None,
                settled: None,
            }),
            (Some(_), None) | (None, Some(_)) => {}
        }
        false
    }

    /// Whether some of the swarm has no master by now, or several.
    pub(crate) fn is_electing(&self) -> bool {
        self.elections.last().is_some_and(|it| it.settled.is_none())
    }

    pub(crate) fn elections(&self) -> &[Election] {
        &self.elections
    }

    /// How often actors of a node, or its process, were restarted so far.
    pub(crate) fn restarts_of(&self, id: NodeId) -> u32 {
        let record = self.of(id);
        record.restarts + record.reboots
    }

    /// What a drone does.
    pub(crate) fn state(&self, id: NodeId) -> State {
        let last = self.of(id).states.last();
        last.map(|(_, state)| *state).unwrap_or_default()
    }

    pub(crate) fn killed(&mut self, id: NodeId, now: Timestamp) {
        self.record(id).killed = Some(now);
    }

    pub(crate) fn ran_empty(&mut self, id: NodeId) {
        self.record(id).ran_empty = true;
    }

    pub(crate) fn fell(&mut self, id: NodeId, now: Timestamp) {
        self.killed(id, now);
        self.record(id).fell = true;
    }

    pub(crate) fn mission(&mut self, now: Timestamp, id: NodeId, event: &mission::Event) {
        match *event {
            mission::Event::State(state) => self.enters(now, id, state),
            mission::Event::Landing(reason) => self.record(id).reason = Some(reason),
            mission::Event::Obeys(ballot) if ballot.is_elected() && ballot.master == id => {
                let open = self.elections.last_mut().filter(|it| it.settled.is_none());
                open.map(|election| election.led.get_or_insert(now));
            }
            _ => {}
        }
    }

    fn enters(&mut self, now: Timestamp, id: NodeId, state: State) {
        let sent = self.frames;
        let record = self.record(id);
        let before = record.states.last().map(|(_, state)| *state);
        record.states.push((now, state));
        self.traffic_mut(id).counts |= is_in_discovery_or_beyond(state);
        if let Some(State::WaypointReached { waypoint }) = before {
            self.barriers.entry(waypoint).or_default().moving = Some((now, sent));
        }
        if let State::ChangingFormation { change, .. } = state {
            self.changes.entry(change).or_insert(Change {
                begun: now,
                done: None,
                drones: 0,
            });
        }
        if let (Some(State::ChangingFormation { change, .. }), State::WaypointReached { .. }) =
            (before, state)
            && let Some(change) = self.changes.get_mut(&change)
        {
            change.done = Some(now);
            change.drones += 1;
        }
        if let State::WaypointReached { waypoint } = state {
            let crossing = self.barriers.entry(waypoint).or_default();
            crossing.begun.get_or_insert(sent);
            crossing.arrived = Some(now);
            self.steps_done += 1;
        }
    }

    pub(crate) fn routing(&mut self, id: NodeId, event: &routing::Event) {
        match event {
            // Once the master goes to land, ways to it come apart; until then the last one counts.
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

    pub(crate) fn radio(&mut self, event: &radio::Event) {
        if let radio::Event::Dropped(reason) = event {
            *self.dropped.entry(*reason).or_default() += 1;
        }
    }

    /// Whether a drone has been given up or is done.
    pub(crate) fn is_out_of_it(&self, id: NodeId) -> bool {
        let record = self.of(id);
        record.given_up || record.killed.is_some() || self.state(id) == State::Finished
    }

    fn is_landing(&self, id: NodeId) -> bool {
        matches!(
            self.state(id),
            State::MovingToLand | State::Landing | State::Finished
        )
    }

    /// What is written down of one of the swarm.
    pub(crate) fn of(&self, id: NodeId) -> &Record {
        &self.nodes[(id.0 - self.first.0) as usize]
    }

    /// What one of the swarm has sent and let in.
    pub(crate) fn traffic(&self, id: NodeId) -> Traffic {
        self.traffic[(id.0 - self.first.0) as usize]
    }

    fn traffic_mut(&mut self, id: NodeId) -> &mut Traffic {
        &mut self.traffic[(id.0 - self.first.0) as usize]
    }

    fn record(&mut self, id: NodeId) -> &mut Record {
        &mut self.nodes[(id.0 - self.first.0) as usize]
    }
}

const fn is_in_discovery_or_beyond(state: State) -> bool {
    matches!(
        state,
        State::NeighbourDiscovery
            | State::HopUpdate
            | State::MovingToWaypoint { .. }
            | State::WaypointReached { .. }
            | State::ChangingFormation { .. }
            | State::Following
            | State::Assembling
    )
}

impl Record {
    /// When neighbour discovery began.
    pub(crate) fn discovery(&self) -> Option<Timestamp> {
        self.states
            .iter()
            .find(|(_, state)| is_in_discovery_or_beyond(*state))
            .map(|(at, _)| *at)
    }

    /// Whether it came down where the swarm lands.
    pub(crate) fn landed_with_the_swarm(&self) -> bool {
        self.reason == Some(LandingReason::MissionOver) && self.killed.is_none()
    }

    /// When it kept formation on a master that it followed, or was that master: from when until when.
    pub(crate) fn following(&self, ended: Timestamp) -> Option<std::ops::Range<Timestamp>> {
        let begins = self
            .states
            .iter()
            .position(|(_, state)| *state == State::Following)?;
        let until = self.states.get(begins + 1).map_or(ended, |(at, _)| *at);
        Some(self.states[begins].0..until)
    }

    /// How many different waypoints it has reached.
    pub(crate) fn waypoints(&self) -> usize {
        let reached = self.states.iter().filter_map(|(_, state)| match state {
            State::WaypointReached { waypoint } => Some(*waypoint),
            _ => None,
        });
        reached.collect::<BTreeSet<_>>().len()
    }

    /// Its own waits at waypoints, from arrival to departure.
    pub(crate) fn waits(&self) -> impl Iterator<Item = std::time::Duration> + '_ {
        self.states
            .windows(2)
            .filter(|pair| matches!(pair[0].1, State::WaypointReached { .. }))
            .map(|pair| pair[1].0 - pair[0].0)
    }
}

/// Where a vehicle was, at least each second and wherever it turned, from arming to disarming.
pub(crate) fn track(vehicle: &Vehicle, record: &Record, ended: Timestamp) -> Vec<(Timestamp, Ned)> {
    let (Some(from), to) = (record.armed, record.disarmed.unwrap_or(ended)) else {
        return vec![(Timestamp::ZERO, vehicle.motion().position(Timestamp::ZERO))];
    };
    let second = std::time::Duration::from_secs(1);
    let each_second =
        std::iter::successors(Some(from), |at| Some(*at + second)).take_while(|at| *at < to);
    let turns = vehicle.motion().pieces().iter().map(|piece| piece.start);
    let mut instants: Vec<_> = each_second.chain(turns).chain([from, to]).collect();
    instants.sort_unstable();
    instants.dedup();
    instants
        .into_iter()
        .filter(|at| (from..=to).contains(at))
        .map(|at| (at, vehicle.motion().position(at)))
        .collect()
}
