//! A swarm of routings over a network with losses, delays and duplicates.

use std::collections::BTreeMap;
use std::time::Duration;

use bytes::Bytes;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::identity::{Ballot, NodeId};
use crate::machine::{Emitted, Stimulus, step};
use crate::routing::{
    Config, Destination, Event, Input, Notice, Outcome, Outgoing, Reliability, Routing, Transmit,
    flood, tree,
};
use crate::time::Timestamp;
use crate::wire;

/// What the network does to frames.
#[derive(Debug, Clone, Copy)]
pub(super) struct Faults {
    /// Probability that a receiver loses a frame.
    pub(super) loss: f64,
    /// Probability that a receiver gets it twice.
    pub(super) duplicate: f64,
    /// Longest delay; frames that are sent later may arrive earlier.
    pub(super) delay: Duration,
    /// Whether the network repeats unicasts and reports their delivery.
    pub(super) reports: bool,
}

impl Faults {
    pub(super) const NONE: Self = Self {
        loss: 0.0,
        duplicate: 0.0,
        delay: Duration::from_millis(1),
        reports: false,
    };

    pub(super) const fn loss(loss: f64) -> Self {
        Self { loss, ..Self::NONE }
    }
}

pub(super) struct Node {
    routing: Option<Routing>,
    deadline: Option<Timestamp>,
    /// Messages that the protocol got, with their origin and time.
    pub(super) got: Vec<(NodeId, Bytes, Timestamp)>,
    pub(super) outcomes: Vec<(u32, Outcome)>,
    pub(super) ignored: usize,
    /// Number of message frames sent.
    pub(super) sent: usize,
    /// Number of frames sent.
    pub(super) frames: usize,
    /// Number of notices that the protocol got, but for those of messages.
    pub(super) notices: usize,
}

enum Flight {
    Frame(Input),
    Report {
        payload: Bytes,
        to: NodeId,
        delivered: bool,
    },
}

/// Nodes, and which hear each other.
pub(super) struct Net {
    pub(super) nodes: Vec<Node>,
    pub(super) now: Timestamp,
    pub(super) faults: Faults,
    flights: BTreeMap<(Timestamp, u64), (usize, Flight)>,
    count: u64,
    rng: ChaCha8Rng,
    /// Whether two nodes hear each other.
    hears: Vec<Vec<bool>>,
    config: fn(u32, u32) -> Config,
}

pub(super) fn tree_config(id: u32, drones: u32) -> Config {
    Config::Tree(tree::Config {
        id: NodeId(id),
        drones,
        relays: 0,
        heartbeat_period: Duration::from_secs(1),
        landing_period: Duration::from_secs(4),
        repair: Duration::from_millis(8),
        repair_max: Duration::from_millis(200),
        link_time_to_live: Duration::from_secs(5),
        time_to_live: Duration::from_secs(10),
        route_timeout: Duration::from_secs(10),
    })
}

pub(super) fn flood_config(id: u32, drones: u32) -> Config {
    Config::Flood(flood::Config {
        id: NodeId(id),
        drones,
        period: Duration::from_millis(200),
        keep_alive: Duration::from_secs(1),
        hello_period: Duration::from_millis(500),
        discovery: Duration::from_secs(4),
        stable_after: 3,
        hello_gap: Duration::from_millis(750),
        time_to_live: Duration::from_secs(5),
        monitors_before_routes: false,
    })
}

pub(super) const fn leader(term: u32, id: u32) -> Ballot {
    Ballot {
        term,
        rank: id,
        master: NodeId(id),
    }
}

impl Net {
    /// Nodes in a line, each of which hears the next `reach` ones; node 0 leads. Routes are up.
    pub(super) fn line(
        count: u32,
        reach: usize,
        config: fn(u32, u32) -> Config,
        seed: u64,
    ) -> Self {
        let nodes = (0..count).map(|id| Node {
            routing: Some(Routing::new(
                config(id, count),
                seed + u64::from(id),
                Timestamp::ZERO,
                None,
            )),
            deadline: None,
            got: Vec::new(),
            outcomes: Vec::new(),
            ignored: 0,
            sent: 0,
            frames: 0,
            notices: 0,
        });
        let near = |a: usize, b: usize| a != b && a.abs_diff(b) <= reach;
        let size = count as usize;
        let mut net = Self {
            nodes: nodes.collect(),
            now: Timestamp::ZERO,
            faults: Faults::NONE,
            flights: BTreeMap::new(),
            count: 0,
            rng: ChaCha8Rng::seed_from_u64(seed),
            hears: (0..size)
                .map(|a| (0..size).map(|b| near(a, b)).collect())
                .collect(),
            config,
        };
        (0..size).for_each(|at| net.stimulate(at, Stimulus::Timeout));
        net.input(0, Input::Lead(leader(1, 0)));
        net.input(0, Input::Discover);
        net.run(Duration::from_secs(12));
        net
    }

    pub(super) fn input(&mut self, at: usize, input: Input) {
        self.stimulate(at, Stimulus::Input(input));
    }

    pub(super) fn send(&mut self, at: usize, id: u32, to: Destination, payload: &[u8]) {
        self.submit(at, id, to, Reliability::Acknowledged, payload);
    }

    pub(super) fn submit(
        &mut self,
        at: usize,
        id: u32,
        to: Destination,
        reliability: Reliability,
        payload: &[u8],
    ) {
        let payload = Bytes::copy_from_slice(payload);
        self.input(
            at,
            Input::Messages(vec![Outgoing {
                id,
                to,
                reliability,
                payload,
            }]),
        );
    }

    fn stimulate(&mut self, at: usize, stimulus: Stimulus<Input>) {
        let mut sends = Vec::new();
        let node = &mut self.nodes[at];
        let Some(routing) = &mut node.routing else {
            return;
        };
        let now = self.now;
        let is_timeout = stimulus == Stimulus::Timeout;
        let deadline = step(routing, now, stimulus, |emitted| match emitted {
            Emitted::Transmit(Transmit::Send {
                to,
                ballot,
                payload,
                ..
            }) => sends.push((to, ballot, Bytes::from(payload))),
            Emitted::Transmit(Transmit::Inform(Notice::Message { from, payload })) => {
                node.got.push((from, payload, now));
            }
            Emitted::Transmit(Transmit::Inform(Notice::Sent(sent))) => {
                node.outcomes.extend(sent);
            }
            Emitted::Transmit(Transmit::Inform(_)) => node.notices += 1,
            Emitted::Event(Event::Ignored(_)) => node.ignored += 1,
            _ => {}
        });
        assert!(
            !is_timeout || deadline.is_none_or(|due| due > now),
            "{at} is overdue"
        );
        node.deadline = deadline;
        for (to, ballot, payload) in sends {
            assert!(payload.len() <= wire::PAYLOAD_MAX);
            self.nodes[at].sent += usize::from(wire::is_message(&payload));
            self.nodes[at].frames += 1;
            // Frames for the radios do not reach the routing.
            if wire::decode_radio_packet(&payload).is_none() {
                self.fly(at, to, ballot, &payload);
            }
        }
    }

    fn fly(&mut self, at: usize, to: Option<NodeId>, ballot: Ballot, payload: &Bytes) {
        let tries = if to.is_some() && self.faults.reports {
            8
        } else {
            1
        };
        let mut delivered = false;
        for receiver in 0..self.nodes.len() {
            let is_addressed = to.is_none_or(|to| to.0 as usize == receiver);
            if !self.hears[at][receiver] || !is_addressed {
                continue;
            }
            let arrives = (0..tries).any(|_| !self.rng.random_bool(self.faults.loss));
            delivered |= arrives;
            let copies = 1 + u32::from(self.rng.random_bool(self.faults.duplicate));
            for _ in 0..copies * u32::from(arrives) {
                let input = Input::Received {
                    sender: NodeId(at as u32),
                    ballot,
                    payload: payload.clone(),
                };
                self.schedule(receiver, Flight::Frame(input));
            }
        }
        if let Some(to) = to.filter(|_| self.faults.reports) {
            let payload = payload.clone();
            self.schedule(
                at,
                Flight::Report {
                    payload,
                    to,
                    delivered,
                },
            );
        }
    }

    fn schedule(&mut self, receiver: usize, flight: Flight) {
        let micros = 300
            + self
                .rng
                .random_range(0..=self.faults.delay.as_micros() as u64);
        self.count += 1;
        let at = self.now + Duration::from_micros(micros);
        self.flights.insert((at, self.count), (receiver, flight));
    }

    /// Lets time pass.
    pub(super) fn run(&mut self, time: Duration) {
        let end = self.now + time;
        loop {
            let timer = (0..self.nodes.len()).filter_map(|at| Some((self.nodes[at].deadline?, at)));
            let timer = timer.min();
            let flight = self.flights.first_key_value().map(|((at, _), _)| *at);
            let next = timer.map(|(at, _)| at).into_iter().chain(flight).min();
            let Some(next) = next.filter(|next| *next <= end) else {
                break;
            };
            self.now = next;
            if flight == Some(next)
                && let Some((_, (receiver, flight))) = self.flights.pop_first()
            {
                let input = match flight {
                    Flight::Frame(input) => input,
                    Flight::Report {
                        payload,
                        to,
                        delivered,
                    } => Input::Delivery {
                        to,
                        payload,
                        delivered,
                    },
                };
                self.input(receiver, input);
            } else if let Some((_, at)) = timer {
                self.nodes[at].deadline = None;
                self.stimulate(at, Stimulus::Timeout);
            }
        }
        self.now = end;
    }

    /// The node fails: it neither sends nor receives.
    pub(super) fn kill(&mut self, at: usize) {
        self.nodes[at].routing = None;
        self.nodes[at].deadline = None;
    }

    /// The node's routing is built again, without a checkpoint.
    pub(super) fn restart(&mut self, at: usize) {
        let config = (self.config)(at as u32, self.nodes.len() as u32);
        let seed = self.rng.random();
        self.nodes[at].routing = Some(Routing::new(config, seed, self.now, None));
        self.stimulate(at, Stimulus::Timeout);
    }

    /// Cuts or restores the link between two nodes.
    pub(super) fn connect(&mut self, a: usize, b: usize, is_connected: bool) {
        self.hears[a][b] = is_connected;
        self.hears[b][a] = is_connected;
    }

    pub(super) fn occupancy(&self, at: usize) -> (usize, usize) {
        self.nodes[at]
            .routing
            .as_ref()
            .map_or((0, 1), Routing::occupancy)
    }

    /// Payloads that a node got.
    pub(super) fn payloads(&self, at: usize) -> Vec<Bytes> {
        self.nodes[at]
            .got
            .iter()
            .map(|(_, it, _)| it.clone())
            .collect()
    }
}
