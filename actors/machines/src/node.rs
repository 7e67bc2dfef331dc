//! The five state machines of a drone behind one interface: one type of input, one type of effect.

mod checkpoints;
mod effects;
mod machine;

use std::fmt;

use serde::{Deserialize, Serialize};

pub use checkpoints::{Checkpoint, Checkpoints};
pub use effects::{Effect, Observation, emergency_landing};
pub use machine::{Blueprint, LinkBuilder, NodeMachine, Occupancy, StepOutput};

use crate::{mission, msp, navigation, radio, routing};

/// A drone's five actors, in the order in which a received frame passes them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Address {
    /// Sends, receives and authenticates frames.
    Radio,
    /// Finds routes between master and members.
    Routing,
    /// Runs the swarm protocol.
    Mission,
    /// Flies to the mission's goals.
    Navigation,
    /// Link to the flight controller.
    Msp,
}

impl Address {
    /// All addresses, in order.
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

/// An input with its destination.
#[derive(Debug, Clone, PartialEq)]
pub enum Envelope {
    /// To the radio.
    Radio(radio::Input),
    /// To the routing.
    Routing(routing::Input),
    /// To the mission.
    Mission(mission::Input),
    /// To the navigation. Boxed: most envelopes carry frames, which are smaller.
    Navigation(Box<navigation::Input>),
    /// To the flight controller's link.
    Msp(Box<msp::Input>),
}

impl Envelope {
    /// The destination.
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

#[cfg(test)]
mod tests;
