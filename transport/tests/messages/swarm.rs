//! A swarm of radios and routings over the simulated medium, for messages alone: no mission, no flight.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::num::NonZeroUsize;
use std::time::Duration;

use bytes::Bytes;
use muster_machines::geometry::Ned;
use muster_machines::identity::{Ballot, NodeId, SwarmId};
use muster_machines::machine::{Emitted, Stimulus, step};
use muster_machines::radio::{self, Budget, DropReason, IdealAuthenticator, Incarnations, Radio};
use muster_machines::routing::{
    self, Destination, Notice, Outcome, Outgoing, Reliability, Routing, tree,
};
use muster_machines::time::Timestamp;
use muster_transport::sim::{Access, Config, Medium, Propagation};
use muster_transport::{self as transport, Event, Fate, Transport};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// As in `scenarios/barrier-line.toml`.
const SPACING_M: f64 = 160.0;
const RANGE_M: f64 = 300.0;
/// As a plan has it by default.
const BUDGET: Budget = Budget {
    interval: Duration::from_millis(5),
    burst: 64,
};

struct Node {
    radio: Radio<IdealAuthenticator>,
    routing: Routing,
    deadlines: [Option<Timestamp>; 2],
}

/// A message that a drone's protocol got.
#[derive(Debug, Clone)]
pub(crate) struct Got {
    pub(crate) by: NodeId,
    pub(crate) from: NodeId,
    pub(crate) payload: Bytes,
    pub(crate) at: Timestamp,
}

/// The swarm.
pub(crate) struct Swarm {
    nodes: Vec<Node>,
    medium: Medium,
    pub(crate) now: Timestamp,
    /// Events of the medium that lie in the future.
    events: Vec<Option<Event>>,
    order: BinaryHeap<Reverse<(Timestamp, usize)>>,
    pub(crate) got: Vec<Got>,
    pub(crate) outcomes: Vec<(NodeId, u32, Outcome)>,
    /// Frames that radios dropped because their sender was over its budget.
    pub(crate) over_budget: usize,
    /// Frames sent, and their bytes.
    pub(crate) frames: usize,
    pub(crate) bytes: usize,
    next_id: u32,
}

/// 802.11a with Nakagami fading of this shape.
pub(crate) fn fading(shape: f64) -> Config {
    Config {
        propagation: Propagation::Nakagami {
            range_m: RANGE_M,
            shape,
        },
        ..lossy(0.0)
    }
}

/// 802.11a with a fixed range and this share of frames lost.
pub(crate) fn lossy(loss: f64) -> Config {
    Config {
        propagation: Propagation::Range { range_m: RANGE_M },
        loss,
        bursts: None,
        access: Access::Csma {
            jitter: Duration::from_millis(1),
            queue_max: NonZeroUsize::new(64).expect("64 is not 0"),
        },
        datagram_max: muster_machines::wire::DATAGRAM_MAX,
    }
}

/// A network that repeats nothing and reports nothing, as UDP, with this share of frames lost.
pub(crate) fn unreported(loss: f64) -> Config {
    Config {
        access: Access::Ideal {
            latency: Duration::from_micros(500),
            jitter: Duration::from_millis(1),
        },
        ..lossy(loss)
    }
}

impl Swarm {
    /// Drones in a line, led by `leader`, whose routes are up.
    pub(crate) fn line(drones: u32, leader: u32, config: Config, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let places: Vec<Ned> = (0..drones)
            .map(|id| Ned::new(f64::from(id) * SPACING_M, 0.0, -25.0))
            .collect();
        let nodes = (0..drones).map(|id| node(id, drones, rng.random()));
        let mut swarm = Self {
            nodes: nodes.collect(),
            medium: Medium::new(config, ChaCha8Rng::seed_from_u64(seed), &places),
            now: Timestamp::ZERO,
            events: Vec::new(),
            order: BinaryHeap::new(),
            got: Vec::new(),
            outcomes: Vec::new(),
            over_budget: 0,
            frames: 0,
            bytes: 0,
            next_id: 0,
        };
        for id in 0..drones as usize {
            swarm.step_radio(id, Stimulus::Timeout);
            swarm.step_routing(id, Stimulus::Timeout);
        }
        let ballot = Ballot {
            term: 1,
            rank: 0,
            master: NodeId(leader),
        };
        let leader = leader as usize;
        swarm.step_routing(leader, Stimulus::Input(routing::Input::Lead(ballot)));
        swarm.step_routing(leader, Stimulus::Input(routing::Input::Discover));
        swarm.run(Duration::from_secs(30));
        swarm
    }

    /// Sends a message; returns its number.
    pub(crate) fn send(
        &mut self,
        from: u32,
        to: Destination,
        reliability: Reliability,
        payload: Bytes,
    ) -> u32 {
        self.next_id += 1;
        let outgoing = Outgoing {
            id: self.next_id,
            to,
            reliability,
            payload,
        };
        let input = routing::Input::Messages(vec![outgoing]);
        self.step_routing(from as usize, Stimulus::Input(input));
        self.next_id
    }

    /// Lets time pass.
    pub(crate) fn run(&mut self, time: Duration) {
        let end = self.now + time;
        while self.run_next(end) {}
        self.now = end;
    }

    /// Handles the next event by `end`; returns whether there was one.
    fn run_next(&mut self, end: Timestamp) -> bool {
        let timers = self.nodes.iter().enumerate().flat_map(|(id, node)| {
            let deadlines = node.deadlines.into_iter().enumerate();
            deadlines.filter_map(move |(actor, due)| Some((due?, id, actor)))
        });
        let timer = timers.min();
        let medium = self.medium.next_timeout();
        let event = self.order.peek().map(|Reverse((at, _))| *at);
        let times = [timer.map(|(due, ..)| due), medium, event];
        let next = times.into_iter().flatten().min();
        let Some(next) = next.filter(|next| *next <= end) else {
            return false;
        };
        self.now = self.now.max(next);
        if event == Some(next) {
            if let Some(Reverse((_, index))) = self.order.pop()
                && let Some(event) = self.events[index].take()
            {
                self.handle(event);
            }
        } else if medium == Some(next) {
            self.medium.handle_timeout(self.now);
            self.collect();
        } else if let Some((_, id, actor)) = timer {
            self.nodes[id].deadlines[actor] = None;
            match actor {
                0 => self.step_radio(id, Stimulus::Timeout),
                _ => self.step_routing(id, Stimulus::Timeout),
            }
        }
        true
    }

    fn collect(&mut self) {
        while let Some(event) = self.medium.poll_event() {
            self.order.push(Reverse((event.at(), self.events.len())));
            self.events.push(Some(event));
        }
    }

    fn handle(&mut self, event: Event) {
        match event {
            Event::Arrival(arrival) => {
                let input = radio::Input::Received {
                    datagram: arrival.datagram,
                    source: None,
                    peer: None,
                };
                self.step_radio(arrival.to.0 as usize, Stimulus::Input(input));
            }
            Event::Outcome(outcome) => {
                let input = radio::Input::Delivery {
                    to: outcome.to,
                    frame: outcome.datagram,
                    delivered: outcome.fate == Fate::Delivered,
                };
                self.step_radio(outcome.from.0 as usize, Stimulus::Input(input));
            }
        }
    }

    fn step_radio(&mut self, id: usize, stimulus: Stimulus<radio::Input>) {
        let (mut frames, mut inputs, mut over_budget) = (Vec::new(), Vec::new(), 0);
        let radio = &mut self.nodes[id].radio;
        let deadline = step(radio, self.now, stimulus, |emitted| match emitted {
            Emitted::Transmit(radio::Transmit::Send { to, frame, .. }) => frames.push((to, frame)),
            Emitted::Transmit(radio::Transmit::Received {
                sender,
                ballot,
                payload,
            }) => inputs.push(routing::Input::Received {
                sender,
                ballot,
                payload,
            }),
            Emitted::Transmit(radio::Transmit::Delivery {
                to,
                payload,
                delivered,
            }) => inputs.push(routing::Input::Delivery {
                to,
                payload,
                delivered,
            }),
            Emitted::Event(radio::Event::Dropped(DropReason::OverBudget)) => over_budget += 1,
            _ => {}
        });
        self.over_budget += over_budget;
        self.nodes[id].deadlines[0] = deadline;
        for (to, frame) in frames {
            let to = to.map_or(
                transport::Destination::Broadcast,
                transport::Destination::To,
            );
            self.frames += 1;
            self.bytes += frame.len();
            let sender = NodeId(u32::try_from(id).expect("few drones"));
            let sent = self.medium.send(self.now, sender, to, &frame);
            sent.expect("the medium knows all drones");
            self.collect();
        }
        for input in inputs {
            self.step_routing(id, Stimulus::Input(input));
        }
    }

    fn step_routing(&mut self, id: usize, stimulus: Stimulus<routing::Input>) {
        let by = NodeId(u32::try_from(id).expect("few drones"));
        let mut sends = Vec::new();
        let (now, got, outcomes) = (self.now, &mut self.got, &mut self.outcomes);
        let routing = &mut self.nodes[id].routing;
        let deadline = step(routing, now, stimulus, |emitted| match emitted {
            Emitted::Transmit(routing::Transmit::Send {
                to,
                ballot,
                payload,
                keep_alive,
            }) => sends.push(radio::Input::Send {
                to,
                ballot,
                payload,
                keep_alive,
            }),
            Emitted::Transmit(routing::Transmit::Inform(Notice::Message { from, payload })) => {
                let at = now;
                got.push(Got {
                    by,
                    from,
                    payload,
                    at,
                });
            }
            Emitted::Transmit(routing::Transmit::Inform(Notice::Sent(sent))) => {
                outcomes.extend(sent.into_iter().map(|(id, outcome)| (by, id, outcome)));
            }
            _ => {}
        });
        self.nodes[id].deadlines[1] = deadline;
        for input in sends {
            self.step_radio(id, Stimulus::Input(input));
        }
    }
}

fn node(id: u32, drones: u32, seed: u64) -> Node {
    let id = NodeId(id);
    let radio = radio::Config {
        id,
        swarm: SwarmId(1),
        budget: BUDGET,
        members: drones,
        incarnations: Incarnations::Counted,
    };
    let routing = routing::Config::Tree(tree::Config {
        id,
        drones,
        relays: 0,
        heartbeat_period: Duration::from_secs(1),
        landing_period: Duration::from_secs(4),
        repair: Duration::from_millis(8),
        repair_max: Duration::from_millis(200),
        link_time_to_live: Duration::from_secs(5),
        time_to_live: Duration::from_secs(10),
        route_timeout: Duration::from_secs(10),
    });
    Node {
        radio: Radio::new(
            radio,
            IdealAuthenticator,
            1,
            radio::Checkpoint::default(),
            1,
        ),
        routing: Routing::new(routing, seed, Timestamp::ZERO, None),
        deadlines: [None; 2],
    }
}
