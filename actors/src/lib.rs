//! A drone as a supervision tree: five actors, each of which runs one node state machine, and their supervisor.
//!
//! A handler reads its [`Environment`]'s clock, steps its machine and passes the output on. Actors decide nothing about the
//! protocol, and never read the time of the operating system or of the asynchronous runtime.

mod address_book;
mod environment;
mod seat;
mod supervisor;

pub use address_book::{AddressBook, CastError};
pub use environment::Environment;
pub use seat::{InjectedCrash, Message, Stall};
pub use supervisor::{Drone, DroneConfig, SupervisorMessage};
