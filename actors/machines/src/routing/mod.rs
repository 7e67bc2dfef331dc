//! Who is near, which way the master is, who must relay; orders outwards and acknowledgements inwards.
//!
//! It serves any protocol in which a master gives numbered orders and its members acknowledge them; what an order
//! means is not known here. The core holds what any dissemination shares; how orders and
//! acknowledgements spread is a policy inside.

mod core;
mod epoch;
pub mod flood;
mod heartbeat;
mod packet;
pub mod tree;

use std::convert::Infallible;
use std::hint::black_box;
use std::time::Duration;

use bytes::Bytes;

pub use epoch::LeaderEpoch;
pub use heartbeat::Heartbeats;
pub use packet::{ETX_UNIT, Flood, Member, Packet, Reception, Tree};
use serde::{Deserialize, Serialize};

use self::core::Core;
use crate::identity::{Ballot, NodeId, NodeSet};
use crate::leader::{BallotDecision, LinkSymmetry};
use crate::machine::{Machine, Output};
use crate::time::Timestamp;

/// What a routing is built with: the policy that it follows.
#[derive(Debug, Clone)]
pub enum Config {
    /// Periodic repetition, as the thesis has it.
    Flood(flood::Config),
    /// On change, along a tree, repaired at each hop.
    Tree(tree::Config),
}

impl Config {
    /// How long a drone takes at most until it misses a master that is gone.
    #[must_use]
    pub fn detection(&self) -> Duration {
        match self {
            Self::Flood(config) => config.detection(),
            Self::Tree(config) => config.detection(),
        }
    }

    /// How long news takes to a neighbour, losses included, the way through the air apart.
    #[must_use]
    pub fn hop(&self) -> Duration {
        match self {
            Self::Flood(config) => config.hop(),
            Self::Tree(config) => config.hop(),
        }
    }

    /// The longest that a drone keeps silent that is not landing.
    #[must_use]
    pub fn turn(&self) -> Duration {
        match self {
            Self::Flood(config) => config.turn(),
            Self::Tree(config) => config.turn(),
        }
    }

    /// For how many turns a drone waits for a sign of the master, which each drone on the way repeats at its own turn, before
    /// it misses it; nothing where it asks first.
    #[must_use]
    pub fn awaited_turns(&self) -> Option<u32> {
        match self {
            Self::Flood(config) => Some(config.awaited_turns()),
            Self::Tree(_) => None,
        }
    }
}

/// What a routing is told.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum Input {
    /// By the radio: a frame was let in.
    Heard {
        /// Who said it.
        sender: NodeId,
        /// Whom the sender obeys.
        ballot: Ballot,
        /// What was said.
        payload: Bytes,
    },
    /// By the radio: what became of a frame for one drone, where whatever carries frames tells.
    Outcome {
        /// For whom it was.
        to: NodeId,
        /// What was said.
        payload: Bytes,
        /// Whether it arrived there, as far as is known.
        delivered: bool,
    },
    /// By the protocol: this drone is the master, under this ballot.
    Lead(Ballot),
    /// By the protocol, as master: this is the newest order.
    Publish {
        /// Under which ballot of its own; nothing is published if another has been heard of meanwhile.
        ballot: Ballot,
        /// One more than the order before it.
        sequence: u32,
        /// The order.
        order: Bytes,
    },
    /// By the protocol: this order and all before it are carried out.
    Acknowledge {
        /// Whose order it is; nothing is acknowledged if the drone has turned to another meanwhile.
        ballot: Ballot,
        /// The order's number.
        sequence: u32,
    },
    /// By the protocol, as master: start neighbour discovery.
    Discover,
    /// By the protocol: the drones change places; ways that were learnt once don't hold any more.
    Scatter,
    /// By the protocol: this drone is going to land; nobody is to wait for it.
    Land,
    /// By the protocol: this drone is done; say so once more and fall silent.
    Stop,
    /// By the protocol, restarted: tell me again what I should know.
    Resync,
}

/// What a routing sends.
#[derive(Debug, Clone, PartialEq)]
pub enum Transmit {
    /// To the radio: send this.
    Send {
        /// For whom it is; for all in range otherwise. Others may hear it in either case.
        to: Option<NodeId>,
        /// Whom this drone obeys.
        ballot: Ballot,
        /// A packet, encoded.
        payload: Vec<u8>,
        /// Whether it is sent only because its time has come, and not because anything has changed or was missed.
        keep_alive: bool,
    },
    /// To the protocol.
    Inform(Notice),
}

/// What a routing lets its protocol know.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum Notice {
    /// Whom this drone obeys from now on: it heard of a better ballot.
    Leader(Ballot),
    /// There is a newer order.
    Order {
        /// Whose order it is.
        ballot: Ballot,
        /// Its number.
        sequence: u32,
        /// The order.
        order: Bytes,
    },
    /// To a master: how far members have got, as far as that is news.
    Progress {
        /// The newest order.
        sequence: u32,
        /// Who has carried it out.
        acknowledged: NodeSet,
        /// Who is going to land.
        landing: NodeSet,
    },
    /// To a master, before routes are up: whom it hears itself.
    Hears(NodeSet),
    /// To a master: these members have not been heard of for their time to live.
    Silent(NodeSet),
    /// To a master: these members were silent and are back.
    Returned(NodeSet),
    /// The master's own number has not risen for its time to live.
    MasterSilent,
    /// The master is back.
    MasterReturned,
    /// The master says that it is going to land, and has given no order that this drone does not know of.
    MasterLands,
    /// Neighbour discovery has begun.
    DiscoveryStarted,
    /// Neighbour discovery has ended; hop update has begun.
    HopUpdateStarted,
    /// Routes are up.
    RoutesReady,
    /// This routing restarted: tell me again what I should know.
    Resync,
}

/// What can be seen of a routing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Event {
    /// A neighbour became stable.
    NeighbourStable(NodeId),
    /// What this drone knows of its way to the master.
    Routes(Routes),
    /// As master: who speaks for a member, and whether it is out of the master's own range.
    Reached {
        /// The member.
        member: NodeId,
        /// The master's neighbour that its acknowledgements come through; itself when heard directly.
        via: NodeId,
        /// Whether the member does not hear the master itself.
        out_of_range: bool,
    },
    /// A peer sent a payload that is none, a member that is none, or obeys an older ballot.
    Ignored(NodeId),
    /// What a restarted routing is built from.
    Checkpoint(Box<Checkpoint>),
}

/// A drone's way to the master.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
pub struct Routes {
    /// Hops to the master; 0 for the master itself.
    pub hops: Option<u16>,
    /// The neighbour through which acknowledgements go.
    pub parent: Option<NodeId>,
    /// The thesis's routing list (its table 8).
    pub routing_list: Vec<NodeId>,
    /// Whether this drone must repeat orders because it reaches drones that are not listed yet.
    pub relay: bool,
    /// Whether this drone does not hear the master itself.
    pub out_of_range: bool,
}

/// What outlives a routing: what both policies share, and what its policy adds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    /// By either policy.
    pub common: Durable,
    /// By its policy.
    pub policy: PolicyCheckpoint,
}

/// What outlives a routing by either policy.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Durable {
    /// Whom this drone obeys, and what it was ordered.
    pub epoch: LeaderEpoch,
    /// Since when the drone is going to land.
    pub landing: Option<Timestamp>,
    /// Whether the drone is done.
    pub stopped: bool,
    /// The signs of life.
    pub heartbeats: Heartbeats,
}

/// What a policy adds to a checkpoint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum PolicyCheckpoint {
    /// Of policy `flood`.
    Flood(flood::Checkpoint),
    /// Of policy `tree`.
    Tree(tree::Checkpoint),
}

impl Checkpoint {
    /// Whom the drone obeys, if anybody.
    #[must_use]
    pub const fn ballot(&self) -> Option<Ballot> {
        self.common.epoch.ballot()
    }

    /// Whether what must never fall back has changed since `before`: whom the drone obeys, which numbers it may have
    /// used, whether it is landing or done, and by `flood` what its routing is doing.
    pub(crate) fn is_news(&self, before: &Self) -> bool {
        let (own, was) = (&self.common, &before.common);
        let phases = match (&self.policy, &before.policy) {
            (PolicyCheckpoint::Flood(own), PolicyCheckpoint::Flood(was)) => own.phase != was.phase,
            (PolicyCheckpoint::Tree(_), PolicyCheckpoint::Tree(_)) => false,
            _ => true,
        };
        phases
            || (own.landing, own.stopped) != (was.landing, was.stopped)
            || own.epoch.is_news(&was.epoch)
            || own.heartbeats.reserved() != was.heartbeats.reserved()
    }
}

/// How orders and acknowledgements spread.
trait Policy: std::fmt::Debug {
    /// Takes in a frame that the radio let in.
    fn heard(&mut self, core: &mut Core, now: Timestamp, from: (NodeId, Ballot), payload: &Bytes);

    /// Takes in what became of a frame for one drone.
    fn outcome(
        &mut self,
        _core: &mut Core,
        _now: Timestamp,
        _to: NodeId,
        _payload: &[u8],
        _delivered: bool,
    ) {
    }

    /// The current leader is another one than before.
    fn begin_epoch(&mut self, core: &mut Core, now: Timestamp);

    /// This drone leads; [`Self::begin_epoch`] was called if it did not before.
    fn lead(&mut self, core: &mut Core, now: Timestamp, ballot: Ballot);

    /// This master gave a newer order.
    fn published(&mut self, core: &mut Core, now: Timestamp);

    /// This drone has carried an order out.
    fn carried_out(&mut self, core: &mut Core, now: Timestamp);

    /// See [`Input::Discover`].
    fn discover(&mut self, core: &mut Core, now: Timestamp);

    /// See [`Input::Scatter`].
    fn scatter(&mut self, core: &mut Core, now: Timestamp);

    /// This drone is going to land.
    fn land(&mut self, core: &mut Core, now: Timestamp);

    /// Says the last words; nothing is said afterwards.
    fn stop(&mut self, core: &mut Core, now: Timestamp);

    /// Tells the protocol anew what this policy knows.
    fn resync(&mut self, core: &mut Core, now: Timestamp);

    /// The host stood still: silence since then says nothing about anybody.
    fn forgive(&mut self, core: &mut Core, now: Timestamp);

    /// Fires every deadline `<= now`.
    fn handle_timeout(&mut self, core: &mut Core, now: Timestamp);

    /// When it wants to be stepped next; after `now` once [`Self::handle_timeout`] was called at `now`.
    fn deadline(&self, core: &Core) -> Option<Timestamp>;

    /// What outlives it.
    fn checkpoint(&self) -> PolicyCheckpoint;

    /// Entries in the larger of its tables, and the most that it takes.
    fn occupancy(&self) -> (usize, usize);

    /// As [`NodeMachine::read_ahead`](crate::node::NodeMachine::read_ahead) says.
    fn read_ahead(&self) {}

    /// As [`NodeMachine::read_further_ahead`](crate::node::NodeMachine::read_further_ahead) says.
    fn read_further_ahead(&self, _sender: Option<NodeId>) {}
}

/// The routing of one drone, by whichever policy.
#[derive(Debug)]
pub struct Routing(Kind);

#[derive(Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "there is one a drone, which lies on the heap already"
)]
enum Kind {
    Flood(Box<Dissemination<flood::FloodPolicy>>),
    Tree(Dissemination<tree::TreePolicy>),
}

impl Routing {
    /// A routing as `checkpoint` left it; one without, or with another policy's, knows nothing.
    #[must_use]
    pub fn new(config: Config, seed: u64, now: Timestamp, checkpoint: Option<Checkpoint>) -> Self {
        Self(match config {
            Config::Flood(config) => {
                let core = Core::new(config.id, config.drones, seed);
                let kept = checkpoint.and_then(|it| match it.policy {
                    PolicyCheckpoint::Flood(own) => Some((it.common, own)),
                    PolicyCheckpoint::Tree(_) => None,
                });
                let new = |core: &mut Core| flood::FloodPolicy::new(config, core, now, kept);
                Kind::Flood(Box::new(Dissemination::new(core, new)))
            }
            Config::Tree(config) => {
                let core = Core::new(config.id, config.drones, seed);
                let kept = checkpoint.and_then(|it| match it.policy {
                    PolicyCheckpoint::Tree(own) => Some((it.common, own)),
                    PolicyCheckpoint::Flood(_) => None,
                });
                let new = |core: &mut Core| tree::TreePolicy::new(config, core, now, kept);
                Kind::Tree(Dissemination::new(core, new))
            }
        })
    }

    /// Entries in the larger of its tables, and the most either takes.
    #[must_use]
    pub fn occupancy(&self) -> (usize, usize) {
        match &self.0 {
            Kind::Flood(routing) => routing.policy.occupancy(),
            Kind::Tree(routing) => routing.policy.occupancy(),
        }
    }

    /// As [`NodeMachine::read_ahead`](crate::node::NodeMachine::read_ahead) says. Whoever repeats everything all the time flies in small
    /// swarms, which need not be read ahead.
    pub(crate) fn read_ahead(&self) {
        if let Kind::Tree(routing) = &self.0 {
            black_box(routing.wakes);
            routing.core.read_ahead();
            routing.policy.read_ahead();
        }
    }

    /// As [`NodeMachine::read_further_ahead`](crate::node::NodeMachine::read_further_ahead) says.
    pub(crate) fn read_further_ahead(&self, sender: Option<NodeId>) {
        if let Kind::Tree(routing) = &self.0 {
            routing.policy.read_further_ahead(sender);
        }
    }
}

impl Machine for Routing {
    type Input = Input;
    type Transmit = Transmit;
    type Event = Event;
    type Rejection = Infallible;

    fn handle_input(&mut self, now: Timestamp, input: Input) -> Result<(), Infallible> {
        match &mut self.0 {
            Kind::Flood(routing) => routing.handle_input(now, input),
            Kind::Tree(routing) => routing.handle_input(now, input),
        }
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        match &mut self.0 {
            Kind::Flood(routing) => routing.handle_timeout(now),
            Kind::Tree(routing) => routing.handle_timeout(now),
        }
    }

    fn poll_output(&mut self) -> Output<Transmit, Event> {
        match &mut self.0 {
            Kind::Flood(routing) => routing.poll_output(),
            Kind::Tree(routing) => routing.poll_output(),
        }
    }
}

/// What both policies share, with one of them.
///
/// Invariant: a checkpoint leaves ahead of everything that rests on it.
#[derive(Debug)]
struct Dissemination<P> {
    core: Core,
    policy: P,
    /// When it wants to act next, as of the end of its last step.
    wakes: Option<Timestamp>,
}

impl<P: Policy> Dissemination<P> {
    fn new(mut core: Core, policy: impl FnOnce(&mut Core) -> P) -> Self {
        let policy = policy(&mut core);
        let mut routing = Self {
            wakes: policy.deadline(&core),
            core,
            policy,
        };
        routing.put_checkpoint();
        routing
    }

    fn forgive_if_stalled(&mut self, now: Timestamp) {
        if self.core.has_stalled(now) {
            self.policy.forgive(&mut self.core, now);
        }
    }

    fn lead(&mut self, now: Timestamp, ballot: Ballot) {
        match self.core.hear_ballot(ballot, LinkSymmetry::Mutual) {
            // A better ballot has been heard of meanwhile, of which the protocol is being told.
            BallotDecision::Ignored => return,
            BallotDecision::Same => {}
            BallotDecision::Turned => self.policy.begin_epoch(&mut self.core, now),
        }
        self.policy.lead(&mut self.core, now, ballot);
    }

    fn end_step(&mut self, now: Timestamp) {
        self.put_checkpoint();
        self.wakes = self.policy.deadline(&self.core);
        self.core.ask(now, self.wakes);
    }

    /// Puts a checkpoint ahead of all that was said, if one is due.
    fn put_checkpoint(&mut self) {
        if self.core.takes_checkpoint() {
            let checkpoint = Checkpoint {
                common: self.core.durable.clone(),
                policy: self.policy.checkpoint(),
            };
            self.core.put_first(Event::Checkpoint(Box::new(checkpoint)));
        }
    }
}

impl<P: Policy> Machine for Dissemination<P> {
    type Input = Input;
    type Transmit = Transmit;
    type Event = Event;
    type Rejection = Infallible;

    fn handle_input(&mut self, now: Timestamp, input: Input) -> Result<(), Infallible> {
        self.forgive_if_stalled(now);
        let (core, policy) = (&mut self.core, &mut self.policy);
        match input {
            Input::Heard {
                sender,
                ballot,
                payload,
            } => policy.heard(core, now, (sender, ballot), &payload),
            Input::Outcome {
                to,
                payload,
                delivered,
            } => policy.outcome(core, now, to, &payload, delivered),
            Input::Lead(ballot) => self.lead(now, ballot),
            Input::Publish {
                ballot,
                sequence,
                order,
            } => {
                let own = core.id;
                if core.durable.epoch.publish(own, ballot, sequence, order) {
                    core.keep();
                    policy.published(core, now);
                }
            }
            Input::Acknowledge { ballot, sequence } => {
                if core.durable.epoch.acknowledge(ballot, sequence) {
                    core.keep();
                    policy.carried_out(core, now);
                }
            }
            Input::Discover => policy.discover(core, now),
            Input::Land => {
                core.begin_landing(now);
                policy.land(core, now);
            }
            Input::Scatter => policy.scatter(core, now),
            Input::Stop => {
                if !core.durable.stopped {
                    core.begin_landing(now);
                    policy.stop(core, now);
                    core.durable.stopped = true;
                }
            }
            Input::Resync => {
                core.resync();
                policy.resync(core, now);
                core.resync_master();
            }
        }
        self.end_step(now);
        Ok(())
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        self.forgive_if_stalled(now);
        self.policy.handle_timeout(&mut self.core, now);
        self.end_step(now);
    }

    fn poll_output(&mut self) -> Output<Transmit, Event> {
        self.core.poll(self.wakes)
    }
}
