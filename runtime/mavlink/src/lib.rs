//! The port of an autopilot: MAVLink 2 over UDP, as ArduPilot speaks it.
//!
//! A thread reads datagrams and turns them into reports to a link; orders of the link are written as they come. No decision
//! is made here but which messages are believed: those of one autopilot, with finite numbers.

mod address;
mod decode;
mod encode;
mod port;

pub use self::address::{Address, AddressError};
pub use self::port::{Event, Port, Status};
