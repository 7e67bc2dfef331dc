//! Routes never form a loop: several routings over a network that loses, delays and reorders frames.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::flaw::{self, Flaw};
use crate::routing::Checkpoint;

const HEARTBEAT_PERIOD: Duration = Duration::from_millis(100);

/// A change of the network.
#[derive(Debug, Clone)]
enum Change {
    /// Runs for this many milliseconds.
    Run(u64),
    /// Sets the share of frames that a link delivers in one direction, in sixteenths.
    Link(usize, usize, u8),
    /// A drone restarts from its current state, or from the last checkpoint that it emitted.
    Restart {
        drone: usize,
        is_fresh: bool,
    },
    Die(usize),
    /// A drone claims leadership under the best ballot so far.
    Lead(usize),
}

/// Initial state of the network.
#[derive(Debug, Clone)]
struct Network {
    drones: usize,
    seed: u64,
    /// Longest delay of a frame, in milliseconds. Beyond the repair interval frames overtake each other.
    delay_max_ms: u64,
    /// Share of frames that each link delivers at first, in sixteenths.
    delivers: u8,
    /// Whether the medium reports the delivery of unicasts.
    reports_delivery: bool,
}

struct Drone {
    routing: Option<Dissemination<TreePolicy>>,
    deadline: Option<Timestamp>,
    checkpoint: Option<Checkpoint>,
    /// The newest heartbeat sequence of an announced route that the drone has forgotten in a restart.
    forgotten: Option<(Ballot, u32)>,
    /// The newest heartbeat sequence of an announced route since then.
    announced: Option<(Ballot, u32)>,
}

/// A frame in flight.
struct InFlight {
    arrives: Timestamp,
    from: usize,
    to: usize,
    input: Input,
}

struct Swarm {
    now: Timestamp,
    network: Network,
    rng: ChaCha8Rng,
    drones: Vec<Drone>,
    /// Share of frames that each link delivers, in sixteenths.
    links: Vec<Vec<u8>>,
    in_flight: Vec<InFlight>,
    term: u32,
    incarnations: u64,
}

/// The drones of a loop.
type Loop = Vec<usize>;

impl Swarm {
    fn new(network: Network) -> Self {
        let count = network.drones;
        let drone = || Drone {
            routing: None,
            deadline: None,
            checkpoint: None,
            forgotten: None,
            announced: None,
        };
        let mut swarm = Self {
            now: Timestamp::ZERO,
            rng: ChaCha8Rng::seed_from_u64(network.seed),
            drones: (0..count).map(|_| drone()).collect(),
            links: vec![vec![network.delivers; count]; count],
            in_flight: Vec::new(),
            term: 0,
            incarnations: 0,
            network,
        };
        for id in 0..count {
            swarm.start(id, None);
        }
        swarm
    }

    fn config(&self, id: usize) -> Config {
        Config {
            id: node(id),
            drones: u32::try_from(self.network.drones).unwrap(),
            relays: 0,
            heartbeat_period: HEARTBEAT_PERIOD,
            landing_period: HEARTBEAT_PERIOD * 4,
            repair: Duration::from_millis(8),
            repair_max: Duration::from_millis(200),
            link_time_to_live: HEARTBEAT_PERIOD * 5,
            time_to_live: HEARTBEAT_PERIOD * 10,
            route_timeout: HEARTBEAT_PERIOD * 10,
        }
    }

    fn start(&mut self, id: usize, checkpoint: Option<Checkpoint>) {
        self.incarnations += 1;
        let config = self.config(id);
        let shared = SharedState::new(
            config.id,
            config.drones,
            self.network.seed ^ self.incarnations,
        );
        let checkpoint = checkpoint.map(|it| match it.policy {
            PolicyCheckpoint::Tree(own) => (it.common, own),
            PolicyCheckpoint::Flood(_) => panic!("the checkpoint is of policy `tree`"),
        });
        let now = self.now;
        let new = |shared: &mut SharedState| TreePolicy::new(config, shared, now, checkpoint);
        self.drones[id].routing = Some(Dissemination::new(shared, new));
        self.stimulate(id, Stimulus::Timeout);
    }

    fn die(&mut self, id: usize) {
        let drone = &mut self.drones[id];
        drone.routing = None;
        drone.deadline = None;
    }

    fn restart(&mut self, id: usize, is_fresh: bool) {
        let drone = &mut self.drones[id];
        if let Some(routing) = &drone.routing
            && is_fresh
        {
            drone.checkpoint = Some(Checkpoint {
                common: routing.shared.durable.clone(),
                policy: routing.policy.checkpoint(),
            });
        }
        let known = [drone.forgotten, drone.announced];
        let remembers = |(ballot, heartbeat): &(Ballot, u32)| {
            let common = drone.checkpoint.as_ref().map(|it| &it.common);
            common.is_some_and(|it| {
                it.epoch.ballot() != Some(*ballot) || it.heartbeats.master >= *heartbeat
            })
        };
        drone.forgotten = known.into_iter().flatten().max_by_key(by_age);
        drone.forgotten = drone.forgotten.filter(|it| !remembers(it));
        drone.announced = None;
        self.die(id);
        self.start(id, self.drones[id].checkpoint.clone());
    }

    fn stimulate(&mut self, id: usize, stimulus: Stimulus<Input>) {
        let drone = &mut self.drones[id];
        let Some(routing) = &mut drone.routing else {
            return;
        };
        let mut sent = Vec::new();
        let checkpoint = &mut drone.checkpoint;
        drone.deadline = step(routing, self.now, stimulus, |emitted| match emitted {
            Emitted::Transmit(Transmit::Send {
                to,
                ballot,
                payload,
                ..
            }) => sent.push((to, ballot, Bytes::from(payload))),
            Emitted::Event(Event::Checkpoint(it)) => *checkpoint = Some(*it),
            Emitted::Transmit(Transmit::Inform(_) | Transmit::Deaf(_)) | Emitted::Event(_) => {}
        });
        for (to, ballot, payload) in sent {
            let header = wire::decode_tree(&payload).unwrap().header;
            if header.hops.is_some() {
                // A route becomes older if the parent restarts from an older checkpoint.
                let announced = (ballot, header.heartbeat - header.lag);
                let before = self.drones[id].announced;
                self.drones[id].announced =
                    before.into_iter().chain([announced]).max_by_key(by_age);
            }
            for receiver in 0..self.network.drones {
                let is_delivered = self.rng.random_range(0..16) < self.links[id][receiver];
                if receiver != id && is_delivered {
                    let heard = Input::Received {
                        sender: node(id),
                        ballot,
                        payload: payload.clone(),
                    };
                    self.put_in_flight(id, receiver, heard);
                }
                if to == Some(node(receiver)) && self.network.reports_delivery {
                    let outcome = Input::Delivery {
                        to: node(receiver),
                        payload: payload.clone(),
                        delivered: is_delivered,
                    };
                    self.put_in_flight(id, id, outcome);
                }
            }
        }
    }

    fn put_in_flight(&mut self, from: usize, to: usize, input: Input) {
        let nanos = self.network.delay_max_ms * 1_000_000;
        let delay = Duration::from_nanos(self.rng.random_range(0..nanos));
        self.in_flight.push(InFlight {
            arrives: self.now + delay,
            from,
            to,
            input,
        });
    }

    /// Handles the next timer or frame up to `until`; returns whether there was one.
    fn run_next(&mut self, until: Timestamp) -> bool {
        let timer = (0..self.drones.len())
            .filter_map(|id| Some((self.drones[id].deadline?, id)))
            .min();
        let frame = (0..self.in_flight.len())
            .map(|at| (self.in_flight[at].arrives, at))
            .min();
        match (timer, frame) {
            (timer, Some((at, frame))) if at <= until && timer.is_none_or(|it| at <= it.0) => {
                self.now = self.now.max(at);
                let frame = self.in_flight.swap_remove(frame);
                debug_assert!(frame.from < self.drones.len());
                self.stimulate(frame.to, Stimulus::Input(frame.input));
            }
            (Some((at, id)), _) if at <= until => {
                self.now = self.now.max(at);
                self.stimulate(id, Stimulus::Timeout);
            }
            _ => return false,
        }
        true
    }

    fn parent(&self, id: usize) -> Option<usize> {
        let routing = self.drones[id].routing.as_ref()?;
        routing
            .policy
            .topology
            .route
            .parent()
            .map(|parent| parent.0 as usize)
    }

    fn find_loop(&self) -> Option<Loop> {
        (0..self.drones.len()).find_map(|id| {
            let route = std::iter::successors(Some(id), |id| self.parent(*id));
            let ring: Loop = route.take(self.drones.len() + 1).collect();
            let back = (1..ring.len()).find(|at| ring[*at] == id)?;
            Some(ring[..back].to_vec())
        })
    }

    /// The newest heartbeat sequence of a route on the loop, and the newest one that a drone on it has forgotten.
    fn sequences(&self, ring: &Loop) -> (u32, Option<u32>) {
        let heartbeat = |id: &usize| {
            let routing = self.drones[*id].routing.as_ref();
            routing.map_or(0, |it| it.policy.topology.route.label_heartbeat())
        };
        let forgotten = |id: &usize| {
            let routing = self.drones[*id].routing.as_ref()?;
            let (ballot, heartbeat) = self.drones[*id].forgotten?;
            (routing.shared.durable.epoch.ballot() == Some(ballot)).then_some(heartbeat)
        };
        (
            ring.iter().map(heartbeat).max().unwrap_or(0),
            ring.iter().filter_map(forgotten).max(),
        )
    }

    /// Applies a change. `Err` if a forbidden loop appears.
    fn change(&mut self, change: &Change) -> Result<(), String> {
        let count = self.network.drones;
        match *change {
            Change::Run(millis) => {
                let until = self.now + Duration::from_millis(millis);
                while self.run_next(until) {
                    self.check()?;
                }
                self.now = until;
            }
            Change::Link(from, to, delivers) => self.links[from % count][to % count] = delivers,
            Change::Restart { drone, is_fresh } => self.restart(drone % count, is_fresh),
            Change::Die(drone) => self.die(drone % count),
            Change::Lead(drone) => {
                self.term += 1;
                let master = node(drone % count);
                let ballot = Ballot {
                    term: self.term,
                    rank: master.0,
                    master,
                };
                self.stimulate(drone % count, Stimulus::Input(Input::Lead(ballot)));
            }
        }
        self.check()
    }

    fn check(&self) -> Result<(), String> {
        let Some(ring) = self.find_loop() else {
            return Ok(());
        };
        let (newest, forgotten) = self.sequences(&ring);
        if forgotten.is_some_and(|forgotten| newest <= forgotten) {
            return Ok(());
        }
        Err(format!(
            "at {:?}: drones {ring:?} follow each other, by heartbeat {newest}; forgotten is {forgotten:?}",
            self.now
        ))
    }
}

fn by_age(route: &(Ballot, u32)) -> (u32, u32) {
    (route.0.term, route.1)
}

fn node(id: usize) -> NodeId {
    NodeId(u32::try_from(id).unwrap())
}

/// Runs a network with master 0, then the changes.
fn run(network: Network, changes: &[Change]) -> Result<(), String> {
    let mut swarm = Swarm::new(network);
    swarm.change(&Change::Lead(0))?;
    swarm.change(&Change::Run(400))?;
    changes.iter().try_for_each(|change| swarm.change(change))
}

fn networks() -> impl Strategy<Value = Network> {
    let delays = prop_oneof![Just(1_u64), Just(10), Just(60)];
    let delivers = prop_oneof![Just(16_u8), Just(12), Just(8), Just(5)];
    (3..8_usize, any::<u64>(), delays, delivers, any::<bool>()).prop_map(
        |(drones, seed, delay_max_ms, delivers, reports_delivery)| Network {
            drones,
            seed,
            delay_max_ms,
            delivers,
            reports_delivery,
        },
    )
}

fn changes() -> impl Strategy<Value = Vec<Change>> {
    let drone = || 0..8_usize;
    let change = prop_oneof![
        6 => (10..600_u64).prop_map(Change::Run),
        4 => (drone(), drone(), 0..17_u8).prop_map(|(from, to, it)| Change::Link(from, to, it)),
        2 => (drone(), any::<bool>()).prop_map(|(drone, is_fresh)| Change::Restart { drone, is_fresh }),
        1 => drone().prop_map(Change::Die),
        1 => drone().prop_map(Change::Lead),
    ];
    prop::collection::vec(change, 1..40)
}

proptest! {
    /// What the feasibility condition proves, under any number of leader epochs and with any loss, delay and order of
    /// frames: drones that remember the newest heartbeat sequence of their announced routes never form a loop. If a
    /// drone on a loop has forgotten it, because its checkpoint is older, no route on the loop has a newer sequence.
    /// The next heartbeat opens that loop.
    #[test]
    fn routes_never_form_a_loop_newer_than_forgotten_sequences(
        network in networks(),
        changes in changes(),
    ) {
        let outcome = run(network, &changes);
        prop_assert!(outcome.is_ok(), "{}", outcome.unwrap_err());
    }
}

/// The same networks without the condition.
#[test]
fn without_feasibility_condition_routes_form_loops() {
    use proptest::strategy::ValueTree;
    use proptest::test_runner::TestRunner;

    let mut runner = TestRunner::deterministic();
    let _planted = flaw::plant(Flaw::SkipsFeasibilityCondition);
    let plans = (networks(), changes());
    let loops = (0..64).filter(|_| {
        let (network, changes) = plans.new_tree(&mut runner).unwrap().current();
        run(network, &changes).is_err()
    });
    assert!(loops.count() >= 4);
}
