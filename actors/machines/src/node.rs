//! The five machines of a drone as whoever runs them sees them: one kind of input, one kind of effect.

use std::fmt;
use std::sync::Arc;

use bytes::Bytes;
use serde::{Deserialize, Serialize};

use crate::identity::{Ballot, NodeId};
use crate::machine::{Emitted, Machine, Stimulus, step};
use crate::radio::{Authenticator, Radio};
use crate::time::Timestamp;
use crate::{mission, msp, navigation, radio, routing};

/// One of a drone's five actors, in the order of the data's way through it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Address {
    /// Admits and sends frames.
    Radio,
    /// Knows the way to the master.
    Routing,
    /// Knows what the swarm does.
    Mission,
    /// Knows how to get there.
    Navigation,
    /// Speaks to the flight controller.
    Msp,
}

impl Address {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::Radio,
        Self::Routing,
        Self::Mission,
        Self::Navigation,
        Self::Msp,
    ];
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Radio => "radio",
            Self::Routing => "routing",
            Self::Mission => "mission",
            Self::Navigation => "navigation",
            Self::Msp => "msp",
        })
    }
}

/// An input on its way to one of the five.
#[derive(Debug, Clone, PartialEq)]
pub enum Envelope {
    /// For the radio.
    Radio(radio::Input),
    /// For the routing.
    Routing(routing::Input),
    /// For the mission.
    Mission(mission::Input),
    /// For the navigation; boxed, for most of what is posted are frames, which are smaller.
    Navigation(Box<navigation::Input>),
    /// For the flight controller's link.
    Msp(Box<msp::Input>),
}

impl Envelope {
    /// Whom it is for.
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
}

/// What a step of a machine asks of its surroundings.
#[derive(Debug, Clone, PartialEq)]
pub enum Effect {
    /// Hand this to the machine beside it.
    Post(Envelope),
    /// Put this frame on the air.
    Send {
        /// For whom it is; for all in range otherwise.
        to: Option<NodeId>,
        /// The frame.
        frame: Bytes,
        /// Whether it is sent only because its time has come; for whoever counts frames.
        keep_alive: bool,
    },
    /// Remember that a drone is to be found there.
    Locate {
        /// Which drone.
        sender: NodeId,
        /// Where a frame of its own came from.
        source: radio::Source,
    },
    /// Give this to the vehicle.
    Command(msp::FlightCommand),
    /// Keep this, so that the machine can be built anew.
    Keep(Checkpoint),
    /// Let this be seen.
    Observe(Observation),
}

/// What brings a drone down one of whose actors can't be kept alive, given which of them still run: its vehicle comes
/// down where it is, its mission stops counting on the drone, and without a mission the routing falls silent, so that
/// others do not count on it. No actor is restarted after that.
pub fn last_resort(is_up: impl Fn(Address) -> bool) -> Vec<Effect> {
    let vehicle = if is_up(Address::Msp) {
        Effect::Post(Envelope::Msp(Box::new(msp::Input::GiveUp)))
    } else {
        Effect::Command(msp::FlightCommand::Land)
    };
    let others = if is_up(Address::Mission) {
        Envelope::Mission(mission::Input::GiveUp)
    } else {
        Envelope::Routing(routing::Input::Stop)
    };
    vec![vehicle, Effect::Post(others)]
}

/// What can be seen of a drone from outside.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Observation {
    /// Of its radio.
    Radio(radio::Event),
    /// Of its routing.
    Routing(routing::Event),
    /// Of its mission.
    Mission(mission::Event),
}

/// What one of the five machines is rebuilt from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Checkpoint {
    /// The radio.
    Radio(radio::Checkpoint),
    /// The routing.
    Routing(Box<routing::Checkpoint>),
    /// The mission.
    Mission(Box<mission::Checkpoint>),
    /// The navigation.
    Navigation(Box<navigation::Checkpoint>),
    /// The link.
    Msp(msp::Checkpoint),
}

/// The newest checkpoint of each machine of a drone, and which life of its process this is.
#[derive(Debug, Clone)]
pub struct Checkpoints {
    boot: u32,
    radio: radio::Checkpoint,
    routing: Option<Box<routing::Checkpoint>>,
    mission: Option<Box<mission::Checkpoint>>,
    navigation: Option<Box<navigation::Checkpoint>>,
    msp: Option<msp::Checkpoint>,
}

impl Default for Checkpoints {
    /// Of a drone that starts for the first time.
    fn default() -> Self {
        Self {
            boot: 1,
            radio: radio::Checkpoint::default(),
            routing: None,
            mission: None,
            navigation: None,
            msp: None,
        }
    }
}

impl Checkpoints {
    /// Keeps a checkpoint in the place of the one before; whether nothing may be done on its account before it would
    /// outlive the process: whom the drone obeys, what it is doing and which numbers it may have used must never fall
    /// back.
    pub fn keep(&mut self, checkpoint: Checkpoint) -> bool {
        match checkpoint {
            Checkpoint::Radio(checkpoint) => {
                self.radio = checkpoint;
                true
            }
            Checkpoint::Routing(checkpoint) => {
                let before = self.routing.replace(checkpoint);
                before.is_none_or(|before| {
                    self.routing.as_ref().is_some_and(|it| it.has_advanced_since(&before))
                })
            }
            Checkpoint::Mission(checkpoint) => {
                let before = self.mission.replace(checkpoint);
                before.is_none_or(|before| {
                    self.mission.as_ref().is_some_and(|it| it.has_advanced_since(&before))
                })
            }
            Checkpoint::Navigation(checkpoint) => {
                // The mission says again where to go.
                self.navigation = Some(checkpoint);
                false
            }
            Checkpoint::Msp(checkpoint) => self.msp.replace(checkpoint) != Some(checkpoint),
        }
    }

    /// Whom the drone obeys, if anybody: a relay as its routing has it, for its mission is told nothing.
    #[must_use]
    pub fn ballot(&self) -> Option<Ballot> {
        let leader = self.mission.as_ref().and_then(|it| it.leader.ballot());
        leader.or_else(|| self.routing.as_ref()?.ballot())
    }

    /// What the drone is doing.
    #[must_use]
    pub fn state(&self) -> mission::State {
        (self.mission.as_ref()).map_or(mission::State::default(), |it| it.state)
    }

    /// Whether the drone takes part in a flight that is not over: on the ground too, from when it has heard of a
    /// master.
    #[must_use]
    pub fn are_of_a_flight(&self) -> bool {
        match self.state() {
            mission::State::Start => self.ballot().is_some(),
            state => state != mission::State::Finished,
        }
    }

    /// Which life of the drone's process this is, from 1.
    #[must_use]
    pub const fn boot(&self) -> u32 {
        self.boot
    }

    /// Each machine's, as far as there is one.
    pub fn iter(&self) -> impl Iterator<Item = Checkpoint> + '_ {
        let radio = std::iter::once(Checkpoint::Radio(self.radio));
        let routing = self.routing.clone().map(Checkpoint::Routing);
        let mission = self.mission.clone().map(Checkpoint::Mission);
        let navigation = self.navigation.clone().map(Checkpoint::Navigation);
        let msp = self.msp.map(Checkpoint::Msp);
        radio
            .chain(routing)
            .chain(mission)
            .chain(navigation)
            .chain(msp)
    }

    /// The process has started, for the `boot`th time from 1: nothing arms because of that.
    pub fn begin_incarnation(&mut self, boot: u32) {
        self.boot = boot;
        if boot > 1 {
            // Where it was on the way to is asked for anew, of a vehicle that went on meanwhile.
            self.navigation = None;
            if let Some(mission) = &mut self.mission {
                mission.begin_incarnation();
            }
        }
    }

    /// Whether this very checkpoint is the one that is kept.
    #[must_use]
    pub fn holds(&self, checkpoint: &Checkpoint) -> bool {
        match checkpoint {
            Checkpoint::Radio(checkpoint) => self.radio == *checkpoint,
            Checkpoint::Routing(checkpoint) => self.routing.as_ref() == Some(checkpoint),
            Checkpoint::Mission(checkpoint) => self.mission.as_ref() == Some(checkpoint),
            Checkpoint::Navigation(checkpoint) => self.navigation.as_ref() == Some(checkpoint),
            Checkpoint::Msp(checkpoint) => self.msp == Some(*checkpoint),
        }
    }
}

/// What a drone is: all that its machines are built with.
#[derive(Clone)]
pub struct Blueprint {
    /// Who it is.
    pub id: NodeId,
    /// How its radio is built.
    pub radio: radio::Config,
    /// Who signs its frames, and tells whether others signed theirs.
    pub authenticator: Arc<dyn Authenticator + Send + Sync>,
    /// How its routing is built.
    pub routing: routing::Config,
    /// How its mission is built.
    pub mission: mission::Config,
    /// How its navigation is built.
    pub navigation: navigation::Config,
    /// Builds its link to the flight controller from what outlived the one before.
    pub link: Arc<dyn Fn(Option<msp::Checkpoint>) -> Box<dyn msp::Link> + Send + Sync>,
}

impl fmt::Debug for Blueprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Blueprint")
            .field("id", &self.id)
            .finish_non_exhaustive()
    }
}

impl Blueprint {
    /// Builds one of the five from its checkpoint; `seed` is what a machine that draws lots starts from.
    #[must_use]
    pub fn build(
        &self,
        address: Address,
        seed: u64,
        now: Timestamp,
        checkpoints: &Checkpoints,
    ) -> NodeMachine {
        match address {
            Address::Radio => NodeMachine::Radio(Box::new(Radio::new(
                self.radio.clone(),
                Arc::clone(&self.authenticator),
                checkpoints.boot,
                checkpoints.radio,
                seed,
            ))),
            Address::Routing => NodeMachine::Routing(Box::new(routing::Routing::new(
                self.routing.clone(),
                seed,
                now,
                checkpoints.routing.as_deref().cloned(),
            ))),
            Address::Mission => NodeMachine::Mission(Box::new(mission::Mission::new(
                self.mission.clone(),
                checkpoints.mission.as_deref().cloned(),
            ))),
            Address::Navigation => NodeMachine::Navigation(Box::new(navigation::Navigation::new(
                self.id,
                self.navigation.clone(),
                checkpoints.navigation.as_deref().cloned(),
            ))),
            Address::Msp => NodeMachine::Msp((self.link)(checkpoints.msp)),
        }
    }
}

/// One of the five machines, in the seat of an actor.
pub enum NodeMachine {
    /// The radio.
    Radio(Box<Radio<Arc<dyn Authenticator + Send + Sync>>>),
    /// The routing.
    Routing(Box<routing::Routing>),
    /// The mission.
    Mission(Box<mission::Mission>),
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

/// How full a machine's fullest table is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Occupancy {
    /// Entries.
    pub len: usize,
    /// The most it takes.
    pub max: usize,
}

/// All that comes of one step.
#[derive(Debug, Default)]
pub struct StepOutput {
    /// What is to be done, in order.
    pub effects: Vec<Effect>,
    /// When the machine next wants to act by itself.
    pub deadline: Option<Timestamp>,
    /// How full its fullest table is.
    pub occupancy: Occupancy,
    /// Whether it handled a timeout and its deadline still is not after now. It would be woken at once, again and
    /// again.
    pub is_overdue: bool,
}

impl NodeMachine {
    /// Which of the five this is.
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

    /// One step; `reaction` is overwritten, its memory used again.
    ///
    /// # Panics
    /// When the envelope is for another machine: whoever runs cells delivers by [`Envelope::address`].
    pub fn step(&mut self, now: Timestamp, stimulus: Stimulus<Envelope>, output: &mut StepOutput) {
        output.effects.clear();
        let is_timeout = matches!(stimulus, Stimulus::Timeout);
        let effects = &mut output.effects;
        output.deadline = match (&mut *self, stimulus) {
            (Self::Radio(machine), Stimulus::Timeout) => {
                run(machine.as_mut(), now, Stimulus::Timeout, effects)
            }
            (Self::Routing(machine), Stimulus::Timeout) => {
                run(machine.as_mut(), now, Stimulus::Timeout, effects)
            }
            (Self::Mission(machine), Stimulus::Timeout) => {
                run(machine.as_mut(), now, Stimulus::Timeout, effects)
            }
            (Self::Navigation(machine), Stimulus::Timeout) => {
                run(machine.as_mut(), now, Stimulus::Timeout, effects)
            }
            (Self::Msp(machine), Stimulus::Timeout) => {
                run(machine.as_mut(), now, Stimulus::Timeout, effects)
            }
            (Self::Radio(machine), Stimulus::Input(Envelope::Radio(input))) => {
                run(machine.as_mut(), now, Stimulus::Input(input), effects)
            }
            (Self::Routing(machine), Stimulus::Input(Envelope::Routing(input))) => {
                run(machine.as_mut(), now, Stimulus::Input(input), effects)
            }
            (Self::Mission(machine), Stimulus::Input(Envelope::Mission(input))) => {
                run(machine.as_mut(), now, Stimulus::Input(input), effects)
            }
            (Self::Navigation(machine), Stimulus::Input(Envelope::Navigation(input))) => {
                run(machine.as_mut(), now, Stimulus::Input(*input), effects)
            }
            (Self::Msp(machine), Stimulus::Input(Envelope::Msp(input))) => {
                run(machine.as_mut(), now, Stimulus::Input(*input), effects)
            }
            (machine, Stimulus::Input(envelope)) => {
                unreachable!("{envelope:?} was delivered to {}", machine.address())
            }
        };
        output.occupancy = self.occupancy();
        output.is_overdue = is_timeout && output.deadline.is_some_and(|deadline| deadline <= now);
    }

    /// Reads what its next step will touch of what lies in it, and changes nothing. Whoever runs many cells does so
    /// with all that will soon be stepped, one after another: then their memory is waited for side by side, and is at
    /// hand when they are. After that, [`Self::read_further_ahead`].
    pub fn read_ahead(&self) {
        match self {
            Self::Radio(machine) => machine.read_ahead(),
            Self::Routing(machine) => machine.read_ahead(),
            Self::Mission(_) | Self::Navigation(_) | Self::Msp(_) => {}
        }
    }

    /// As [`Self::read_ahead`], of what lies elsewhere, where what lies in it says: what a frame of `sender` will touch
    /// there, or without one what a timer will.
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

fn run<M>(
    machine: &mut M,
    now: Timestamp,
    stimulus: Stimulus<M::Input>,
    effects: &mut Vec<Effect>,
) -> Option<Timestamp>
where
    M: Machine<Rejection = std::convert::Infallible> + ?Sized,
    M::Transmit: Into<Effect>,
    M::Event: Into<Effect>,
{
    let Ok(deadline) = step(machine, now, stimulus, |said: Emitted<M>| {
        effects.push(match said {
            Emitted::Transmit(transmit) => transmit.into(),
            Emitted::Event(event) => event.into(),
        });
    });
    deadline
}

impl From<radio::Transmit> for Effect {
    fn from(transmit: radio::Transmit) -> Self {
        match transmit {
            radio::Transmit::Send {
                to,
                frame,
                keep_alive,
            } => Self::Send {
                to,
                frame,
                keep_alive,
            },
            radio::Transmit::Locate { sender, source } => Self::Locate { sender, source },
            radio::Transmit::Traffic { sender, intent } => {
                Self::Post(Envelope::Navigation(Box::new(navigation::Input::Traffic {
                    sender,
                    intent,
                })))
            }
            radio::Transmit::Resync => {
                Self::Post(Envelope::Navigation(Box::new(navigation::Input::ResendIntent)))
            }
            radio::Transmit::Delivery {
                to,
                payload,
                delivered,
            } => Self::Post(Envelope::Routing(routing::Input::Delivery {
                to,
                payload,
                delivered,
            })),
            radio::Transmit::Received {
                sender,
                ballot,
                payload,
            } => Self::Post(Envelope::Routing(routing::Input::Received {
                sender,
                ballot,
                payload,
            })),
        }
    }
}

impl From<routing::Transmit> for Effect {
    fn from(transmit: routing::Transmit) -> Self {
        Self::Post(match transmit {
            routing::Transmit::Send {
                to,
                ballot,
                payload,
                keep_alive,
            } => Envelope::Radio(radio::Input::Send {
                to,
                ballot,
                payload,
                keep_alive,
            }),
            routing::Transmit::Inform(notice) => Envelope::Mission(mission::Input::Routing(notice)),
        })
    }
}

impl From<mission::Transmit> for Effect {
    fn from(transmit: mission::Transmit) -> Self {
        use mission::Transmit;
        let input = match transmit {
            Transmit::Lead(ballot) => routing::Input::Lead(ballot),
            Transmit::Publish {
                ballot,
                sequence,
                order,
            } => routing::Input::Publish {
                ballot,
                sequence,
                order,
            },
            Transmit::Acknowledge { ballot, sequence } => {
                routing::Input::Acknowledge { ballot, sequence }
            }
            Transmit::Discover => routing::Input::Discover,
            Transmit::TopologyChanges => routing::Input::TopologyChanges,
            Transmit::Land => routing::Input::Land,
            Transmit::Stop => routing::Input::Stop,
            Transmit::Resync => routing::Input::Resync,
            Transmit::Goal(goal) => {
                return Self::Post(Envelope::Navigation(Box::new(navigation::Input::Goal(
                    goal,
                ))));
            }
            Transmit::Locate => {
                return Self::Post(Envelope::Navigation(Box::new(navigation::Input::Locate)));
            }
        };
        Self::Post(Envelope::Routing(input))
    }
}

impl From<navigation::Transmit> for Effect {
    fn from(transmit: navigation::Transmit) -> Self {
        Self::Post(match transmit {
            navigation::Transmit::FlightCommand(command) => {
                Envelope::Msp(Box::new(msp::Input::FlightCommand(command)))
            }
            navigation::Transmit::Inform(notice) => {
                Envelope::Mission(mission::Input::Navigation(notice))
            }
            navigation::Transmit::AnnounceIntent { intent, immediately } => {
                Envelope::Radio(radio::Input::AnnounceIntent { intent, immediately })
            }
        })
    }
}

impl From<msp::Transmit> for Effect {
    fn from(transmit: msp::Transmit) -> Self {
        let input = match transmit {
            msp::Transmit::Command(command) => return Self::Command(command),
            msp::Transmit::Telemetry(telemetry) => navigation::Input::Telemetry(telemetry),
            msp::Transmit::Resync => navigation::Input::Resync,
        };
        Self::Post(Envelope::Navigation(Box::new(input)))
    }
}

impl From<radio::Event> for Effect {
    fn from(event: radio::Event) -> Self {
        match event {
            radio::Event::Checkpoint(checkpoint) => Self::Keep(Checkpoint::Radio(checkpoint)),
            event => Self::Observe(Observation::Radio(event)),
        }
    }
}

impl From<routing::Event> for Effect {
    fn from(event: routing::Event) -> Self {
        match event {
            routing::Event::Checkpoint(checkpoint) => Self::Keep(Checkpoint::Routing(checkpoint)),
            event => Self::Observe(Observation::Routing(event)),
        }
    }
}

impl From<mission::Event> for Effect {
    fn from(event: mission::Event) -> Self {
        match event {
            mission::Event::Checkpoint(checkpoint) => Self::Keep(Checkpoint::Mission(checkpoint)),
            event => Self::Observe(Observation::Mission(event)),
        }
    }
}

impl From<navigation::Event> for Effect {
    fn from(event: navigation::Event) -> Self {
        let navigation::Event::Checkpoint(checkpoint) = event;
        Self::Keep(Checkpoint::Navigation(checkpoint))
    }
}

impl From<msp::Event> for Effect {
    fn from(event: msp::Event) -> Self {
        let msp::Event::Checkpoint(checkpoint) = event;
        Self::Keep(Checkpoint::Msp(checkpoint))
    }
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;
    use std::time::Duration;

    use super::*;
    use crate::machine::Output;

    /// A link whose deadline stays where it is, whatever it handles.
    struct Stuck(Timestamp);

    impl Machine for Stuck {
        type Input = msp::Input;
        type Transmit = msp::Transmit;
        type Event = msp::Event;
        type Rejection = Infallible;

        fn handle_input(&mut self, _: Timestamp, _: msp::Input) -> Result<(), Infallible> {
            Ok(())
        }

        fn handle_timeout(&mut self, _: Timestamp) {}

        fn poll_output(&mut self) -> Output<msp::Transmit, msp::Event> {
            let deadline = Some(self.0);
            Output::Idle { deadline }
        }
    }

    #[test]
    fn a_machine_is_overdue_whose_deadline_is_not_after_the_timeout_that_it_handled() {
        let deadline = Timestamp::from_secs_f64(2.0);
        let is_overdue = |now, stimulus| {
            let (mut machine, mut output) = (
                NodeMachine::Msp(Box::new(Stuck(deadline))),
                StepOutput::default(),
            );
            machine.step(now, stimulus, &mut output);
            output.is_overdue
        };
        let input = || Stimulus::Input(Envelope::Msp(Box::new(msp::Input::GiveUp)));
        let later = deadline + Duration::from_secs(1);
        assert!(is_overdue(deadline, Stimulus::Timeout) && is_overdue(later, Stimulus::Timeout));
        assert!(!is_overdue(Timestamp::ZERO, Stimulus::Timeout));
        assert!(
            !is_overdue(later, input()),
            "a message may ask for a timeout at once"
        );
    }
}
