//! Effects of a step, and the conversions of each machine's outputs into them.

use bytes::Bytes;
use muster_msp::SetRawRc;
use serde::{Deserialize, Serialize};

use super::{Address, Checkpoint, Envelope};
use crate::identity::NodeId;
use crate::{indoor, mission, msp, navigation, radio, routing};

/// An effect of a step, carried out by the driver.
#[derive(Debug, Clone, PartialEq)]
pub enum Effect {
    /// Deliver this to another machine of the drone.
    Post(Envelope),
    /// Send this frame.
    Send {
        /// Destination of a unicast. `None` for a broadcast.
        to: Option<NodeId>,
        /// The frame.
        frame: Bytes,
        /// Whether the frame is periodic and carries nothing new. For statistics.
        keep_alive: bool,
    },
    /// Learn a drone's transport address.
    LearnAddress {
        /// The drone.
        sender: NodeId,
        /// Source of an authenticated frame of the drone.
        source: radio::Source,
    },
    /// Keep this signed revocation list, which radios are built with from now on.
    KeepList(Bytes),
    /// Send this to the closed-form vehicle.
    Command(msp::FlightCommand),
    /// Give this to the port of the flight controller: the newest RC frame, to be repeated for a bounded time. `None` stops
    /// RC.
    Rc(Option<SetRawRc>),
    /// Send this to the autopilot.
    Order(msp::autopilot::Order),
    /// Store this checkpoint, from which the machine can be rebuilt.
    StoreCheckpoint(Checkpoint),
    /// Report this to observers.
    Observe(Observation),
}

/// An event that observers of a drone receive.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Observation {
    /// From the radio.
    Radio(radio::Event),
    /// From the routing.
    Routing(routing::Event),
    /// From the mission.
    Mission(mission::Event),
    /// From the navigation.
    Navigation(navigation::Event),
}

/// Effects that land a drone with an actor that keeps failing, given which actors still run.
///
/// The vehicle lands on the spot and the mission is aborted. Without a mission the routing stops, so that the others do
/// not wait for the drone. No actor is restarted after that.
pub fn emergency_landing(is_up: impl Fn(Address) -> bool) -> Vec<Effect> {
    let vehicle = if is_up(Address::Msp) {
        Effect::Post(Envelope::Msp(Box::new(msp::Input::GiveUp)))
    } else {
        Effect::Command(msp::FlightCommand::Land)
    };
    let protocol = if is_up(Address::Mission) {
        Envelope::Mission(mission::Input::GiveUp)
    } else {
        Envelope::Routing(routing::Input::Stop)
    };
    vec![vehicle, Effect::Post(protocol)]
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
            radio::Transmit::Locate { sender, source } => Self::LearnAddress { sender, source },
            radio::Transmit::KeepList(list) => Self::KeepList(list),
            radio::Transmit::Traffic {
                sender,
                intent,
                heard_at,
            } => Self::Post(Envelope::Navigation(Box::new(navigation::Input::Traffic {
                sender,
                intent,
                heard_at,
            }))),
            radio::Transmit::Resync => Self::Post(Envelope::Navigation(Box::new(
                navigation::Input::ResendIntent,
            ))),
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
            routing::Transmit::Deaf(deaf) => {
                Envelope::Navigation(Box::new(navigation::Input::Deaf(deaf)))
            }
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
            Transmit::Leave => routing::Input::Leave,
            Transmit::Land => routing::Input::Land,
            Transmit::Stop => routing::Input::Stop,
            Transmit::Resync => routing::Input::Resync,
            Transmit::Messages(messages) => routing::Input::Messages(messages),
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
            navigation::Transmit::AnnounceIntent {
                intent,
                immediately,
            } => Envelope::Radio(radio::Input::AnnounceIntent {
                intent,
                immediately,
            }),
            navigation::Transmit::Resync => Envelope::Radio(radio::Input::ResendTraffic),
        })
    }
}

impl From<msp::Transmit> for Effect {
    fn from(transmit: msp::Transmit) -> Self {
        let input = match transmit {
            msp::Transmit::Command(command) => return Self::Command(command),
            msp::Transmit::Rc(rc) => return Self::Rc(rc),
            msp::Transmit::Order(order) => return Self::Order(order),
            msp::Transmit::Telemetry(telemetry) => navigation::Input::Telemetry(telemetry),
            msp::Transmit::Resync => navigation::Input::Resync,
        };
        Self::Post(Envelope::Navigation(Box::new(input)))
    }
}

impl From<radio::Event> for Effect {
    fn from(event: radio::Event) -> Self {
        match event {
            radio::Event::Checkpoint(checkpoint) => {
                Self::StoreCheckpoint(Checkpoint::Radio(checkpoint))
            }
            event => Self::Observe(Observation::Radio(event)),
        }
    }
}

impl From<routing::Event> for Effect {
    fn from(event: routing::Event) -> Self {
        match event {
            routing::Event::Checkpoint(checkpoint) => {
                Self::StoreCheckpoint(Checkpoint::Routing(checkpoint))
            }
            event => Self::Observe(Observation::Routing(event)),
        }
    }
}

impl From<mission::Event> for Effect {
    fn from(event: mission::Event) -> Self {
        match event {
            mission::Event::Checkpoint(checkpoint) => {
                Self::StoreCheckpoint(Checkpoint::Mission(checkpoint))
            }
            mission::Event::AgentCheckpoint(checkpoint) => {
                Self::StoreCheckpoint(Checkpoint::Agent(checkpoint))
            }
            event => Self::Observe(Observation::Mission(event)),
        }
    }
}

impl From<navigation::Event> for Effect {
    fn from(event: navigation::Event) -> Self {
        match event {
            navigation::Event::Checkpoint(checkpoint) => {
                Self::StoreCheckpoint(Checkpoint::Navigation(checkpoint))
            }
            navigation::Event::Indoor(indoor::Event::Checkpoint(checkpoint)) => {
                Self::StoreCheckpoint(Checkpoint::Indoor(checkpoint))
            }
            event => Self::Observe(Observation::Navigation(event)),
        }
    }
}

impl From<msp::Event> for Effect {
    fn from(event: msp::Event) -> Self {
        let msp::Event::Checkpoint(checkpoint) = event;
        Self::StoreCheckpoint(Checkpoint::Msp(Box::new(checkpoint)))
    }
}
