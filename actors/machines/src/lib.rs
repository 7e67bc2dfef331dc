//! What each actor of a drone decides, as pure state machines: no socket, no clock, no task, no random source of
//! the machine it runs on.

pub mod geometry;
pub mod identity;
pub mod time;
