//! The port of a flight controller: a serial device, or TCP for simulations.
//!
//! [`Session`] asks one thing after the other, for who looks at a controller on the desk. [`Link`] is for flying: RC on time
//! from a thread of its own, telemetry beside it, reconnection. [`FlowPort`] is an optical flow module's.

mod address;
mod command_line;
mod fitness;
mod flow;
mod link;
mod priority;
mod rate;
mod session;
mod status;
mod wire;

pub use address::{Address, BadAddress};
pub use command_line::{CommandLineError, read_command_line};
pub use fitness::Found;
pub use flow::{FlowPort, listen_flow};
pub use link::{Event, Link};
pub use priority::raise_priority;
pub use session::{AskError, Latency, Session};
pub use status::{State, Status};
