//! One drone as a supervision tree: five thin actors, each with one machine in its seat, and their supervisor.
//!
//! An actor's handler reads the clock of its [`Environment`], steps its machine and hands over what came of it.
//! Nothing about the protocol is decided here, and no actor asks the operating system or the asynchronous runtime
//! for the time.

mod address_book;
mod environment;
mod seat;
mod supervisor;

pub use address_book::{AddressBook, Refused};
pub use environment::Environment;
pub use seat::{InjectedCrash, Message, Stall};
pub use supervisor::{Drone, DroneConfig, SupervisorMessage};
