//! What each actor of a drone decides, as pure state machines: no socket, no clock, no task, no random source of
//! the machine it runs on.

pub mod flaw;
pub mod formation;
pub mod geometry;
pub mod identity;
pub mod leader;
pub mod machine;
pub mod mission;
pub mod msp;
pub mod navigation;
pub mod node;
pub mod radio;
mod roster;
pub mod routing;
mod stall;
pub mod supervision;
pub mod time;
pub mod traffic;
pub mod wire;
