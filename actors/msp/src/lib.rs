//! MSP, the MultiWii Serial Protocol, as Betaflight speaks it: frames, messages, and what makes a configuration unsafe.
//!
//! Pure functions and state machines on bytes: no clock, no port, no task. Both sides are here: requests as a companion
//! computer writes them, replies as a flight controller does.
//!
//! Layouts are those of Betaflight 4.6 (`src/main/msp/msp.c`, API 1.47). Fields of newer firmware are ignored, fields that
//! older firmware lacks are `Option`s.

mod acknowledgements;
mod channels;
pub mod check;
mod configuration;
mod conversation;
mod decoder;
mod field;
mod flow;
mod frame;
mod message;
mod response;
mod schedule;

pub use acknowledgements::RC_COUNTED;
pub use channels::{
    AUX_MAX, CHANNELS_MAX, Channel, MotorOutput, OutOfRange, Rc, ReceivedMotors, ReceivedRc,
    SetMotor, SetRawRc, Sticks, TooManyChannels,
};
pub use configuration::{Ask, CommandLineSettings, Configuration, Identity, OverrideSettings, ask};
pub use conversation::{Answer, BadAnswer, Conversation, Telemetry};
pub use decoder::{Counts, Decoder, FRAME_TIME_MAX};
pub use field::{Counted, Letters, Payload, ShortList, ShortText, Text, Unused};
pub use flow::FlowReading;
pub use frame::{
    Direction, EncodeError, FRAME_MAX, Frame, PAYLOAD_MAX, REQUEST_MAX, Version, acknowledge,
    encode, order, refuse, reply, request,
};
pub use message::*;
pub use response::StickResponse;
pub use schedule::{QUERIES, Query, RC_HOLD, RC_PERIOD, Schedule, TICK, Write};
