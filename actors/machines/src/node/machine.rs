//! How a drone's machines are built and stepped.

use std::fmt;
use std::sync::Arc;

use super::{Address, Checkpoints, Effect, Envelope};
use crate::identity::NodeId;
use crate::machine::{Emitted, Machine, Stimulus, step};
use crate::mission::Protocol;
use crate::radio::{Authenticator, Radio};
use crate::time::Timestamp;
use crate::{agent, indoor, mission, msp, navigation, radio, routing};

/// Configuration from which a drone's machines are built.
#[derive(Clone)]
pub struct Blueprint {
    /// The drone.
    pub id: NodeId,
    /// Configuration of the radio.
    pub radio: radio::Config,
    /// Signs the drone's frames and verifies those of others.
    pub authenticator: Arc<dyn Authenticator + Send + Sync>,
    /// Configuration of the routing.
    pub routing: routing::Config,
    /// Configuration of the mission.
    pub mission: mission::Config,
    /// Configuration of the agent's host. `None` without an agent.
    pub agent: Option<agent::Config>,
    /// Configuration of the navigation.
    pub navigation: navigation::Config,
    /// Builds the navigation's indoor machine. `None` without a map.
    pub indoor: Option<Arc<indoor::Builder>>,
    /// Builds the link to the flight controller.
    pub link: Arc<LinkBuilder>,
}

/// Builds a link to a flight controller from its last checkpoint, at a time.
pub type LinkBuilder =
    dyn Fn(Option<msp::Checkpoint>, Timestamp) -> Box<dyn msp::Link> + Send + Sync;

impl fmt::Debug for Blueprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Blueprint")
            .field("id", &self.id)
            .finish_non_exhaustive()
    }
}

impl Blueprint {
    /// Builds a machine from its checkpoint. `seed` seeds the machine's rng, if it has one.
    #[must_use]
    pub fn build(
        &self,
        address: Address,
        seed: u64,
        now: Timestamp,
        checkpoints: &Checkpoints,
    ) -> NodeMachine {
        match address {
            Address::Radio => {
                let radio = Radio::new(
                    self.radio.clone(),
                    Arc::clone(&self.authenticator),
                    checkpoints.boot,
                    checkpoints.radio,
                    seed,
                );
                NodeMachine::Radio(Box::new(radio.with_list(checkpoints.revoked.clone())))
            }
            Address::Routing => NodeMachine::Routing(Box::new(routing::Routing::new(
                self.routing.clone(),
                seed,
                now,
                checkpoints.routing.as_deref().cloned(),
            ))),
            Address::Mission => NodeMachine::Mission(self.protocol(seed, checkpoints)),
            Address::Navigation => {
                let indoor = self.indoor.as_ref();
                let indoor = indoor.map(|build| build(seed, now, checkpoints.indoor.as_deref()));
                let navigation = navigation::Navigation::new(
                    self.id,
                    self.navigation.clone(),
                    checkpoints.navigation.as_deref().cloned(),
                );
                NodeMachine::Navigation(Box::new(navigation.with_indoor(indoor)))
            }
            Address::Msp => NodeMachine::Msp((self.link)(checkpoints.msp.as_deref().copied(), now)),
        }
    }
}

impl Blueprint {
    /// The swarm protocol, with the drone's agent if there is one.
    fn protocol(&self, seed: u64, checkpoints: &Checkpoints) -> Box<dyn Protocol> {
        let checkpoint = checkpoints.mission.as_deref().cloned();
        let mission = mission::Mission::new(self.mission.clone(), checkpoint);
        match &self.agent {
            Some(config) => {
                let checkpoint = checkpoints.agent.as_deref().cloned();
                Box::new(agent::Host::new(config.clone(), mission, checkpoint, seed))
            }
            None => Box::new(mission),
        }
    }
}

/// One of a drone's five machines, run by an actor.
pub enum NodeMachine {
    /// The radio.
    Radio(Box<Radio<Arc<dyn Authenticator + Send + Sync>>>),
    /// The routing.
    Routing(Box<routing::Routing>),
    /// The mission: a swarm protocol.
    Mission(Box<dyn Protocol>),
    /// The navigation.
    Navigation(Box<navigation::Navigation>),
    /// The link to the flight controller.
    Msp(Box<dyn msp::Link>),
}

impl fmt::Debug for NodeMachine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "NodeMachine({})", self.address())
    }
}

/// Occupancy of a machine's fullest table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Occupancy {
    /// Number of entries.
    pub len: usize,
    /// Maximum number of entries.
    pub max: usize,
}

/// Output of one step.
#[derive(Debug, Default)]
pub struct StepOutput {
    /// Effects to carry out, in order.
    pub effects: Vec<Effect>,
    /// When the machine needs its next timeout. `None` if it needs none.
    pub deadline: Option<Timestamp>,
    /// Occupancy of the machine's fullest table.
    pub occupancy: Occupancy,
    /// Whether the deadline is still due after a timeout. The machine would be woken in an endless loop.
    pub is_overdue: bool,
}

impl NodeMachine {
    /// The machine's address.
    #[must_use]
    pub const fn address(&self) -> Address {
        match self {
            Self::Radio(_) => Address::Radio,
            Self::Routing(_) => Address::Routing,
            Self::Mission(_) => Address::Mission,
            Self::Navigation(_) => Address::Navigation,
            Self::Msp(_) => Address::Msp,
        }
    }

    /// Runs one step. Overwrites `output` and reuses its memory.
    ///
    /// # Panics
    /// The envelope is for another machine: drivers must deliver by [`Envelope::address`].
    pub fn step(&mut self, now: Timestamp, stimulus: Stimulus<Envelope>, output: &mut StepOutput) {
        output.effects.clear();
        let is_timeout = matches!(stimulus, Stimulus::Timeout);
        let effects = &mut output.effects;
        output.deadline = match stimulus {
            Stimulus::Timeout => self.time_out(now, effects),
            Stimulus::Input(envelope) => self.handle(now, envelope, effects),
        };
        output.occupancy = self.occupancy();
        output.is_overdue = is_timeout && output.deadline.is_some_and(|deadline| deadline <= now);
    }

    fn time_out(&mut self, now: Timestamp, effects: &mut Vec<Effect>) -> Option<Timestamp> {
        match self {
            Self::Radio(machine) => run(machine.as_mut(), now, Stimulus::Timeout, effects),
            Self::Routing(machine) => run(machine.as_mut(), now, Stimulus::Timeout, effects),
            Self::Mission(machine) => run(machine.as_mut(), now, Stimulus::Timeout, effects),
            Self::Navigation(machine) => run(machine.as_mut(), now, Stimulus::Timeout, effects),
            Self::Msp(machine) => run(machine.as_mut(), now, Stimulus::Timeout, effects),
        }
    }

    fn handle(
        &mut self,
        now: Timestamp,
        envelope: Envelope,
        effects: &mut Vec<Effect>,
    ) -> Option<Timestamp> {
        match (self, envelope) {
            (Self::Radio(machine), Envelope::Radio(input)) => {
                run(machine.as_mut(), now, Stimulus::Input(input), effects)
            }
            (Self::Routing(machine), Envelope::Routing(input)) => {
                run(machine.as_mut(), now, Stimulus::Input(input), effects)
            }
            (Self::Mission(machine), Envelope::Mission(input)) => {
                run(machine.as_mut(), now, Stimulus::Input(input), effects)
            }
            (Self::Navigation(machine), Envelope::Navigation(input)) => {
                run(machine.as_mut(), now, Stimulus::Input(*input), effects)
            }
            (Self::Msp(machine), Envelope::Msp(input)) => {
                run(machine.as_mut(), now, Stimulus::Input(*input), effects)
            }
            (machine, envelope) => {
                unreachable!("{envelope:?} was delivered to {}", machine.address())
            }
        }
    }

    /// Reads the memory inside the machine that its next step will need, and changes nothing.
    ///
    /// A driver of many machines calls this for all that it will step soon, then [`Self::read_further_ahead`]. Their
    /// cache misses then overlap.
    pub fn read_ahead(&self) {
        match self {
            Self::Radio(machine) => machine.read_ahead(),
            Self::Routing(machine) => machine.read_ahead(),
            Self::Mission(_) | Self::Navigation(_) | Self::Msp(_) => {}
        }
    }

    /// As [`Self::read_ahead`], for memory that the machine points to: for a frame of `sender`, or for a timeout if it is
    /// `None`.
    pub fn read_further_ahead(&self, sender: Option<NodeId>) {
        match self {
            Self::Radio(machine) => machine.read_further_ahead(sender),
            Self::Routing(machine) => machine.read_further_ahead(sender),
            Self::Mission(_) | Self::Navigation(_) | Self::Msp(_) => {}
        }
    }

    fn occupancy(&self) -> Occupancy {
        let (len, max) = match self {
            Self::Radio(machine) => machine.occupancy(),
            Self::Routing(machine) => machine.occupancy(),
            Self::Mission(machine) => machine.occupancy(),
            Self::Navigation(_) | Self::Msp(_) => (0, 0),
        };
        Occupancy { len, max }
    }
}

/// Steps a machine and appends its outputs to `effects`.
fn run<M>(
    machine: &mut M,
    now: Timestamp,
    stimulus: Stimulus<M::Input>,
    effects: &mut Vec<Effect>,
) -> Option<Timestamp>
where
    M: Machine + ?Sized,
    M::Transmit: Into<Effect>,
    M::Event: Into<Effect>,
{
    step(machine, now, stimulus, |emitted: Emitted<M>| {
        effects.push(match emitted {
            Emitted::Transmit(transmit) => transmit.into(),
            Emitted::Event(event) => event.into(),
        });
    })
}
